"""A run that follows a model: the model-following controller of `bender_loop.control` on a reference.

The models run in this process if their FMU was made here. Anybody else's is native code that may hang: it runs in a
process of its own, and one that crashes, hangs or errs ends the run, which goes on to say how it ended.

The replay of a run calls the same steps on what the log says, with the FMU of the model that lies in the run's
directory, and has to arrive at the same bits.
"""

import contextlib
import math
import shutil
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bender_hil.runner.loop import command_delay_s
from bender_hil.runner.program import ClosedLoop, Decision
from bender_hil.runner.run_folder import FOLLOWED
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Reference
from bender_loop.errors import InputError
from bender_loop.fmu.file import beyond_learned, learned_range
from bender_loop.fmu.followed_model import FollowedModel, Loop, followed_model, look_ahead_s
from bender_loop.fmu.follower import Follower
from bender_loop.fmu.process.watched import WatchedFollower, opened_follower

COMMAND_DELAY_S = 0.004
"""From a frame until its command acts: finding the tip, and the way to the supply."""
PATIENCE_S = 1.0
"""For a step of a foreign FMU; the guard ends a run whose controller is silent for less."""
_LEVELS, _HELD_S = 2000, 2.0


@dataclass(slots=True)
class FollowingLoop:
    """The controller on a reference. A frame without a tip leaves the PID block as it is; the model goes on.

    Attributes:
        reference: set-points over time.
        follower: the controller, its models open.
        gains: of its PID block.
        model: what it follows.
        fmu: the model's FMU.
        loop: how the bench runs it.
        duration_s: length of the run.
        acted_s: from that frame until its command went to the supply, None before the first one.
    """

    reference: Reference
    follower: Follower | WatchedFollower
    gains: Gains
    model: FollowedModel
    fmu: Path
    loop: Loop
    duration_s: float
    acted_s: float | None = None

    def decide(self, time_s: float, dt_s: float, measured_um: float | None) -> Decision:
        """The command at `time_s`."""
        setpoint_um = aim_um = self.reference.value(time_s)
        if self.loop.preview:
            aim_um = self.reference.value(time_s + look_ahead_s(self.model, self.loop))
        command_V = self.follower.step(aim_um, measured_um, dt_s, self.acted_s)
        return Decision(command_V, setpoint_um, aim_um)

    def acted(self, delay_s: float) -> None:
        """Note how long after its frame the command went to the supply."""
        self.acted_s = delay_s

    def facts(self) -> dict[str, Any]:
        """Gains, limits, the model and how it is followed."""
        limits = self.loop.limits
        return {
            "mode": "model_following",
            "gains": asdict(self.gains),
            "limits": asdict(limits),
            "slew_V_per_s": self.loop.slew_V_per_s,
            "duration_s": self.duration_s,
            "model": asdict(self.model),
            "loop": asdict(self.loop),
        }

    def keep(self, directory: Path) -> None:
        """Leave in the directory of the run what a replay needs beside its journal."""
        shutil.copyfile(self.fmu, directory / FOLLOWED)


@contextlib.contextmanager
def following(
    plain: ClosedLoop, model: FollowedModel, fmu: Path, frames_per_s: float, *, preview: bool
) -> Iterator[FollowingLoop]:
    """Open the models of a run; they are closed when the context ends.

    Args:
        plain: the run with the PID block alone: its reference, gains, limits and slew.
        model: what to follow.
        fmu: the model's FMU.
        frames_per_s: of the bench.
        preview: whether the set-points are known beforehand.

    Raises:
        InputError: the FMU is not the one that was tuned with, or cannot save its state.
        RunError: the FMU fails.
    """
    loop = Loop(1.0 / frames_per_s, plain.limits, plain.slew_V_per_s, command_delay_s=COMMAND_DELAY_S, preview=preview)
    reference = plain.reference
    with opened_follower(fmu, model, plain.gains, loop, patience_s=PATIENCE_S) as follower:
        # the first steps of an FMU load what later ones need: they are taken before the supply is armed
        for _ in range(3):
            follower.step(reference.value(0.0), None, loop.period_s)
        follower.rest()
        yield FollowingLoop(reference, follower, plain.gains, model, fmu, loop, plain.duration_s)


def expected_error_um(following: FollowingLoop) -> float:
    """Return the rms of the error that the model expects of a run without feedback, what it is known to miss included.

    The models run through the reference as the run will; the whole model says what the sensor reads.
    """
    follower, period_s = following.follower, following.loop.period_s
    square, count = 0.0, max(2, round(following.duration_s / period_s))
    ahead_s = look_ahead_s(following.model, following.loop) if following.loop.preview else 0.0
    follower.rest()
    for k in range(count):
        time_s = k * period_s
        follower.step(following.reference.value(time_s + ahead_s), None, period_s)
        square += (follower.predicted_um() - following.reference.value(time_s)) ** 2
    follower.rest()
    return math.hypot(math.sqrt(square / count), following.model.rms_um)


def extrapolation(following: FollowingLoop) -> str:
    """Return what is to be said where the set-points of a run take the model beyond what it was learned from, or "".

    The models are led to the lowest and the highest set-point, each for so long that what lags has arrived.
    """
    learned = learned_range(following.fmu)
    if learned is None:
        return ""
    follower, period_s, commands = following.follower, following.loop.period_s, list[float]()
    seen = following.reference.sample(np.linspace(0.0, following.duration_s, _LEVELS))
    for level_um in (float(seen.min()), float(seen.max())):
        follower.rest()
        commands += [follower.step(level_um, None, period_s) for _ in range(math.ceil(_HELD_S / period_s))][-1:]
    follower.rest()
    return beyond_learned(commands, learned, following.model.units[0] if following.model.units else "V")


def commands_again(start: dict[str, Any], ticks: list[dict[str, Any]], directory: Path) -> list[float]:
    """Return the commands of a run, computed anew from its log and the FMU beside it.

    Args:
        start: what the log says of the run.
        ticks: of the log.
        directory: of the run.

    Raises:
        InputError: the FMU is missing, or another one.
    """
    fmu = directory / FOLLOWED
    if not fmu.is_file():
        raise InputError(f"{fmu}: missing, expected the model that the run followed")
    program, picture_delay_s = start["program"], float(start.get("delay_s") or 0.0)
    model, settings = followed_model(program["model"]), program["loop"]
    weights = tuple(settings["frame_weights"])
    loop = Loop(**settings | {"limits": Limits(**settings["limits"]), "frame_weights": weights})
    commands = []
    acted_s = None
    with opened_follower(fmu, model, Gains(**program["gains"]), loop) as follower:
        for tick in ticks:
            commands.append(follower.step(tick["aim_um"], tick["measured_um"], tick["dt_s"], acted_s))
            acted_s = command_delay_s(tick["grabbed_s"], tick["sent_s"], picture_delay_s)
    return commands
