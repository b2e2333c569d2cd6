"""The frames around a trip: a ring of the newest ones, written as PNG when a run ends badly."""

from collections import deque
from pathlib import Path

from bender_hil.opencv import import_cv2
from bender_hil.runner.eyes import Eyes, Sight
from bender_loop.shell.files import write_atomically

BEFORE, AFTER = 20, 5
_AFTER_S = 0.05


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

    def keep(self, directory: Path, eyes: Eyes) -> list[str]:
        """Write what there is and a few frames more; returns the names of the files."""
        sights = list(self._sights)
        for _ in range(AFTER):
            sight = eyes.look(_AFTER_S)
            if sight is not None:
                sights.append(sight)
        if not sights:
            return []
        directory.mkdir(exist_ok=True)
        cv2 = import_cv2()
        names = []
        for sight in sights:
            done, data = cv2.imencode(".png", sight.image)
            if done:
                names.append(f"frame-{sight.number:06d}.png")
                write_atomically(directory / names[-1], data.tobytes())
        return names
