"""A case: one bench with something hidden in it, or nothing, and the way in which it is recorded."""

import hashlib
import json
import math
from dataclasses import asdict, dataclass, replace
from typing import Literal, get_args

from bender_proving.cases.effects import effect
from bender_proving.cases.hidden import SENSORS, Hidden, Sensor

Kind = Literal["single", "pair", "several", "faint", "moved", "nothing", "calibration", "outside", "weak"]
Start = Literal["rest", "motion", "step"]
KINDS: tuple[Kind, ...] = get_args(Kind)
STARTS: tuple[Start, ...] = get_args(Start)
OUTLYING, LOST = 0.01, 0.02


@dataclass(frozen=True, slots=True)
class Weak:
    """An excitation too weak to tell the truth from its rivals; every one is read by the camera.

    Attributes:
        rivals: effects that the record cannot tell from the hidden one.
        pattern: "sine" or "step".
        frequency_Hz: of the sine; 0 for a step.
        volts: amplitude of the sine, height of the step.
        duration_s: of the record.
        lead_s: how long the sine has been running when the record starts; 0 for a step.
    """

    rivals: tuple[str, ...]
    pattern: Literal["sine", "step"]
    frequency_Hz: float
    volts: float
    duration_s: float
    lead_s: float


@dataclass(frozen=True, slots=True)
class Given:
    """The own numbers of the model that is given, over those of the bench: frequency, damping, gain and lag.

    Attributes:
        frequency: of the first mode, a factor.
        damping: of it, a factor.
        gain: a factor.
        lag: of the sensor, a factor.
        lag_s: what the sensor of the bench lags by, which is hidden from nobody; 0 for a sensor and a model without.
    """

    frequency: float = 1.0
    damping: float = 1.0
    gain: float = 1.0
    lag: float = 1.0
    lag_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("frequency", "damping", "gain", "lag"):
            factor = getattr(self, name)
            if not 0.2 <= factor <= 5.0:
                raise ValueError(f"given.{name} must be between 0.2 and 5, found {factor!r}")
        if not 0.0 <= self.lag_s <= 1.0:
            raise ValueError(f"given.lag_s must be between 0 and 1, found {self.lag_s!r}")


@dataclass(frozen=True, slots=True)
class Case:
    """What is hidden and how it is recorded; equal cases give equal records.

    Attributes:
        id: says nothing about the case to those who do not have it.
        kind: what an honest diagnosis should find.
        effects: hidden ones, in the order of the chain.
        seed: with which it was asked for.
        sensor: that reads.
        outlying: share of frames with a misread tip.
        lost: share of frames without a reading.
        gain: factor on the reading, noise included.
        offset_um: constant on the reading.
        uneven: whether the rows come at uneven times.
        runner_delay: whether commands act later than their rows, with a column that says when.
        weak: the weak excitation; None for a rich one.
        start: of the first record: from rest, in motion, or with a step in the first row.
        closed_loop: whether a controller of its own plays the first record.
        moved: rms that no form of the effect has, over the size of the effect.
        given: the numbers of the model that is given.
        entropy: where its random numbers start, so that cases of one seed do not share excitation and noise.
    """

    id: str
    kind: Kind
    effects: tuple[Hidden, ...]
    seed: int
    sensor: Sensor
    outlying: float = 0.0
    lost: float = 0.0
    gain: float = 1.0
    offset_um: float = 0.0
    uneven: bool = False
    runner_delay: bool = False
    weak: Weak | None = None
    start: Start = "rest"
    closed_loop: bool = False
    moved: float = 0.0
    given: Given = Given()
    entropy: int = 0

    def __post_init__(self) -> None:
        words = (("kind", self.kind, KINDS), ("sensor", self.sensor, SENSORS), ("start", self.start, STARTS))
        for name, word, allowed in words:
            if word not in allowed:
                raise ValueError(f"{name} must be one of {', '.join(allowed)}, found {word!r}")
        for name, number in (("seed", self.seed), ("entropy", self.entropy)):
            if number < 0:
                raise ValueError(f"{name} must be at least 0, found {number!r}")
        for name, share, most in (
            ("outlying", self.outlying, 0.2),
            ("lost", self.lost, 0.2),
            ("moved", self.moved, 1.0),
        ):
            if not 0.0 <= share <= most:
                raise ValueError(f"{name} must be between 0 and {most:g}, found {share!r}")
        if not (math.isfinite(self.gain) and self.gain > 0.0):
            raise ValueError(f"gain must be above 0, found {self.gain!r}")
        if not math.isfinite(self.offset_um):
            raise ValueError(f"offset_um must be finite, found {self.offset_um!r}")
        for hidden in self.effects:
            effect(hidden.id)

    @property
    def effect_ids(self) -> tuple[str, ...]:
        """Ids of the hidden effects."""
        return tuple(hidden.id for hidden in self.effects)


def identified(case: Case) -> Case:
    """The case with the id that its content gives."""
    told = asdict(replace(case, id=""))
    if case.given == Given():
        # a case keeps its id where the model that is given is that of the bench
        del told["given"]
    content = json.dumps(told, sort_keys=True)
    return replace(case, id="case-" + hashlib.sha256(content.encode()).hexdigest()[:12])


def spoiled(case: Case) -> Case:
    """The same bench, excitation and noise with outlying and lost frames."""
    return identified(replace(case, outlying=OUTLYING, lost=LOST))
