"""The set-point of the supply in steps: v_c -> q round(v_c / q).

A digital supply takes its set-point in steps of its converter: 1 mV to 20 mV on a laboratory supply, 0.2 V on an
8-bit one. q = 0 is no rounding. A tie rounds to the even multiple.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bender_plant.kernels.rounding import rounded
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "supply_quantisation"
STAGE = "supply"
TITLE = "Steps of the supply"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The step of the set-point."""

    step_V: float = parameter(0.0, unit="V", low=0.0, text="step of the set-point, 0 for none", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (q,) in V."""
    del beam
    return (settings.step_V,)


def command(
    state: tuple[float, ...], constants: tuple[float, ...], voltage: float, step_s: float
) -> tuple[tuple[float, ...], list[tuple[float, float]]]:
    """Round the command, held over the communication step."""
    return state, [(step_s, rounded(voltage, constants[0]))]


def commands(settings: Parameters, voltage_V: Any) -> tuple[float, Any]:
    """Return by how much all commands, an array (m,), act later, in s, and what becomes of them, in V."""
    q = settings.step_V
    return 0.0, q * (voltage_V / q).round() if q > 0.0 else voltage_V
