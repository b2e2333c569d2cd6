"""The control law at one tick: the PID block of `bender_loop.control.pid` within the bounds that hold at that moment.

The replay of a run calls this very function on what the log says, and has to arrive at the same bits.
"""

from typing import NamedTuple

from bender_loop.control import pid
from bender_loop.control.closed_loop import limits_at
from bender_loop.control.pid import Gains, Limits, PidState

LONGEST_DT_S = 0.2
"""A gap between frames longer than this moves the command no further than one of this length would."""


class Memory(NamedTuple):
    """What the law remembers from tick to tick."""

    state: PidState = PidState()
    command_V: float = 0.0


def decide(
    gains: Gains,
    limits: Limits,
    slew_V_per_s: float,
    memory: Memory,
    setpoint_um: float,
    measured_um: float,
    dt_s: float,
) -> Memory:
    """One tick: the memory after it, whose `command_V` is the command.

    The bounds are those of the command, narrowed to what the slew allows from the command before, so that the integral
    yields to the slew as it does to the limits.

    Args:
        gains: of the PID block.
        limits: of the command.
        slew_V_per_s: bound of the command's rate.
        memory: after the tick before.
        setpoint_um: at this tick.
        measured_um: at this tick.
        dt_s: measured time since the frame before, > 0.
    """
    change_V = slew_V_per_s * min(dt_s, LONGEST_DT_S)
    bounds = limits_at(limits, min(max(memory.command_V, limits.lower_V), limits.upper_V), change_V)
    return Memory(*pid.step(gains, bounds, memory.state, setpoint_um, measured_um, dt_s))
