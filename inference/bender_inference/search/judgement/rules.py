"""The few constants that decide what is said of a search, and the tests that they enter.

What a hypothesis leaves is noise and the inadequacy of its forms (Kennedy and O'Hagan 2001). The score tells whether
one predicts better than another; it cannot tell whether a further effect only takes up what the form of another one
leaves. That is what `inadequacy` and `remainder` are for.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from bender_effects.catalogue import EFFECTS
from bender_inference.fitting.criterion import very_strong
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.output_error import Fitted
from bender_inference.fitting.own_numbers import own_numbers
from bender_inference.search.archive import Archive
from bender_inference.search.noise import (
    energy_at_floor,
    extremes_at_floor,
    floor_limit,
    floor_square_um2,
    residual_square_um2,
)
from bender_plant.blocks.calibration import Parameters as CalibrationOfReading
from bender_plant.parameter import meanings

MOST_GAIN = meanings(CalibrationOfReading())["gain"].high
LUCKIEST_OF = 100.0
"""Starts of a step, among which the luckiest is chosen: its test is as strict as so many together need."""


BEYOND = 2.0
"""Times the span of the readings, under commands that are as large: what goes further is no model of them."""


@dataclass(frozen=True, slots=True)
class Rules:
    """The constants; `docs/decisions` says where each comes from.

    Attributes:
        confidence: one minus the error rate of all tests of one diagnosis together.
        standard_errors: by which a hypothesis must predict better to be preferred to a simpler one: the
            one-standard-error rule (Breiman and others 1984).
        inadequacy: residual variance that the form of an effect may leave, as a part of the gap: a further effect must
            remove more than that, or `remainder` of the residual.
        remainder: part of the residual variance above the noise that a further effect may remove by chance.
        closes: part of the gap's variance that certain effects close where structure is left.
        at_noise: over the square of the noise; beside an effect, no other one is sought in less.
        last_percent: part of the gap within which forms are not nature's: no name depends on what is no larger in size,
            and no effect of the device is certain that closes no more in the mean over all orders of adding.
        fewer_numbers: what makes one form far simpler than another.
        matters: of the noise; a calibration that changes readings by less is not worth a verdict.
        likely: probability from which a leading suspect is called likely.
        relevant: share of the stroke; what leaves less makes no verdict by itself.
    """

    confidence: float = 0.99
    standard_errors: float = 1.0
    inadequacy: float = 0.05
    remainder: float = 0.5
    closes: float = 0.9
    at_noise: float = 1.0
    last_percent: float = 0.01
    fewer_numbers: int = 3
    matters: float = 0.5
    likely: float = 0.5
    relevant: float = 0.005

    @property
    def certain_deviations(self) -> float:
        """Standard errors by which a hypothesis must predict better than all others that were tried in its place."""
        return float(-ndtri((1.0 - self.confidence) / LUCKIEST_OF))

    @property
    def very_strong(self) -> float:
        """Difference of the information criterion between two given hypotheses that decides."""
        return very_strong(self.confidence)

    def closed_share(self, archive: Archive, base: Fitted, fitted: Fitted) -> float:
        """Return the part of the gap's variance above the floor that a hypothesis closes, at most 1."""
        gap = above_floor_um2(archive, base)
        return 1.0 - above_floor_um2(archive, fitted) / gap if gap > 0.0 else 0.0

    def is_small(self, archive: Archive, base: Fitted, fitted: Fitted) -> bool:
        """Return whether the residual is small beside the noise and steps of the readings, and beside the gap.

        A gap of about the noise has to be closed as far as any other, unless chance explains the residual.
        """
        problem = archive.problem
        floor = floor_square_um2(problem, archive.noise_um)
        square = max(residual_square_um2(problem, fitted, judged=x) for x in (False, True))
        if square > (1.0 + self.at_noise) * floor:
            return False
        by_chance = square <= floor_limit(problem, self.confidence) * floor
        return by_chance or self.closed_share(archive, base, fitted) >= self.closes

    def is_relevant(self, archive: Archive, fitted: Fitted) -> bool:
        """Return whether what a hypothesis leaves above the noise is a part of the stroke that somebody may miss."""
        rows = [x.measured_um[x.searched] for x in archive.problem.observations]
        stroke_um = max(float(np.ptp(x)) for x in rows)
        return math.sqrt(above_floor_um2(archive, fitted)) > self.relevant * stroke_um

    def leaves_noise(self, archive: Archive, fitted: Fitted, *, everywhere: bool = False) -> bool:
        """Return whether what a hypothesis leaves is noise, in energy and in extremes.

        Args:
            archive: has the noise.
            fitted: the hypothesis.
            everywhere: on the rows that it was fitted to as well, which say more, being more.
        """
        problem, noise_um = archive.problem, archive.noise_um
        return energy_at_floor(fitted, problem, noise_um, self.confidence, everywhere=everywhere) and extremes_at_floor(
            fitted, problem, noise_um
        )

    def is_finished(self, archive: Archive, base: Fitted, fitted: Fitted) -> bool:
        """Return whether nothing is left in which a further effect could be sought."""
        return self.leaves_noise(archive, fitted) or (
            bool(fitted.hypothesis.parts) and self.is_small(archive, base, fitted)
        )

    def is_material(self, archive: Archive, base: Fitted, without: Fitted, fitted: Fitted) -> bool:
        """Return whether further effects remove more than each could of the inadequacy of the others' forms."""
        if without.hypothesis.parts and self.is_small(archive, base, without):
            return False
        rest, left = (above_floor_um2(archive, x) for x in (without, fitted))
        if rest <= left:
            return False
        more = set(fitted.hypothesis.effects) - set(without.hypothesis.effects)
        if more and all(EFFECTS[x].of_the_record for x in more):
            # what knows the time alone interpolates well inside a record, whatever is missing
            return rest - left >= self.remainder * rest
        count = max(len(fitted.hypothesis.parts) - len(without.hypothesis.parts), 1)
        return rest - left >= min(self.remainder * rest, count * self.inadequacy * above_floor_um2(archive, base))

    def is_half_way(self, archive: Archive, without: Fitted, fitted: Fitted) -> bool:
        """Return whether one more step like that from one hypothesis to another would remove more than chance may.

        Two effects that hide each other remove less alone than either does once the other one is there.
        """
        rest, left = (above_floor_um2(archive, x) for x in (without, fitted))
        return left <= math.sqrt(1.0 - self.remainder) * rest

    def is_of_last_percent(self, archive: Archive, base: Fitted, without: Fitted, fitted: Fitted) -> bool:
        """Return whether one hypothesis removes no more of what another one leaves than forms differ from nature's."""
        rest, left = (above_floor_um2(archive, x) for x in (without, fitted))
        return rest - left <= self.last_percent**2 * above_floor_um2(archive, base)

    def complexity(self, archive: Archive, fitted: Fitted) -> int:
        """Return how many numbers a hypothesis has, those of its linear structure included.

        That an effect was picked among many counts as much as what makes one form far simpler than another.
        """
        hypothesis = fitted.hypothesis
        own = len(own_numbers(hypothesis.linear(archive.problem.base)))
        numbers = sum(len(x.values) for x in hypothesis.parts)
        return numbers + own + self.fewer_numbers * len(hypothesis.parts)

    def is_in_range(self, archive: Archive, fitted: Fitted) -> bool:
        """Return whether a hypothesis is a model within the range of its records.

        It is none where the gain of the reading is one that passes next to nothing on, where one of several effects
        ended where it is no answer (a drift that is quicker than a record tells, say: it takes up what the forms of
        the others leave), and where mirrored commands, as large and as quick as those of the records, lead far beyond
        what was read, what the linear structure reads then, and what its linear part adds up from end to end of
        the commands.
        """
        parts = fitted.hypothesis.parts
        given = archive.problem.base.values().get("calibration.gain", 1.0)
        if abs(fitted.calibration.gain * given) > MOST_GAIN:
            return False
        if len(parts) > 1 and any(ended_without_answer(x) for x in parts):
            return False
        if not parts:
            return True
        seen = [x.measured_um[x.searched] for x in archive.problem.observations]
        bare = archive.bare(fitted.hypothesis.structure)
        known = [float(np.ptp(x)) for x in seen] + ([] if bare is None else [archive.mirrored_span_um(bare)])
        span_um = archive.mirrored_span_um(fitted)
        return span_um <= BEYOND * max(known) or span_um <= BEYOND * archive.adds_up_um(fitted) < np.inf

    def gains(self, archive: Archive, better: Fitted, worse: Fitted) -> bool:
        """Return whether one hypothesis predicts better by more than the luckiest of many starts would by chance."""
        return archive.difference(better, worse).deviations > self.certain_deviations

    def is_preferred(self, archive: Archive, better: Fitted, simpler: Fitted) -> bool:
        """Return whether one hypothesis predicts better than a simpler one by more than the error of that."""
        return archive.difference(better, simpler).deviations > self.standard_errors


RULES = Rules()


def is_special_case(one: Hypothesis, other: Hypothesis) -> bool:
    """Return whether a hypothesis is another one with an effect whose numbers say less in the place of one.

    That effect is a form of the other one, or the curve beside which the other one has its loop.
    """
    mine, theirs = set(one.effects), set(other.effects)
    lost, more = mine - theirs, theirs - mine
    if len(lost) != 1 or len(more) != 1:
        return False
    return lost <= set(EFFECTS[next(iter(more))].generalises) or any(
        x.form.beside in lost and x.form.effect in more for x in other.parts
    )


def ended_without_answer(part: Part) -> bool:
    """Return whether a number of an effect ended where it is no answer, in every record where these differ."""
    ended = [x.ends_without_answer(v) for x, v in zip(part.form.free, part.values, strict=True)]
    size = len(ended) // part.form.records
    return all(any(ended[k * size : (k + 1) * size]) for k in range(part.form.records))


def above_floor_um2(archive: Archive, fitted: Fitted) -> float:
    """Return the mean square above the floor of readings and noise, over the rows that fits and choices see."""
    square = residual_square_um2(archive.problem, fitted)
    return max(square - floor_square_um2(archive.problem, archive.noise_um), 0.0)
