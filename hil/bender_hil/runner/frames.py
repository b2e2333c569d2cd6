"""The frames around a trip: a ring of the newest ones, written as PNG when a run ends badly."""

from collections import deque
from pathlib import Path
from typing import NamedTuple

from bender_hil.runner.tip_camera import Eyes, Sight
from bender_loop.errors import InputError
from bender_loop.shell.files import write_atomically
from bender_loop.shell.opencv import import_cv2

BEFORE, AFTER = 20, 5
_AFTER_S = 0.05


class Kept(NamedTuple):
    """What became of the frames.

    Attributes:
        names: of the files that were written, whole.
        failure: why the others were not, None where all were.
    """

    names: list[str]
    failure: str | None


class FrameRing:
    """Keeps the newest frames.

    Args:
        count: how many.
    """

    def __init__(self, count: int = BEFORE) -> None:
        self._sights: deque[Sight] = deque(maxlen=count)

    def add(self, sight: Sight) -> None:
        """Keep one more, forget the oldest."""
        self._sights.append(sight)

    def keep(self, directory: Path, eyes: Eyes) -> Kept:
        """Write what there is and a few frames more; a full disk costs pictures and never the run's logs."""
        sights = [sight for sight in self._sights if sight.image is not None]
        if not sights:
            return Kept([], None)
        for _ in range(AFTER):
            sight = eyes.look(_AFTER_S)
            if sight is not None:
                sights.append(sight)
        cv2 = import_cv2()
        names: list[str] = []
        try:
            directory.mkdir(exist_ok=True)
            for sight in sights:
                done, data = cv2.imencode(".png", sight.image)
                if done:
                    name = f"frame-{sight.number:06d}.png"
                    write_atomically(directory / name, data.tobytes())
                    names.append(name)
        except OSError as error:
            return Kept(names, f"{directory}: cannot be made ({error.strerror or error})")
        except InputError as error:
            return Kept(names, str(error))
        return Kept(names, None)
