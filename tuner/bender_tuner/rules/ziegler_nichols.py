"""Ziegler and Nichols' rule from the ultimate point, and whether the rule means anything for the loop at hand.

J. G. Ziegler and N. B. Nichols, Optimum settings for automatic controllers, Transactions of the ASME 64 (1942)
759-768: P 0.5 Ku; PI 0.45 Ku, Ti = Tu/1.2; PID 0.6 Ku, Ti = Tu/2, Td = Tu/8.

The rule supposes a plant whose own lag limits the gain. A plant that answers faster than it is sampled has no such
limit: what then looks like an ultimate point is made by the sampler, and moves when the rate does. (Any sampled plant
that answers, one sample late at best, has a finite ultimate gain, because one pole leaves the circle in the end.)
"""

from dataclasses import dataclass
from enum import Enum

from bender_loop.control.pid import Gains
from bender_loop.control.plant import Plant
from bender_loop.control.sampling import Sampling
from bender_tuner.model.linear_model import Linearisation
from bender_tuner.model.loop_transfer import DelayedPlant, is_stable
from bender_tuner.model.ultimate import RelayTest, UltimatePoint, linear_ultimate_point, relay_ultimate_point
from bender_tuner.rules.gain_forms import IsaForm, from_isa

FEWEST_SAMPLES_PER_CYCLE = 4.0
LARGEST_DISAGREEMENT = 0.3


class Rule(Enum):
    """A row of the table: (Kc/Ku, Ti/Tu, Td/Tu), None for an action that is left out."""

    P = (0.5, None, None)
    PI = (0.45, 1.0 / 1.2, None)
    PID = (0.6, 0.5, 0.125)


class Verdict(Enum):
    """Whether the rule is well posed; the value says what was found and what to do, with the figures to fill in."""

    WELL_POSED = "ultimate gain {gain:.3g} V/µm at {period:.3g} s, {samples:.1f} samples per cycle: the rule applies"
    NO_ULTIMATE_GAIN = (
        "no finite ultimate gain: no proportional gain makes this loop oscillate, the rule has nothing to start from; "
        "use SIMC or a search"
    )
    SAMPLING_ARTEFACT = (
        "the ultimate period {period:.3g} s is {samples:.1f} samples, fewer than 4: the oscillation is made by the "
        "sampler, not by the plant, and the gains change with the rate; use SIMC or a search"
    )
    RELAY_SILENT = (
        "the relay causes no steady oscillation although the linear loop has an ultimate gain of {gain:.3g} V/µm: "
        "the loop is not close to linear there; use SIMC or a search"
    )
    RELAY_DISAGREES = (
        "relay and linear analysis give ultimate gains of {relay:.3g} and {gain:.3g} V/µm, more than 30 % apart: the "
        "oscillation is not the sine that the rule supposes; use SIMC or a search"
    )
    TUNED_LOOP_UNSTABLE = (
        "ultimate gain {gain:.3g} V/µm at {period:.3g} s, but the loop with the PID gains of the table is unstable; "
        "use SIMC or a search"
    )


@dataclass(frozen=True, slots=True)
class ZieglerNichols:
    """What the rule has to say about a loop.

    Attributes:
        verdict: the first thing found wrong, or WELL_POSED.
        sentence: the verdict with its figures.
        linear: ultimate point of the sampled linear loop; None if there is none.
        relay: ultimate point by relay; None if there is no steady cycle, or no relay was asked for.
        gains: one set per rule, from the linear point; empty without one. They are computed even where the rule is
            not well posed, so that it can be shown what they do.
    """

    verdict: Verdict
    sentence: str
    linear: UltimatePoint | None
    relay: UltimatePoint | None
    gains: dict[Rule, Gains]

    @property
    def well_posed(self) -> bool:
        """The rule applies to this loop."""
        return self.verdict is Verdict.WELL_POSED


def rule_gains(rule: Rule, point: UltimatePoint, *, filter_time_s: float = 0.0) -> Gains:
    """Gains of one row of the table."""
    gain_ratio, integral_ratio, derivative_ratio = rule.value
    form = IsaForm(
        gain_V_per_um=gain_ratio * point.gain_V_per_um,
        integral_time_s=float("inf") if integral_ratio is None else integral_ratio * point.period_s,
        derivative_time_s=0.0 if derivative_ratio is None else derivative_ratio * point.period_s,
        filter_time_s=filter_time_s,
    )
    return from_isa(form)


def ziegler_nichols(
    plant: Plant,
    linearisation: Linearisation,
    sampling: Sampling,
    relay: RelayTest | None,
    *,
    filter_time_s: float = 0.0,
) -> ZieglerNichols:
    """Ultimate point by both ways, the gains of the table, and a verdict.

    Args:
        plant: the plant itself, for the relay.
        linearisation: of `plant`, at its operating point.
        sampling: rate, latency and exposure of the loop.
        relay: settings of the relay experiment; None leaves it out.
        filter_time_s: of the derivative in the PID gains.
    """
    delayed = DelayedPlant(linearisation.model, sampling.latency_frames)
    linear = linear_ultimate_point(delayed)
    by_relay = None if relay is None else relay_ultimate_point(plant, linearisation.point, sampling, relay)
    if linear is None:
        return ZieglerNichols(Verdict.NO_ULTIMATE_GAIN, Verdict.NO_ULTIMATE_GAIN.value, None, by_relay, {})
    gains = {rule: rule_gains(rule, linear, filter_time_s=filter_time_s) for rule in Rule}
    verdict = _judge(linear, by_relay, sampling, relay_done=relay is not None)
    if verdict is Verdict.WELL_POSED and not is_stable(gains[Rule.PID], delayed):
        verdict = Verdict.TUNED_LOOP_UNSTABLE
    sentence = verdict.value.format(
        gain=linear.gain_V_per_um,
        period=linear.period_s,
        samples=linear.period_s / sampling.period_s,
        relay=by_relay.gain_V_per_um if by_relay is not None else float("nan"),
    )
    return ZieglerNichols(verdict, sentence, linear, by_relay, gains)


def _judge(linear: UltimatePoint, by_relay: UltimatePoint | None, sampling: Sampling, *, relay_done: bool) -> Verdict:
    if linear.period_s < FEWEST_SAMPLES_PER_CYCLE * sampling.period_s:
        return Verdict.SAMPLING_ARTEFACT
    if not relay_done:
        return Verdict.WELL_POSED
    if by_relay is None:
        return Verdict.RELAY_SILENT
    ratio = by_relay.gain_V_per_um / linear.gain_V_per_um
    if abs(ratio - 1.0) > LARGEST_DISAGREEMENT:
        return Verdict.RELAY_DISAGREES
    return Verdict.WELL_POSED
