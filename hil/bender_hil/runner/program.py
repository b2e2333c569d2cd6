"""What a run does at each tick: follow a setpoint with the PID block, or play voltages."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

from bender_hil.runner.control_law import Memory, decide
from bender_hil.runner.voltages import Voltages
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Reference


class Decision(NamedTuple):
    """What a tick comes to.

    Attributes:
        voltage_V: the command.
        setpoint_um: what the controller aims at, None in the open loop.
        aim_um: the reference that the controller was given, where it is another than that of the moment.
    """

    voltage_V: float
    setpoint_um: float | None
    aim_um: float | None = None


class Program(Protocol):
    """One run's programme; it keeps its own state."""

    @property
    def duration_s(self) -> float:
        """Length of the run."""
        ...

    def decide(self, time_s: float, dt_s: float, measured_um: float | None) -> Decision:
        """The command at `time_s`; None for a tip that was not found."""
        ...

    def facts(self) -> dict[str, Any]:
        """What the log has to say at the start, so that the run can be recomputed."""
        ...


@runtime_checkable
class KeepsFiles(Protocol):
    """A programme that leaves files in the directory of its run, for the replay."""

    def keep(self, directory: Path) -> None:
        """Write them there."""
        ...


@runtime_checkable
class HearsWhenItActs(Protocol):
    """A programme that is told how long after the light of a frame its command went to the supply."""

    def acted(self, delay_s: float) -> None:
        """Take note of it, after each command."""
        ...


@dataclass(slots=True)
class ClosedLoop:
    """The PID block on a reference. A frame without a tip holds the command and leaves the block as it is.

    Attributes:
        reference: setpoints over time.
        gains, limits: of the block.
        slew_V_per_s: bound of the command's rate.
        duration_s: length of the run.
    """

    reference: Reference
    gains: Gains
    limits: Limits
    slew_V_per_s: float
    duration_s: float
    memory: Memory = field(default_factory=Memory)

    def decide(self, time_s: float, dt_s: float, measured_um: float | None) -> Decision:
        """The command at `time_s`."""
        setpoint_um = self.reference.value(time_s)
        if measured_um is not None:
            self.memory = decide(
                self.gains, self.limits, self.slew_V_per_s, self.memory, setpoint_um, measured_um, dt_s
            )
        return Decision(self.memory.command_V, setpoint_um)

    def facts(self) -> dict[str, Any]:
        """Gains, limits and slew."""
        gains, limits = self.gains, self.limits
        return {
            "mode": "closed_loop",
            "gains": {name: getattr(gains, name) for name in gains.__dataclass_fields__},
            "limits": {name: getattr(limits, name) for name in limits.__dataclass_fields__},
            "slew_V_per_s": self.slew_V_per_s,
            "duration_s": self.duration_s,
        }


@dataclass(slots=True)
class OpenLoop:
    """Voltages over time, whatever the tip does.

    Attributes:
        voltages: the profile.
    """

    voltages: Voltages

    @property
    def duration_s(self) -> float:
        """Length of the run."""
        return self.voltages.duration_s

    def decide(self, time_s: float, dt_s: float, measured_um: float | None) -> Decision:  # noqa: ARG002
        """The command at `time_s`."""
        return Decision(self.voltages.at(time_s), None)

    def facts(self) -> dict[str, Any]:
        """The profile."""
        voltages = self.voltages
        return {
            "mode": "open_loop",
            "times_s": voltages.times_s,
            "levels_V": voltages.levels_V,
            "duration_s": voltages.duration_s,
        }
