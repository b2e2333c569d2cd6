"""What an investigation needs of a bench: its limits, a voltage profile played, a set-point followed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from bender_hil.runner.voltages import Voltages
from bender_investigate.safety import Allowed
from bender_loop.control.pid import Gains
from bender_loop.control.references import Profile
from bender_loop.fmu.followed_model import FollowedModel
from bender_loop.records.record import Record


@dataclass(frozen=True, slots=True)
class Controller:
    """Gains of the PID block, and the model that they follow.

    Attributes:
        gains: of the block.
        model: that is followed; None for the block alone.
        fmu: of the model.
    """

    gains: Gains
    model: FollowedModel | None = None
    fmu: Path | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """What came of a play.

    Attributes:
        record: what was commanded and read; None where the run was too short for one.
        seconds: of bench time that it took.
        trip: why the guard ended it before its end, None where it did not.
        interrupted: a person asked for the end.
        line: how it ended, in the words of the run.
    """

    record: Record | None
    seconds: float
    trip: str | None = None
    interrupted: bool = False
    line: str = ""


class BenchPort(Protocol):
    """A bench that plays and reads. Every play starts at 0 V and comes down through the guard."""

    @property
    def allowed(self) -> Allowed:
        """The limits, and the rate of the camera."""
        ...

    @property
    def loop_travel_um(self) -> tuple[float, float]:
        """Where a closed loop is ended, and against which its swings are held; of a real bench, the guard's travel."""
        ...

    def facts(self) -> dict[str, Any]:
        """Return what makes this bench another one, for the journal."""
        ...

    def play(self, folder: Path, voltages: Voltages) -> Played:
        """Play a profile; the run's files go into the folder.

        Raises:
            InputError, RunError: nothing could be played.
        """
        ...

    def follow(self, folder: Path, reference: Profile, controller: Controller, duration_s: float) -> Played:
        """Follow set-points with the PID block, alone or with its model.

        Raises:
            InputError, RunError: nothing could be played.
        """
        ...

    def recovered(self, folder: Path) -> Played | None:
        """Return what a run that was killed left in its folder; None where nothing of it reached the bench.

        `seconds` is how far the run may have gone, which can be a row beyond the end of its record.

        Raises:
            InputError: its journals are damaged, so that nobody can say what was played.
        """
        ...
