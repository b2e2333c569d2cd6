"""Saturation: the effective voltage flattens, odd and with slope 1 at zero.

    "tanh"       v -> s tanh(v / s)
    "rational"   v -> v / (1 + |v| / s)
    "knee"       v -> v (1 + (|v| / s)^n)^(-c / n)

The knee has a sharpness n, and grows beyond it with |v| to the power 1 - c: c = 1 ends at a ceiling.

Domains that have turned cannot turn again. For PVDF the coercive field is some 50 V/um, far above 2 V/um at 50 V: a
saturation of this film at its working voltage is unusual; ceramics at full voltage lose a tenth.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "saturation"
STAGE = "material"
TITLE = "Saturation"
FORMS = ("tanh", "rational", "knee")


@dataclass(frozen=True, slots=True)
class Parameters:
    """The voltage scale of the flattening and its form."""

    scale_V: float = parameter(1e6, unit="V", low=1e-30, text="s, scale of the flattening", tunable=True)
    sharpness: float = parameter(2.0, unit="1", low=0.5, high=20.0, text="n, of a knee", tunable=True)
    compression: float = parameter(1.0, unit="1", low=0.0, high=1.0, text="c, of a knee", tunable=True)
    form: str = "tanh"

    def __post_init__(self) -> None:
        check(self, ID)
        if self.form not in FORMS:
            raise ModelError(f"{ID}.form: found {self.form!r}, expected one of {FORMS}")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (s, number of the form, n, c)."""
    del beam
    return (settings.scale_V, float(FORMS.index(settings.form)), settings.sharpness, settings.compression)


def flattened(v: float, s: float, form: float, n: float, c: float) -> float:
    """Return the effective voltage."""
    if form == 0.0:
        return s * math.tanh(v / s)
    if form == 1.0:
        return v / (1.0 + abs(v) / s)
    return v * math.pow(1.0 + math.pow(abs(v) / s, n), -c / n)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Flatten the voltage."""
    del time_s, h
    s, form, n, c = constants
    return state, flattened(u0, s, form, n, c), flattened(um, s, form, n, c), flattened(u1, s, form, n, c)
