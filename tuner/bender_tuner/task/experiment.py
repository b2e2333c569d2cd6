"""The run that an objective judges: a step of the setpoint in the closed loop."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.closed_loop import simulate
from bender_loop.control.metrics import StepMetrics, step_metrics
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.plant import Plant, restart
from bender_loop.control.references import Profile, Reference, Sine, Step
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Array, Trace
from bender_loop.fmu.followed_model import Loop, run_following
from bender_tuner.task.following import Following

FINEST_STEP_S, _FINEST_SHARE = 1e-3, 0.01
_SAME_S = 1e-9
_DOWN = 0.5
"""Part of the way up."""
_PERIODS = 2


class Moves(NamedTuple):
    """What becomes of a set-point that moves up, half of it down, and up again.

    Attributes:
        overshoot_percent: the largest, of the way up; inf for a runaway.
        settling_time_s: the longest; inf where a move does not settle.
        rms_um: from the set-point.
    """

    overshoot_percent: float
    settling_time_s: float
    rms_um: float


@dataclass(frozen=True, slots=True)
class StepExperiment:
    """A step from rest to `setpoint_um`, run anew for every set of gains.

    Attributes:
        plant: reset before each run.
        limits: of the command.
        setpoint_um: level of the step.
        sampling: what the controller sees; with more than one substep the time between the frames is judged too.
        duration_s: length of a run.
        seed: of the noise, the same in every run, so that an objective stays a function of the gains.
        slew_V_per_s: bound of the command's rate, inf for none.
        believed_latency_frames: that a model-following controller reckons with; None for that of `sampling`.

    Raises:
        ValueError: the setpoint is zero or not finite, or the duration is shorter than a period.
    """

    plant: Plant
    limits: Limits
    setpoint_um: float
    sampling: Sampling
    duration_s: float
    seed: int = 0
    slew_V_per_s: float = math.inf
    believed_latency_frames: int | None = None

    def __post_init__(self) -> None:
        if not math.isfinite(self.setpoint_um) or self.setpoint_um == 0.0:
            raise ValueError(f"setpoint_um must be a finite number other than 0, found {self.setpoint_um!r}")
        self.sampling.ticks(self.duration_s)

    def run(self, gains: Gains, following: Following | None = None) -> Trace:
        """The step response with `gains`, of the PID block alone or in a model-following controller."""
        return self._run(Step(self.setpoint_um), self.duration_s, gains, following)

    def up_and_down(self, gains: Gains, following: Following | None = None) -> Moves:
        """What becomes of moves on the way up, half of it down, and up again.

        A plant with a memory, or one that is not linear, answers a step from rest as it answers no other.
        """
        rest_um = restart(self.plant)
        leg_s = self.sampling.ticks(self.duration_s) * self.sampling.period_s
        shares = (1.0, 1.0 - _DOWN, 1.0)
        levels_um = tuple(rest_um + x * (self.setpoint_um - rest_um) for x in shares)
        course = Profile(tuple(k * leg_s for k in range(len(shares))), levels_um)
        trace = self._run(course, len(shares) * leg_s, gains, following)
        found = [
            self._metrics(_part(trace, begin_s, begin_s + leg_s), level_um)
            for begin_s, level_um in zip(course.times_s, levels_um, strict=True)
        ]
        return Moves(
            max(x.overshoot_percent * height for x, height in zip(found, (1.0, _DOWN, _DOWN), strict=True)),
            max(math.inf if math.isnan(x.settling_time_s) else x.settling_time_s for x in found),
            _rms_um(trace),
        )

    def known_sine_um(self, frequency_Hz: float, gains: Gains, following: Following | None = None) -> float:
        """The rms from a sine over most of the set-point's height that a model-following controller knows beforehand.

        The first period is not counted.
        """
        rest_um = restart(self.plant)
        height_um = self.setpoint_um - rest_um
        sine = Sine(0.4 * height_um, frequency_Hz, rest_um + 0.5 * height_um, -0.5 * math.pi)
        trace = self._run(sine, _PERIODS / frequency_Hz, gains, following, preview=True)
        return _rms_um(_part(trace, 1.0 / frequency_Hz, _PERIODS / frequency_Hz))

    def _run(
        self,
        reference: Reference,
        duration_s: float,
        gains: Gains,
        following: Following | None,
        *,
        preview: bool = False,
    ) -> Trace:
        rng = np.random.default_rng(self.seed)
        if following is not None:
            latency, sampling = self.believed_latency_frames, self.sampling
            loop = Loop(
                sampling.period_s,
                self.limits,
                self.slew_V_per_s,
                sampling.latency_frames if latency is None else latency,
                tuple(sampling.exposure_weights().tolist()),
                preview=preview,
            )
            return run_following(
                self.plant, following.model, following.fmu, gains, loop, reference, sampling, duration_s, rng
            )
        return simulate(
            self.plant,
            gains,
            self.limits,
            reference,
            self.sampling,
            duration_s,
            rng,
            slew_V_per_s=self.slew_V_per_s,
        )

    def metrics(self, trace: Trace) -> StepMetrics:
        """Figures of a trace of this experiment, between the frames too where the trace shows it."""
        return self._metrics(trace, self.setpoint_um)

    def _metrics(self, trace: Trace, setpoint_um: float) -> StepMetrics:
        return step_metrics(trace, setpoint_um, intersample=self.sampling.substeps > 1)

    def with_plant(self, plant: Plant, latency_frames: int) -> "StepExperiment":
        """The same step on another plant and with another latency, of which a controller knows nothing."""
        return replace(
            self,
            plant=plant,
            sampling=replace(self.sampling, latency_frames=latency_frames),
            believed_latency_frames=self.sampling.latency_frames,
        )


def between_frames(experiment: StepExperiment) -> StepExperiment:
    """Return the same step with the time between the frames, as `seen_between_frames` has it."""
    return replace(experiment, sampling=seen_between_frames(experiment.sampling))


def seen_between_frames(sampling: Sampling) -> Sampling:
    """Return the same camera with plant steps of 1 ms or less, or of a hundredth of a period where that is longer."""
    finest_s = max(FINEST_STEP_S, _FINEST_SHARE * sampling.period_s)
    finer = max(1, math.ceil(sampling.plant_step_s / finest_s - 1e-9))
    return replace(sampling, substeps=finer * sampling.substeps)


def _rms_um(trace: Trace) -> float:
    """From the set-point; inf for a runaway."""
    return math.inf if trace.diverged else float(np.sqrt(np.mean((trace.displacement_um - trace.setpoint_um) ** 2)))


def _part(trace: Trace, begin_s: float, end_s: float) -> Trace:
    """A part of a trace; the whole of one that has diverged, which tells no more than that."""
    if trace.diverged:
        return trace
    rows = _within(trace.time_s, begin_s, end_s)
    names = "time_s", "setpoint_um", "measured_um", "displacement_um", "voltage_V"
    part = replace(trace, **{x: getattr(trace, x)[rows] for x in names})
    if trace.fine_time_s is None or trace.fine_displacement_um is None:
        return part
    rows = _within(trace.fine_time_s, begin_s, end_s)
    return replace(part, fine_time_s=trace.fine_time_s[rows], fine_displacement_um=trace.fine_displacement_um[rows])


def _within(time_s: Array, begin_s: float, end_s: float) -> NDArray[np.bool_]:
    return (time_s >= begin_s - _SAME_S) & (time_s <= end_s + _SAME_S)
