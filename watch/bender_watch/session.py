"""A watch from beginning to end: what comes, what is said, what is kept, and how it goes on after it was killed.

Every event is a line of `events.jsonl`. The state file holds all that is remembered, where the rows were read up to,
and how long `events.jsonl` was then; it is written under another name and moved into place. A watch that goes on cuts
`events.jsonl` back to that length and reads from that place: rows between the last state and the end are judged once
more, with the same result, and nothing is said twice.
"""

import contextlib
import io
import itertools
import json
import math
import os
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.records.common_units import in_units_of
from bender_loop.records.record import Record
from bender_loop.shell.file_lock import locked
from bender_loop.shell.files import check_directory, prepare_directory, write_atomically
from bender_loop.tables.quantities import Quantities
from bender_plant.model import Model, model_from_table
from bender_watch.alarm.explain import Loop
from bender_watch.baseline.expectation import OfFmu
from bender_watch.baseline.learn import Signatures, learn
from bender_watch.beside_run import BesideRun
from bender_watch.follow.rows import Rows
from bender_watch.follow.sources import Arrival, Source
from bender_watch.settings import Settings
from bender_watch.watcher import Event, Tell, Watcher

EVENTS, STATE, SUMMARY, REPORT = "events.jsonl", "state.npz", "watch.json", "report.html"
LOCK = ".lock"
SAVED_EVERY_S = 5.0
FORMAT = 10
MOST_KEPT = 1000
"""Events that the report has; all of them are in the file."""

Array = NDArray[np.float64]
Say = Callable[[Event], None]


