"""Lines in the folder of a run that is watched, from which its live page draws the watch; see `live.watch_view`."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_hil.live.watch_view import WATCH
from bender_watch.words import sentence

Array = NDArray[np.float64]

STRETCH_S = 0.1
MOST = 8.0
"""Deviations of the noise that a residual is drawn up to: one outlier would flatten all the rest."""
SHOWN = ("alarm", "explained", "outside_training_range", "inside_again")


@dataclass(slots=True)
class BesideRun:
    """Writes what a page shows; a folder that cannot be written is said once, and the watch goes on.

    Attributes:
        folder: of the run.
        tell: is told what cannot be done.
    """

    folder: Path
    tell: Callable[[str], None] = lambda _: None
    _is_refused: bool = False
    _begins: bool = False

    def begin(self) -> None:
        """Begin anew with what is written next: what an earlier watch said of the run does not count any more then.

        A watch that is refused before it has judged a row leaves nothing behind.
        """
        self._begins = True

    def see(self, time_s: Array, innovations: Array, tops: Array) -> None:
        """Add rows (n,) as extremes of tenths of a second."""
        seen = np.isfinite(innovations)
        if not seen.any():
            return
        time_s, e, tops = time_s[seen], np.clip(innovations[seen], -MOST, MOST), tops[seen]
        begins = np.flatnonzero(np.diff(np.floor(time_s / STRETCH_S), prepend=-np.inf))
        lowest, highest, top = (
            of.reduceat(x, begins) for of, x in ((np.minimum, e), (np.maximum, e), (np.maximum, tops))
        )
        rows = np.column_stack([time_s[begins], lowest, highest, top])
        self._write({"kind": "lane", "rows": rows.round(4).tolist()})

    def say(self, event: dict[str, Any]) -> None:
        """Add what was said of the device."""
        if event["event"] in SHOWN:
            self._write({"kind": "said", "time_s": event["time_s"], "sentence": sentence(event)})

    def _write(self, entry: dict[str, Any]) -> None:
        if self._is_refused:
            return
        entries = [{"kind": "begin"}, entry] if self._begins else [entry]
        try:
            with (self.folder / WATCH).open("a", encoding="utf-8") as file:
                file.write("".join(f"{json.dumps(x)}\n" for x in entries))
            self._begins = False
        except OSError as error:
            self._is_refused = True
            self.tell(f"{self.folder / WATCH}: cannot be written ({error.strerror}); the live page shows no watch")
