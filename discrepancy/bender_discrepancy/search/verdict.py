"""What may be said: named, ambiguous, unexplained, recalibrated or no gap, and on what evidence."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from bender_discrepancy.fitting.criterion import VERY_STRONG, cost
from bender_discrepancy.fitting.hypothesis import Bench
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.observations import only_one_sine
from bender_discrepancy.search.beam import at_the_floor
from bender_discrepancy.search.parsimony import is_overtaken
from bender_discrepancy.search.state import Found, Ranked, rms_um
from bender_discrepancy.search.step import LEFT_OVER_NOISE

# what may be left of the gap beside an effect that is named: the forms of the catalogue are not nature's
LEFT_OF_GAP = 0.05
# the part of the gap's variance that an effect closes which is named beside structure of another kind
CLOSED_ALONE = 0.9
# a calibration matters when it changes the reading by more than half the noise
CALIBRATION_MATTERS = 0.5
NO_GAP_OVER_NOISE = 1.1


@dataclass(frozen=True, slots=True)
class Rival:
    """Another effect in the place of a named one, and how much worse it is (difference of the criterion)."""

    id: str
    difference: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict, why, and the rivals of the last effect."""

    word: str
    reason: str
    rivals: tuple[Rival, ...] = ()


def rivals_of(found: Found, ranking: Sequence[Ranked]) -> tuple[Rival, ...]:
    """Return the other effects that were fitted in the place of the last one, best first."""
    if not ranking:
        return ()
    best = set(found.best.hypothesis.effects)
    first = cost(found.best, found.yardstick)
    # one with all these effects and more is no rival of theirs
    others = (x for x in ranking if not best <= set(x.fitted.hypothesis.effects))
    rest = (x for x in others if cost(x.fitted, found.yardstick) > first or not is_overtaken(x.fitted, found.best))
    return tuple(Rival(x.fitted.hypothesis.effects[-1], cost(x.fitted, found.yardstick) - first) for x in rest)


def floor_square_um2(found: Found, bench: Bench) -> float:
    """Return the square that no model could go below: the noise, and the steps of coarse readings."""
    steps = [(2.0 * x.half_step_um) ** 2 / 12.0 for x in bench.observations]
    return found.noise_um**2 + sum(steps) / len(steps)


def leaves_little(fitted: Fitted, found: Found, bench: Bench) -> bool:
    """Return whether what a hypothesis leaves counts as noise: beside the floor, or beside the gap it closed."""
    floor = floor_square_um2(found, bench)
    left = max(rms_um(fitted, bench) ** 2 - floor, 0.0)
    gap = max(rms_um(found.base, bench) ** 2 - floor, 0.0)
    return left <= (LEFT_OVER_NOISE**2 - 1.0) * floor or left <= LEFT_OF_GAP**2 * gap


def unstretched(bench: Bench, found: Found) -> Found:
    """Return what was found without effects that cover a part of something else.

    Where structure is left, an effect stands by itself only if it closed most of the gap; one that did not may as
    well be stretched over what the catalogue does not have.
    """
    if not found.best.hypothesis.parts or leaves_little(found.best, found, bench):
        return found
    if closes_most(bench, found):
        return found
    return replace(found, best=found.base, steps=[found.base])


def closes_most(bench: Bench, found: Found) -> bool:
    """Return whether what was found closes nine tenths of the gap's variance."""
    floor = floor_square_um2(found, bench)
    gap, left = (max(rms_um(x, bench) ** 2 - floor, 0.0) for x in (found.base, found.best))
    return left <= (1.0 - CLOSED_ALONE) * gap


def one_loop(bench: Bench, found: Found) -> bool:
    """Return whether an effect with a memory was found from one frequency at one amplitude: it could be any of them."""
    return any(part.form.memory for part in found.best.hypothesis.parts) and only_one_sine(bench.observations)


def decide(bench: Bench, found: Found) -> Verdict:
    """Return the verdict on what a search found."""
    if not found.best.hypothesis.parts:
        return _without_effects(bench, found)
    if one_loop(bench, found) and (leaves_little(found.best, found, bench) or closes_most(bench, found)):
        reason = "one frequency at one amplitude cannot tell effects with a memory apart"
        return Verdict("ambiguous", reason, rivals_of(found, found.last_ranking))
    if not leaves_little(found.best, found, bench):
        rms, floor = rms_um(found.best, bench), math.sqrt(floor_square_um2(found, bench))
        return Verdict(
            "unexplained",
            f"structure of {rms:.3g} um rms is left above a noise floor of {floor:.3g} um that no effect explains",
            rivals_of(found, found.last_ranking),
        )
    rivals = rivals_of(found, found.last_ranking)
    close = [x for x in rivals if x.difference < VERY_STRONG]
    if close:
        names = ", ".join(x.id for x in close)
        return Verdict("ambiguous", f"the records fit {names} as well within the evidence that they hold", rivals)
    near = rms_um(found.best, bench) <= LEFT_OVER_NOISE * math.sqrt(floor_square_um2(found, bench))
    left = "at the noise floor" if near else f"less than {LEFT_OF_GAP:.0%} of the gap"
    return Verdict("named", f"every effect passed its tests, and what is left is {left}", rivals)


def as_given_square(bench: Bench, found: Found) -> float:
    """Return the mean square on the held-out rows of the model as given, before any calibration."""
    readings = bench.readings(found.base.hypothesis)
    if readings is None:
        return math.inf
    rows = sum(int(x.judging.sum()) for x in bench.observations)
    square = sum(
        float(((x.measured_um - y)[x.judging] ** 2).sum()) for x, y in zip(bench.observations, readings, strict=True)
    )
    return square / max(rows, 1)


def _without_effects(bench: Bench, found: Found) -> Verdict:
    after = rms_um(found.base, bench) ** 2
    floor = math.sqrt(floor_square_um2(found, bench))
    if after > (NO_GAP_OVER_NOISE * floor) ** 2 and not at_the_floor(found.base, bench, found.noise_um):
        reason = f"structure of {math.sqrt(after):.3g} um rms is left above a noise floor of {floor:.3g} um"
        return Verdict("unexplained", reason)
    if as_given_square(bench, found) - after > (CALIBRATION_MATTERS * floor) ** 2:
        return Verdict("recalibrated", "gain and offset of the reading were off; nothing else is missing")
    return Verdict("no_gap", "simulation and measurement differ by noise alone")
