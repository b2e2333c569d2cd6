"""The practitioner's objective: quick tracking that survives a wrong gain and a late frame.

Over the cases of an ensemble (gain 0.7, 1, 1.3; latency nominal and one frame more, unless the settings say otherwise)
each step response is scored by

    s = ITAE / (2.5 theta^2 r) + w_u (TV / |u_r| - 1.2)+ + w_o (OS - 2 %)+ + w_e |e_end| / r

and the value is

    T = 0.7 max s + 0.3 mean s
    J = T + w_b max(T, 1) (rho(Ms) + rho(OS_nominal)),   rho(v) = ((v - comfort)+ / (bound - comfort))^2,

with Ms the worst of all cases. Where they are asked for, rho of the nominal settling time and of the nominal noise gain
stand in the same sum. Of a model that has rivals nobody knows which one the device is: "nominal" is then the worst of
their nominal cases.

Scales: r is the setpoint and u_r the voltage that holds it, the least variation TV that can reach it. theta is the
effective delay of the nominal loop of the model (`reduced_model`): a loop tuned by SIMC with tau_c = theta answers a
step like exp(-theta s) / (1 + theta s), whose ITAE is 2.5 theta^2 r, so s = 1 is what the closed formula promises on a
linear plant of the right gain. e_end is the mean error over the last tenth of the run.

rho keeps the two bounds: it sets in at a comfortable value, is 1 at the bound and grows as a parabola. It is smooth
on purpose: with an exact penalty, which has a kink on the bound, pattern and simplex searches get stuck in the corner
where both bounds meet. It is weighed with T, since theta may be far shorter than a loop that keeps the bounds can be.
The minimum lies between comfort and bound unless, at the bound, tracking still gains more than 2 w_b of itself per
width (bound - comfort); `PractitionerReport.bounds_kept` says whether both are kept. The bound on Ms covers
the whole ensemble, that on the overshoot the nominal plants; with more gain and latency than planned an
overshoot is scored, not forbidden.
"""

import math
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, replace
from statistics import fmean, stdev

from bender_loop.control.metrics import StepMetrics
from bender_loop.control.pid import Gains
from bender_tuner.model.disturbances import noise_gain_V_per_um
from bender_tuner.model.ensemble import Case, Ensemble
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.model.reduced_model import reduce_model
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.following import Following

_SIMC_ITAE = 2.5
_LARGEST_EXCESS = 30.0
_LEAST_VARIATION_V = 1e-3
_NOISES, _NOISE_SHARE = 8, 0.01
_COMFORT = 0.9
"""In parts of a bound on settling or noise gain: up to there nothing is paid."""