@dataclass(slots=True)
class Session:
    """One watch.

    Attributes:
        model: a model, or an FMU.
        source: where rows come from.
        settings: how the device is watched.
        out: directory of its files.
        training: while all was well; None for the first rows of what is watched.
        loop: that the device is in.
        say: is given every event.
        tell: is told what is being done.
        clock: seconds, for how often the state is kept.
    """

    model: Model | OfFmu
    source: Source
    settings: Settings
    out: Path
    training: Record | None = None
    loop: Loop | None = None
    say: Say = lambda _: None
    tell: Tell = lambda _: None
    clock: Callable[[], float] = time.monotonic
    watcher: Watcher | None = None
    events: list[Event] = field(default_factory=list)
    _size: int = 0
    _saved_s: float = -math.inf
    _first: list[Rows] = field(default_factory=list)
    _position: dict[str, Any] = field(default_factory=dict)
    _record: str = ""
    _is_between: bool = True
    _ends: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)
    _beside: BesideRun | None = None

    def run(self) -> Watcher:
        """Watch until the source ends; return the watcher as it stands then.

        Raises:
            InputError: what comes cannot be read, or is too little to learn from.
            KeyboardInterrupt: by the user; what is known is kept.
        """
        check_directory(self.out)
        with contextlib.ExitStack() as ends:
            self._ends = ends
            if isinstance(self.model, OfFmu):
                ends.callback(self.model.close)
            if self.out.is_dir():
                self._lock()
            return self._watched()

    def _watched(self) -> Watcher:
        self._resume()
        arrivals = self.source.arrivals()
        # what is only replayed is read before anything is written: a record that is none leaves nothing behind
        first = [] if self.source.follow else list(itertools.islice(arrivals, 1))
        if self.watcher is None and self.training is not None:
            self._learn(self.training, "the training record")
        try:
            for arrival in itertools.chain(first, arrivals):
                self._arrived(arrival)
        except KeyboardInterrupt:
            # rows that were being judged are judged again by whoever goes on
            if self._is_between:
                self._save()
            raise
        if self.watcher is None:
            found = sum(map(len, self._first))
            raise InputError(
                f"found {found} rows, expected {self.settings.learn_rows} to learn from before any is judged; give the "
                "training record with --training, or fewer rows with --learn"
            )
        # what is said of the end is said of this end: whoever goes on from here has not heard it
        self._save()
        for event in self.watcher.finish():
            self._said(event)
        return self.watcher

    def _arrived(self, arrival: Arrival) -> None:
        rows = arrival.rows
        if rows is None:
            if arrival.refused:
                self._said({"event": "passed_over", "record": arrival.record, "reason": arrival.refused})
            self._save_in_time()
            return
        if self._beside is None and self.source.run is not None:
            self._beside = BesideRun(self.source.run, self.tell)
            if arrival.begins:
                self._beside.begin()
        self._is_between = False
        self._take(arrival, rows)
        self._record = arrival.record
        # without a position there are further rows of what was read in one go
        if arrival.position:
            self._position, self._is_between = arrival.position, True
            self._save_in_time()

    def _take(self, arrival: Arrival, rows: Rows) -> None:
        self._record = arrival.record
        if self.watcher is None:
            if arrival.begins:
                # what is learned from is of one record
                self._first = []
            judged = self._learned_from(rows)
            if self.watcher is None or judged is None:
                return
            rows = judged
        elif arrival.begins:
            self._begin(arrival.record, rows)
        for event in self.watcher.take(rows):
            self._said(event)

    def _learned_from(self, rows: Rows) -> Rows | None:
        """Learn from the first rows; return those that are to be judged, all of them where the record came before."""
        self._first.append(rows)
        known = sum(map(len, self._first))
        if known < self.settings.learn_rows:
            return None
        every = _joined(self._first)
        self._first = []
        first = every.part(slice(0, self.settings.learn_rows)).record()
        units = self.model.units if isinstance(self.model, Model) else None
        self._learn(in_units_of([first], units)[0], "the first rows")
        self._begin(self._record, every)
        return every

    def _begin(self, name: str, rows: Rows) -> None:
        assert self.watcher is not None
        for event in self.watcher.begin_record(name, rows):
            self._said(event)

    def _learn(self, training: Record, name: str) -> None:
        self.watcher = self._watcher(self.model, training, name)
        self._said({"event": "baseline", "from": name, **self.watcher.baseline.facts(), **self.watcher.units})
        self.tell("watching")

    def _watcher(
        self,
        model: "Model | OfFmu",
        training: Record,
        name: str,
        like: Signatures | None = None,
        *,
        drifts: bool = False,
    ) -> Watcher:
        every, linear = self.settings.rows_between_false_alarms, self.settings.linear
        baseline = learn(model, training, every, linear=linear, name=name, tell=self.tell, like=like, drifts=drifts)
        own = model if isinstance(model, Model) else None
        return Watcher(own, training, baseline, self.settings, self.loop, self.tell, self._seen)

    def _seen(self, time_s: Array, innovations: Array, tops: Array) -> None:
        if self._beside is not None:
            self._beside.see(time_s, innovations, tops)

    def _said(self, event: Event) -> None:
        line = lines_of([event])
        if not self.out.is_dir():
            prepare_directory(self.out)
            self._lock()
        try:
            with (self.out / EVENTS).open("ab") as file:
                file.write(line.encode())
                self._size = file.tell()
        except OSError as error:
            raise InputError(
                f"{self.out / EVENTS}: cannot be written ({error.strerror or error}); the same command goes on from "
                "the last state"
            ) from error
        if self._beside is not None:
            self._beside.say(event)
        self.events = [*self.events, event][-MOST_KEPT:]
        self.say(event)

    def _lock(self) -> None:
        """Keep other watches out of the directory.

        Raises:
            InputError: one is there.
        """
        try:
            file = self._ends.enter_context((self.out / LOCK).open("ab"))
        except OSError:
            return
        if not locked(file):
            raise InputError(f"{self.out}: another watch writes there, expected none; stop it, or --out another")

    def _save_in_time(self) -> None:
        if self.clock() - self._saved_s >= SAVED_EVERY_S:
            self._save()

    def _save(self) -> None:
        """Write the state; an FMU keeps its memory to itself, so that there is none to write."""
        self._saved_s = self.clock()
        if self.watcher is None or not self.watcher.baseline.expectation.resumable:
            return
        facts, arrays = self.watcher.state()
        header = {
            "format": FORMAT, "facts": facts, "position": self._position, "events": self._size, "record": self._record,
            "settings": _values_of(self.settings), "kept": self.events,
        }  # fmt: skip
        data = io.BytesIO()
        text = np.frombuffer(json.dumps(finite(header)).encode(), dtype=np.uint8)
        np.savez(data, header=text, **arrays)  # pyright: ignore[reportArgumentType]
        write_atomically(self.out / STATE, data.getvalue())

    def _resume(self) -> None:
        path = self.out / STATE
        if not path.exists():
            with contextlib.suppress(FileNotFoundError):
                (self.out / EVENTS).unlink()
            return
        try:
            with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            header = json.loads(bytes(arrays.pop("header")))
            wanted = header["format"] == FORMAT and header["settings"] == _values_of(self.settings)
        except (OSError, ValueError, LookupError, TypeError, EOFError, BadZipFile, zlib.error) as error:
            raise InputError(f"{path}: cannot be read ({error}); remove it to begin anew") from error
        if not wanted:
            raise InputError(
                f"{path}: found the state of a watch with other settings, expected the same; or --out another"
            )
        self.tell("going on from the state that was kept")
        columns: dict[str, Any] = {
            name.removeprefix("training."): x for name, x in arrays.items() if name.startswith("training.")
        }
        training = Record(**columns, quantities=Quantities(*header["facts"]["quantities"]))
        model = model_from_table(header["facts"]["model"])
        like, drifts = Signatures.of(header["facts"]["signatures"]), header["facts"]["drifts"]
        self.watcher = self._watcher(model, training, "the training record", like, drifts=drifts)
        self.watcher.restore(header["facts"], arrays)
        self.source.position = self._position = header["position"]
        self._size, self._record, self.events = header["events"], header["record"], header["kept"]
        os.truncate(self.out / EVENTS, self._size)


def _values_of(settings: Settings) -> list[Any]:
    return [getattr(settings, name) for name in Settings.__dataclass_fields__]


def _joined(parts: list[Rows]) -> Rows:
    late = all(x.command_time_s is not None for x in parts)
    time_s, voltage_V, read = (
        np.concatenate([getattr(x, name) for x in parts]) for name in ("time_s", "voltage_V", "displacement_um")
    )
    acting = np.concatenate([x.command_time_s for x in parts if x.command_time_s is not None]) if late else None
    return Rows(time_s, voltage_V, read, acting)


def lines_of(events: Sequence[Event]) -> str:
    """Return events as lines of JSON."""
    return "".join(json.dumps(finite(x), allow_nan=False) + "\n" for x in events)


def finite(value: Any) -> Any:
    """Return facts with None for every number that JSON does not know, and plain numbers for those of numpy."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value
