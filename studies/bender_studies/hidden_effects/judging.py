"""Answers held to the truth."""

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING

from bender_studies.hidden_effects.trial import CENTRAL, Answer

if TYPE_CHECKING:
    from bender_proving import Case

# stage and effects which no second record repeats: judged by their numbers
BY_NUMBERS = ("supply_quantisation", "sensor_quantisation", "thermal_drift", "periodic_disturbance", "ageing")
NUMBERS_WITHIN = 0.1
ALSO_CALLED = {"output_curve": "lens_distortion"}
SIDES_ALIKE = ("source_resistance", "sensor_lag", "transport_delay")
"""Before or behind a linear plant these do the same: their side cannot be told."""
OWN_NUMBERS = ("tip_mass", "structural_damping")
APPROXIMATE, LAGGING = "approximate", "lagging"
"""The way of records that are given a model whose own numbers are a little wrong."""
MOST_CANDIDATES = 5
HIDDEN = ("single", "pair", "several", "faint", "moved")
"""An ambiguous answer that lists more candidates than these says too little to count as right."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One case with its answers.

    Attributes:
        kind: of the case.
        truth: effects that are hidden.
        sensor: that read the record.
        spoiled: whether frames were lost or outlying.
        answer: to the record alone.
        after: to the record together with the further one that it asks for; None where it asks for none.
        floor_um: what no model could go below: the noise of the sensor, and its steps where they are coarse.
        noise_um: of the sensor.
        numbers_right: whether the numbers of an effect that no second record repeats came out; None for others.
        left_um: what the corrected FMU leaves, driven by the judge with a record that no fit was given (with the record
            itself where no second one repeats the effect); nan where it was not measured.
        moved: what no form of the effect has, over its size.
        way: how the record was made: "" from rest, else "motion", "step" or "loop"; or "approximate" where numbers of
            the model that was given are a little wrong, "lagging" where its sensor lags by another time.
        lookalike: of a moved form, another effect that comes within what it is moved by: no record decides between the
            two; "" where there is none.
    """

    kind: str
    truth: tuple[str, ...]
    sensor: str
    spoiled: bool
    answer: Answer
    after: Answer | None
    floor_um: float
    noise_um: float
    numbers_right: bool | None
    left_um: float = math.nan
    moved: float = 0.0
    way: str = ""
    lookalike: str = ""

    @property
    def candidates(self) -> tuple[str, ...]:
        """The effects that the answer lists: the named ones, then their rivals."""
        return tuple(dict.fromkeys((*self.answer.named, *self.answer.rivals)))

    @property
    def is_right(self) -> bool:
        """Whether the answer is the one that the kind of case asks for."""
        word, named = self.answer.verdict, set(self.answer.named)
        if self.kind in HIDDEN:
            return word == "named" and named - self._changed == set(self.truth)
        if self.kind == "nothing":
            return not named and word in ("no_gap", "recalibrated")
        if self.kind == "calibration":
            return word == "recalibrated" and not named
        if self.kind == "outside":
            is_open = word in ("likely", "ambiguous") and not self.answer.certain
            return is_open or (word == "unexplained" and not named)
        is_open = word in ("ambiguous", "likely")
        return is_open and self.truth[0] in self.candidates and len(self.candidates) <= MOST_CANDIDATES

    @property
    def is_honest(self) -> bool:
        """Whether the answer is right, or leaves open what it is with the truth among what it lists, or names none."""
        if self.is_right or (self.answer.verdict == "unexplained" and not self.answer.named):
            return True
        return self.answer.verdict in ("ambiguous", "likely") and set(self.truth) <= set(self.candidates)

    @property
    def false_names(self) -> frozenset[str]:
        """The effects that were put into the model, or told as certain beside open ones, and are not there."""
        return self._false(self.answer)

    @property
    def _changed(self) -> frozenset[str]:
        """The effects that a wrong model lacks besides: another frequency and another damping have names."""
        return frozenset(OWN_NUMBERS) if self.way == APPROXIMATE else frozenset()

    @property
    def is_false_name(self) -> bool:
        """Whether an effect was named that is not there."""
        return bool(self.false_names)

    @property
    def is_blind(self) -> bool:
        """Whether nothing was called missing although something is hidden."""
        return (
            bool(self.truth) and self.kind in (*HIDDEN, "outside") and self.answer.verdict in ("no_gap", "recalibrated")
        )

    @property
    def is_partly_right(self) -> bool:
        """Whether a part of what is hidden is told as certain, and nothing else."""
        certain = set(self.answer.certain)
        return bool(certain) and certain < set(self.truth)

    @property
    def is_right_after(self) -> bool:
        """Whether the record that the answer asks for led to the right name; where it asks for none, it must be it."""
        last = self.after or self.answer
        return last.verdict == "named" and set(last.named) - self._changed == set(self.truth)

    @property
    def is_false_after(self) -> bool:
        """Whether that record led to an effect that is not there."""
        return bool(self._false(self.after or self.answer))

    def _false(self, answer: Answer) -> frozenset[str]:
        told = answer.certain if answer.verdict in ("ambiguous", "likely") else answer.named
        return frozenset(told) - frozenset(self.truth) - self._changed

    @property
    def over_floor(self) -> float:
        """What the corrected FMU leaves where the judge drives it, over what no model could go below."""
        return self.left_um / self.floor_um

    @property
    def of_second_gap(self) -> float:
        """The part of the gap that is left on a second record, noise apart; nan where there is none."""
        if not self.answer.second or (self.truth and self.truth[0] in BY_NUMBERS):
            return math.nan
        noise = central_share(CENTRAL) * self.noise_um**2
        before, after = (max(self.answer.second[key] ** 2 - noise, 0.0) for key in ("before_um", "after_um"))
        return math.sqrt(after / before) if before > 0.0 else math.nan

    @property
    def said(self) -> str:
        """The answer in a word for the confusion matrix."""
        return " + ".join(sorted(self.answer.named)) if self.answer.verdict == "named" else self.answer.verdict


