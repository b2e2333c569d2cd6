"""Saturation: the effective voltage flattens, odd and with slope 1 at zero.

    "tanh"       v -> s tanh(v / s)
    "rational"   v -> v / (1 + |v| / s)

Domains that have turned cannot turn again. For PVDF the coercive field is some 50 V/um, far above 2 V/um at 50 V: a
saturation of this film at its working voltage is unusual; ceramics at full voltage lose a tenth.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from ..composite_beam import CompositeBeam

ID = "saturation"
STAGE = "material"
TITLE = "Saturation"
FORMS = ("tanh", "rational")


@dataclass(frozen=True, slots=True)
class Parameters:
    """The voltage scale of the flattening and its form."""

    scale_V: float = parameter(1e6, unit="V", low=1.0, high=1e6, text="s, scale of the flattening", tunable=True)
    form: str = "tanh"

    def __post_init__(self) -> None:
        check(self, ID)
        if self.form not in FORMS:
            raise ModelError(f"{ID}.form: found {self.form!r}, expected one of {FORMS}")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (s, number of the form)."""
    del beam
    return (settings.scale_V, float(FORMS.index(settings.form)))


def flattened(v: float, s: float, form: float) -> float:
    """Return the effective voltage."""
    return s * math.tanh(v / s) if form == 0.0 else v / (1.0 + abs(v) / s)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Flatten the voltage."""
    del time_s, h
    s, form = constants
    return state, flattened(u0, s, form), flattened(um, s, form), flattened(u1, s, form)