@dataclass(frozen=True, slots=True)
class Priorities:
    """Bounds and weights of the practitioner's objective.

    Attributes:
        sensitivity_bound: largest Ms over the ensemble.
        sensitivity_comfort: Ms up to which nothing is paid.
        overshoot_bound: largest overshoot on the nominal plant, as a share of the step.
        overshoot_comfort: overshoot up to which nothing is paid.
        settling_bound_s: largest settling time (2 %) of the nominal plant, None for any.
        noise_gain_bound_V_per_um: largest noise gain of the nominal loop, None for any.
        bound_weight: w_b, what is paid at a bound; a SIMC loop scores about 1.
        worst_share: weight of the worst case against the mean of all.
        effort_weight: w_u.
        effort_allowance: variation in multiples of the least one that costs nothing.
        overshoot_weight: w_o, in every case, beyond `overshoot_bound`.
        final_error_weight: w_e.

    Raises:
        ValueError: a value is out of its range.
    """

    sensitivity_bound: float = 1.7
    sensitivity_comfort: float = 1.6
    overshoot_bound: float = 0.02
    overshoot_comfort: float = 0.01
    settling_bound_s: float | None = None
    noise_gain_bound_V_per_um: float | None = None
    bound_weight: float = 0.5
    worst_share: float = 0.7
    effort_weight: float = 0.25
    effort_allowance: float = 1.2
    overshoot_weight: float = 2.0
    final_error_weight: float = 5.0

    def __post_init__(self) -> None:
        for name, least in (("sensitivity", 1.0), ("overshoot", 0.0)):
            comfort, bound = getattr(self, f"{name}_comfort"), getattr(self, f"{name}_bound")
            if not (math.isfinite(bound) and least <= comfort < bound):
                raise ValueError(
                    f"{name}_comfort must be >= {least:g} and below {name}_bound, found {comfort!r} and {bound!r}"
                )
        for name in ("settling_bound_s", "noise_gain_bound_V_per_um"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a finite number > 0 or None, found {value!r}")
        if not 0.0 <= self.worst_share <= 1.0:
            raise ValueError(f"worst_share must lie in [0, 1], found {self.worst_share!r}")
        names = ("bound_weight", "effort_weight", "effort_allowance", "overshoot_weight", "final_error_weight")
        for name in names:
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be a finite number >= 0, found {value!r}")


@dataclass(frozen=True, slots=True)
class CaseScore:
    """One case: which, its step response, its Ms and its score s."""

    gain_factor: float
    latency_frames: int
    metrics: StepMetrics
    sensitivity_peak: float
    score: float
    rival: str = ""


@dataclass(frozen=True, slots=True)
class PractitionerReport:
    """What stands behind a value of the objective.

    Attributes:
        value: J.
        tracking: the part of J from the step responses.
        penalty: the part from the bounds, 0 within the comfortable values.
        bounds_kept: worst Ms and nominal overshoot lie within their bounds, for every rival too, and what else was
            asked for.
        worst_sensitivity_peak: largest Ms of all cases.
        noise_gain_V_per_um: the largest of the nominal loops; NaN where no bound was asked for.
        nominal: the nominal case.
        cases: all cases, the nominal one among them.
        overshoot_percent: the largest of the nominal cases, those of rivals among them.
        settling_time_s: the longest of the same; NaN where one never settles.
    """

    value: float
    tracking: float
    penalty: float
    bounds_kept: bool
    worst_sensitivity_peak: float
    nominal: CaseScore
    cases: tuple[CaseScore, ...]
    noise_gain_V_per_um: float = math.nan
    overshoot_percent: float = math.nan
    settling_time_s: float = math.nan


class PractitionerObjective:
    """The objective on one ensemble: call it with gains, or `evaluate` them for the report."""

    def __init__(self, experiment: StepExperiment, ensemble: Ensemble, priorities: Priorities | None = None) -> None:
        """Set up one run per case.

        Args:
            experiment: the nominal step; each case runs it with its own plant and latency.
            ensemble: built for the setpoint, sampling and limits of `experiment`.
            priorities: bounds and weights; None for the standard ones.
        """
        self.ensemble = ensemble
        self.priorities = Priorities() if priorities is None else priorities
        self._setpoint_um = abs(experiment.setpoint_um)
        self._runs = [experiment.with_plant(case.plant, case.latency_frames) for case in ensemble.cases]
        self._itae_scales = {x.rival: _SIMC_ITAE * _delay_s(x) ** 2 * self._setpoint_um for x in ensemble.expected}
        self._expected = [ensemble.cases.index(x) for x in ensemble.expected]

    def __call__(self, gains: Gains) -> float:
        """J; inf where a run diverged."""
        return self.evaluate(gains).value

    def evaluate(self, gains: Gains, following: Following | None = None) -> PractitionerReport:
        """J and what it is made of, for the PID block alone or in a model-following controller."""
        pairs = zip(self.ensemble.cases, self._runs, strict=True)
        scores = tuple(self._score(gains, case, run, following) for case, run in pairs)
        expected = [scores[k].metrics for k in self._expected]
        overshoot_percent = _largest(x.overshoot_percent for x in expected)
        settling_time_s = _largest(x.settling_time_s for x in expected)
        values = [score.score for score in scores]
        share = self.priorities.worst_share
        tracking = share * max(values) + (1.0 - share) * sum(values) / len(values)
        worst_peak = max(score.sensitivity_peak for score in scores)
        asked = self._asked(gains, worst_peak, overshoot_percent, settling_time_s)
        excess = sum(_rho(*x) for x in asked.values())
        penalty = self.priorities.bound_weight * max(tracking, 1.0) * excess if excess else 0.0
        return PractitionerReport(
            value=tracking + penalty,
            tracking=tracking,
            penalty=penalty,
            bounds_kept=all(value <= bound for value, _, bound in asked.values()),
            worst_sensitivity_peak=worst_peak,
            nominal=scores[self._expected[0]],
            cases=scores,
            noise_gain_V_per_um=asked["noise"][0] if "noise" in asked else math.nan,
            overshoot_percent=overshoot_percent,
            settling_time_s=settling_time_s,
        )

    def spread(self, gains: Gains, following: Following | None = None) -> float:
        """Return the standard deviation of J over other noises of the readings, as a part of its mean.

        Where there is no noise it is a hundredth of the set-point.
        """
        values: list[float] = []
        for number in range(1, _NOISES + 1):
            other = copy(self)
            other._runs = [self._with_noise(x, number) for x in self._runs]
            values.append(other.evaluate(gains, following).value)
        return stdev(values) / fmean(values) if all(map(math.isfinite, values)) else 0.0

    def _with_noise(self, run: StepExperiment, number: int) -> StepExperiment:
        noise_um = run.sampling.noise_um or _NOISE_SHARE * self._setpoint_um
        return replace(run, seed=run.seed + number, sampling=replace(run.sampling, noise_um=noise_um))

    def keeps_overshoot(self, gains: Gains, following: Following) -> bool:
        """Return whether every nominal case keeps the bound on its overshoot up, down and up again."""
        bound = 100.0 * self.priorities.overshoot_bound
        runs = (self._runs[k] for k in self._expected)
        return all(x.up_and_down(gains, following).overshoot_percent <= bound for x in runs)

    def known_sine_ratio(self, frequency_Hz: float, gains: Gains, following: Following) -> float:
        """The error of a sine that is known beforehand to that of the PID block alone: the largest of all cases."""
        return max(
            x.known_sine_um(frequency_Hz, gains, following) / x.known_sine_um(frequency_Hz, gains) for x in self._runs
        )

    def _asked(
        self, gains: Gains, worst_peak: float, overshoot_percent: float, settling_time_s: float
    ) -> dict[str, tuple[float, float, float]]:
        """What has a bound: its value, up to where nothing is paid, and the bound."""
        p = self.priorities
        found = {
            "sensitivity": (worst_peak, p.sensitivity_comfort, p.sensitivity_bound),
            "overshoot": (overshoot_percent / 100.0, p.overshoot_comfort, p.overshoot_bound),
        }
        if p.settling_bound_s is not None:
            settling_s = math.inf if math.isnan(settling_time_s) else settling_time_s
            found["settling"] = (settling_s, _COMFORT * p.settling_bound_s, p.settling_bound_s)
        if p.noise_gain_bound_V_per_um is not None:
            bound = p.noise_gain_bound_V_per_um
            largest = max(noise_gain_V_per_um(gains, x.delayed) for x in self.ensemble.expected)
            found["noise"] = (largest, _COMFORT * bound, bound)
        return found

    def _score(self, gains: Gains, case: Case, run: StepExperiment, following: Following | None) -> CaseScore:
        metrics = run.metrics(run.run(gains, following))
        least_variation = max(abs(case.linearisation.point.voltage_V), _LEAST_VARIATION_V)
        p = self.priorities
        score = (
            metrics.itae_um_s2 / self._itae_scales[case.rival]
            + p.effort_weight * max(metrics.total_variation_V / least_variation - p.effort_allowance, 0.0)
            + p.overshoot_weight * max(metrics.overshoot_percent / 100.0 - p.overshoot_bound, 0.0)
            + p.final_error_weight * abs(metrics.steady_state_error_um) / self._setpoint_um
        )
        peak = sensitivity_peak(gains, case.delayed)
        return CaseScore(case.gain_factor, case.latency_frames, metrics, peak, score, case.rival)


def _delay_s(case: Case) -> float:
    """The effective delay of a loop."""
    return reduce_model(case.linearisation.model, case.latency_frames).delay_s


def _largest(values: Iterable[float]) -> float:
    """The largest; NaN, which stands for never, where one is."""
    found = list(values)
    return math.nan if any(map(math.isnan, found)) else max(found)


def _rho(value: float, comfort: float, bound: float) -> float:
    """0 up to `comfort`, 1 at `bound`, a parabola; bounded, so that unstable gains can still be ranked."""
    return min(max(value - comfort, 0.0) / (bound - comfort), _LARGEST_EXCESS) ** 2