def as_known(answer: Answer) -> Answer:
    """Return an answer about an FMU with the names that hidden effects have: a curve of the output is one of a lens."""

    def known(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(ALSO_CALLED.get(x, x) for x in names)

    return replace(answer, named=known(answer.named), certain=known(answer.certain), rivals=known(answer.rivals))


def central_share(part: float) -> float:
    """Return the mean square of the central part of normal numbers, over that of all of them."""
    edge = NormalDist().inv_cdf(0.5 + 0.5 * part)
    return 1.0 - 2.0 * edge * NormalDist().pdf(edge) / part


def numbers_right(case: "Case", answer: Answer, duration_s: float) -> bool | None:
    """Return whether the size of a single effect that no second record repeats is within a tenth of the truth."""
    if len(case.effects) != 1 or case.effects[0].id not in BY_NUMBERS:
        return None
    name, true = case.effects[0].id, abs(case.effects[0].magnitude)
    if name not in answer.named:
        return False
    found = _size(name, {k.partition(".")[2]: v for k, v in answer.parameters.items() if k.startswith(name + ".")})
    grown = 1.0
    if name in ("thermal_drift", "ageing"):
        grown = -math.expm1(-duration_s / answer.parameters[f"{name}.time_constant_s"])
    if name == "sensor_quantisation":
        # what the surroundings add passes the gain, as it does in the corrected model; a step is one of the readings
        grown /= abs(case.gain)
    return abs(found * grown - true) <= NUMBERS_WITHIN * true


def _size(name: str, numbers: dict[str, float]) -> float:
    if name == "periodic_disturbance":
        return math.hypot(numbers["sine_um"], numbers["cosine_um"])
    key = {"thermal_drift": "amplitude_um", "ageing": "loss"}.get(name)
    return abs(numbers[key] if key else next(v for k, v in numbers.items() if k.startswith("step")))
