"""A run that follows a model: the model-following controller of `bender_loop.control` on a reference.

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

from bender_hil.runner.loop import command_delay_s
from bender_hil.runner.program import ClosedLoop, Decision
from bender_hil.runner.run_folder import FOLLOWED
from bender_loop.control import model_following
from bender_loop.control.model_following import Memory, ModelFollower
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Reference
from bender_loop.errors import InputError
from bender_loop.fmu.followed_model import FollowedModel, Loop, followed_model, open_follower

COMMAND_DELAY_S = 0.004
"""From a frame until its command acts: finding the tip, and the way to the supply."""


@dataclass(slots=True)
class FollowingLoop:
    """The controller on a reference. A frame without a tip leaves the PID block as it is; the model goes on.

    Attributes:
        reference: set-points over time.
        follower: the controller, its models open.
        model: what it follows.
        fmu: the model's FMU.
        loop: how the bench runs it.
        duration_s: length of the run.
        memory: after the last frame.
        acted_s: from that frame until its command went to the supply, None before the first one.
    """

    reference: Reference
    follower: ModelFollower
    model: FollowedModel
    fmu: Path
    loop: Loop
    duration_s: float
    memory: Memory
    acted_s: float | None = None

    def decide(self, time_s: float, dt_s: float, measured_um: float | None) -> Decision:
        """The command at `time_s`."""
        setpoint_um = aim_um = self.reference.value(time_s)
        if self.loop.preview:
            aim_um = self.reference.value(time_s + self.follower.look_ahead_s + self.model.dead_time_s)
        self.memory = model_following.step(self.follower, self.memory, aim_um, measured_um, dt_s, self.acted_s)
        return Decision(self.memory.command_V, setpoint_um, aim_um)

    def acted(self, delay_s: float) -> None:
        """Note how long after its frame the command went to the supply."""
        self.acted_s = delay_s

    def facts(self) -> dict[str, Any]:
        """Gains, limits, the model and how it is followed."""
        limits = self.loop.limits
        return {
            "mode": "model_following",
            "gains": asdict(self.follower.gains),
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
    with open_follower(model, fmu, plain.gains, loop) as follower:
        # the first steps of an FMU load what later ones need: they are taken before the supply is armed
        warm = model_following.rest(follower)
        for _ in range(3):
            warm = model_following.step(follower, warm, reference.value(0.0), None, loop.period_s)
        memory = model_following.rest(follower)
        yield FollowingLoop(reference, follower, model, fmu, loop, plain.duration_s, memory)


def expected_error_um(following: FollowingLoop) -> float:
    """Return the rms of the error that the model expects of a run without feedback, what it is known to miss included.

    The models run through the reference as the run will; the whole model says what the sensor reads.
    """
    follower, period_s = following.follower, following.loop.period_s
    memory, square, count = model_following.rest(follower), 0.0, max(2, round(following.duration_s / period_s))
    ahead_s = follower.look_ahead_s + following.model.dead_time_s if following.loop.preview else 0.0
    for k in range(count):
        time_s = k * period_s
        memory = model_following.step(follower, memory, following.reference.value(time_s + ahead_s), None, period_s)
        square += (memory.frames[-1] - following.reference.value(time_s)) ** 2
    return math.hypot(math.sqrt(square / count), following.model.rms_um)


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
    with open_follower(model, fmu, Gains(**program["gains"]), loop) as follower:
        memory, acted_s = model_following.rest(follower), None
        for tick in ticks:
            memory = model_following.step(follower, memory, tick["aim_um"], tick["measured_um"], tick["dt_s"], acted_s)
            acted_s = command_delay_s(tick["grabbed_s"], tick["sent_s"], picture_delay_s)
            commands.append(memory.command_V)
    return commands
