"""What may be hidden in a bench: effects, their forms, and one drawn instance of them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from numpy.random import Generator

Sensor = Literal["camera", "vibrometer"]
Stage = Literal["supply", "material", "structure", "surroundings", "sensor", "outside"]
Values = dict[str, float]

NOISE_UM: dict[Sensor, float] = {"camera": 0.06, "vibrometer": 0.02}
SENSORS: tuple[Sensor, ...] = ("camera", "vibrometer")


@dataclass(frozen=True, slots=True)
class Setting:
    """What a draw may know of the record: how it is read and how long it takes."""

    sensor: Sensor
    rate_Hz: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class Ask:
    """What a form is asked for when its parameters are drawn.

    Attributes:
        form: name of the form.
        size: magnitude, with its sign.
        setting: of the record in which it has to show.
        rng: gives everything else.
    """

    form: str
    size: float
    setting: Setting
    rng: Generator

    def uniform(self, low: float, high: float) -> float:
        """A value between `low` and `high`."""
        return float(self.rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """A value between `low` and `high` whose logarithm is uniform."""
        return log_uniform(self.rng, low, high)


@dataclass(frozen=True, slots=True)
class Hidden:
    """One effect in one form, with the numbers that the bench runs on.

    Attributes:
        id: of CONTRACT.md, or the name of an effect outside it.
        form: which equation of that effect.
        magnitude: how strong, in the unit of the effect's table entry.
        parameters: names with their unit, and values.
    """

    id: str
    form: str
    magnitude: float
    parameters: tuple[tuple[str, float], ...]

    def __post_init__(self) -> None:
        for name, value in (("magnitude", self.magnitude), *self.parameters):
            if not math.isfinite(value):
                raise ValueError(f"{self.id}.{name} must be finite, found {value!r}")

    def __getitem__(self, name: str) -> float:
        return dict(self.parameters)[name]


@dataclass(frozen=True, slots=True)
class Effect:
    """An entry of the table of effects.

    Attributes:
        id: of CONTRACT.md, or the name of an effect outside it.
        stage: where in the chain it sits.
        magnitude: what its magnitude is.
        unit: of the magnitude; "1" for a ratio.
        ranges: smallest and largest magnitude by the sensor on whose records the effect is excited.
        signed: whether the magnitude may be negative.
        forms: names of its forms.
        draw: parameters of a form; ValueError where it cannot have that magnitude.
        none_at: magnitude that the nominal bench has, which hides nothing; None where that is no magnitude at all.
    """

    id: str
    stage: Stage
    magnitude: str
    unit: str
    ranges: Mapping[Sensor, tuple[float, float]]
    signed: bool
    forms: tuple[str, ...]
    draw: Callable[[Ask], Values]
    none_at: float | None = None

    def hide(self, form: str, magnitude: float, setting: Setting, rng: Generator) -> Hidden:
        """One instance of this effect.

        Raises:
            ValueError: the form is unknown or cannot have that magnitude.
        """
        if form not in self.forms:
            raise ValueError(f"form of {self.id} must be one of {', '.join(self.forms)}, found {form!r}")
        parameters = self.draw(Ask(form, magnitude, setting, rng))
        return Hidden(self.id, form, magnitude, tuple(parameters.items()))


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """A value between `low` and `high` whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def two_poles(ask: Ask) -> Values:
    """A lag whose time constants add up to the size asked for, with a second pole that its sensor hardly resolves."""
    fastest_s, slowest_s = (50e-6, 1e-3) if ask.setting.sensor == "camera" else (3e-6, 10e-6)
    second_s = min(0.02 * ask.size, ask.log_uniform(fastest_s, slowest_s))
    return {"tau_s": ask.size - second_s, "second_tau_s": second_s}
