"""A pure delay of the command: v_c(t) -> v_c(t - T).

A bus, a driver queue or a camera pipeline: a delay of the command and one of the reading cannot be told apart from a
record, so it stands here for both. 1 to 3 frames of a USB camera are 30 ms to 100 ms.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "transport_delay"
STAGE = "supply"
TITLE = "Transport delay"
# two instants this near are one, or rounding of the times would leave pieces that mean nothing
INSTANT_S = 1e-12
# changes that a host with memory of a fixed size keeps; it stops with an error when there are more
MOST_UNDER_WAY = 4096


@dataclass(frozen=True, slots=True)
class Parameters:
    """The delay."""

    delay_s: float = parameter(0.0, unit="s", low=0.0, high=1e4, text="delay of the command", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (T,) in s."""
    del beam
    return (settings.delay_s,)


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (voltage now put out, voltage last taken in, then (time to go, voltage) of every change under way)."""
    del constants
    return (0.0, 0.0)


def command(
    state: tuple[float, ...], constants: tuple[float, ...], voltage: float, step_s: float
) -> tuple[tuple[float, ...], list[tuple[float, float]]]:
    """Queue the command and put out what is due within the communication step."""
    delay = constants[0]
    if delay <= 0.0:
        return (voltage, voltage), [(step_s, voltage)]
    out, last = state[0], state[1]
    under_way = list(state[2:])
    if voltage != last:
        under_way.append(delay)
        under_way.append(voltage)
    pieces: list[tuple[float, float]] = []
    elapsed = 0.0
    taken = 0
    while taken < len(under_way) and under_way[taken] < step_s - INSTANT_S:
        due = under_way[taken]
        if due > elapsed + INSTANT_S:
            pieces.append((due - elapsed, out))
            elapsed = due
        out = under_way[taken + 1]
        taken += 2
    pieces.append((step_s - elapsed, out))
    rest: list[float] = []
    for k in range(taken, len(under_way), 2):
        rest.append(under_way[k] - step_s)
        rest.append(under_way[k + 1])
    return (out, voltage, *rest), pieces


def commands(settings: Parameters, voltage_V: Any) -> tuple[float, Any]:
    """Return by how much all commands, an array (m,), act later, in s, and what becomes of them, in V."""
    return settings.delay_s, voltage_V
