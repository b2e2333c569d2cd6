"""A run with anybody's controller: an FMU that takes set-point and measurement and gives the command.

It runs in a process of its own: one that crashes, hangs or errs ends the run, which goes on to say how it ended, and
the guard, which owns the supply, need not wait for that. It has the priority of any ordinary process, so that one that
computes for ever holds up nobody.
"""

import contextlib
import shutil
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_hil.runner.control_law import LONGEST_DT_S
from bender_hil.runner.program import ClosedLoop, Decision
from bender_hil.runner.run_folder import CONTROLLER
from bender_loop.control.pid import Limits
from bender_loop.control.references import Reference
from bender_loop.errors import InputError
from bender_loop.fmu.process.watched import WatchedController

PATIENCE_S = 1.0
"""For a step; the guard ends a run whose controller is silent for less."""


@dataclass(slots=True)
class ForeignLoop:
    """The FMU on a reference, its command within limits and slew. A frame without a tip holds the command.

    Attributes:
        reference: set-points over time.
        controller: the FMU, open.
        limits: of the command.
        slew_V_per_s: bound of the command's rate.
        period_s: nominal time between frames.
        duration_s: length of the run.
        command_V: in force.
    """

    reference: Reference
    controller: WatchedController
    limits: Limits
    slew_V_per_s: float
    period_s: float
    duration_s: float
    command_V: float = 0.0

    def decide(self, time_s: float, dt_s: float, measured_um: float | None) -> Decision:
        """The command at `time_s`."""
        setpoint_um = self.reference.value(time_s)
        if measured_um is not None:
            self.command_V = self._bounded(self.controller.step(setpoint_um, measured_um, dt_s), dt_s)
        return Decision(self.command_V, setpoint_um)

    def facts(self) -> dict[str, Any]:
        """Limits, and that an FMU ran."""
        return {
            "mode": "controller_fmu",
            "controller": str(self.controller.path),
            "limits": asdict(self.limits),
            "slew_V_per_s": self.slew_V_per_s,
            "period_s": self.period_s,
            "duration_s": self.duration_s,
        }

    def keep(self, directory: Path) -> None:
        """Leave the FMU in the directory of the run, for the replay."""
        shutil.copyfile(self.controller.path, directory / CONTROLLER)

    def _bounded(self, wanted_V: float, dt_s: float) -> float:
        change_V = self.slew_V_per_s * min(dt_s, LONGEST_DT_S)
        slow_V = min(max(wanted_V, self.command_V - change_V), self.command_V + change_V)
        return min(max(slow_V, self.limits.lower_V), self.limits.upper_V)


@contextlib.contextmanager
def foreign_loop(plain: ClosedLoop, path: Path, frames_per_s: float) -> Iterator[ForeignLoop]:
    """Open a controller FMU for a run; it is closed when the context ends.

    Args:
        plain: the same run with the PID block: its reference, limits and slew.
        path: the FMU.
        frames_per_s: of the bench.

    Raises:
        InputError: the FMU will not do.
        RunError: it fails to start.
    """
    period_s = 1.0 / frames_per_s
    with WatchedController(path, period_s, patience_s=PATIENCE_S) as controller:
        start_V = min(max(0.0, plain.limits.lower_V), plain.limits.upper_V)
        yield ForeignLoop(
            plain.reference, controller, plain.limits, plain.slew_V_per_s, period_s, plain.duration_s, start_V
        )


def foreign_commands_again(program: dict[str, Any], ticks: list[dict[str, Any]], directory: Path) -> list[float]:
    """Return the commands of a run, computed anew from its log and the FMU beside it.

    Raises:
        InputError: the FMU is missing.
    """
    path = directory / CONTROLLER
    if not path.is_file():
        raise InputError(f"{path}: missing, expected the controller of the run")
    limits = Limits(**program["limits"])
    commands = []
    with WatchedController(path, program["period_s"]) as controller:
        start_V = min(max(0.0, limits.lower_V), limits.upper_V)
        loop = ForeignLoop(
            _LoggedReference(), controller, limits, program["slew_V_per_s"], program["period_s"], 1.0, start_V
        )
        for tick in ticks:
            loop.reference = _LoggedReference(tick["setpoint_um"])
            commands.append(loop.decide(tick["time_s"], tick["dt_s"], tick["measured_um"]).voltage_V)
    return commands


@dataclass(frozen=True, slots=True)
class _LoggedReference:
    """The set-point that a log has for a tick."""

    setpoint_um: float = 0.0

    def value(self, time_s: float) -> float:
        del time_s
        return self.setpoint_um

    def sample(self, times: ArrayLike) -> NDArray[np.float64]:
        return np.full(np.shape(times), self.setpoint_um)
