"""A model-following controller as its host sees it: sampled, with its models open behind it."""

from contextlib import ExitStack
from pathlib import Path

from bender_loop.control import model_following
from bender_loop.control.pid import Gains
from bender_loop.fmu.followed_model import FollowedModel, Loop, open_follower
from bender_loop.shell.closed_at_exit import ClosedAtExit


class Follower(ClosedAtExit):
    """The controller at rest, its models open in this process.

    Args:
        path: FMU of the model.
        model: what is followed.
        gains: of the PID block.
        loop: in which the controller runs.

    Raises:
        InputError: the FMU is missing, not the one that was tuned with, or cannot save its state.
        RunError: the FMU fails.
    """

    def __init__(self, path: Path, model: FollowedModel, gains: Gains, loop: Loop) -> None:
        self._ends = ExitStack()
        self._follower = self._ends.enter_context(open_follower(model, path, gains, loop))
        self.rest()

    def rest(self) -> None:
        """Forget all samples: plant and models at rest."""
        self._memory = model_following.rest(self._follower)

    def step(self, aim_um: float, measured_um: float | None, dt_s: float, acted_s: float | None = None) -> float:
        """Take one sample; returns the command in V.

        Args:
            aim_um: as `model_following.step` has it, like the others.
            measured_um: None for a lost one.
            dt_s: since the sample before.
            acted_s: from the sample before until its command acted; None for as planned.

        Raises:
            RunError: the FMU fails.
        """
        self._memory = model_following.step(self._follower, self._memory, aim_um, measured_um, dt_s, acted_s)
        return self._memory.command_V

    def predicted_um(self) -> float:
        """Return the newest frame that the model predicts."""
        return self._memory.frames[-1]

    def close(self) -> None:
        """Close the models; a second call does nothing."""
        self._ends.close()
