"""Frames that were read wrongly, kept to be looked at."""

from collections.abc import Sequence
from pathlib import Path

from bender_loop.shell.files import write_atomically
from bender_loop.shell.opencv import import_cv2
from bender_studies.vision.silence import Silent

_MOST = 50


def save_silent(directory: Path, silent: Sequence[Silent]) -> None:
    """Write them as PNG, named by number, mishap and the seed of their scene."""
    cv2 = import_cv2()
    for index, one in enumerate(silent[:_MOST]):
        done, data = cv2.imencode(".png", one.image)
        if done:
            write_atomically(directory / f"silent-{index:02d}-{one.mishap}-{one.seed}.png", data.tobytes())
