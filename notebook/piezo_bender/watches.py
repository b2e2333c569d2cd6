"""Watching: a model beside records of a device, and what has changed since it was that model."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.records.common_units import in_units_of
from bender_watch.baseline.learn import learn
from bender_watch.command import summary_of
from bender_watch.follow.rows import Rows
from bender_watch.session import EVENTS, REPORT, SUMMARY, lines_of
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher
from piezo_bender.models import AnyModel, load_model
from piezo_bender.records import LoadedRecord, load_record, several
from piezo_bender.shared import (
    Progress,
    axes_or_new,
    frame_of,
    html_table,
    name_arguments_in_errors,
    one_of,
    require_number,
    silent,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike
    from pandas import DataFrame

    from piezo_bender.records import Source


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Watched:
    """Records that were watched.

    Attributes:
        events: what was said, in order.
        watcher: as it stands at the end.
    """

    events: tuple[dict[str, Any], ...]
    watcher: Watcher

    @property
    def alarms(self) -> tuple[dict[str, Any], ...]:
        """The alarms, each with `since`, `suspects` and `size`."""
        return tuple(x for x in self.events if x["event"] == "alarm")

    @property
    def explanations(self) -> tuple[dict[str, Any], ...]:
        """What the rows since each change say."""
        return tuple(x for x in self.events if x["event"] == "explained")

    def to_dict(self) -> dict[str, Any]:
        """Return the content of watch.json."""
        return summary_of(self.watcher, list(self.events))

    def to_frame(self) -> "DataFrame":
        """Return the whitened residual and the largest statistic by stretches of rows (needs pandas)."""
        rows = self.watcher.lane.table
        return frame_of(dict(zip(("time_s", "lowest", "highest", "statistic"), rows.T, strict=True)))

    def save(self, folder: Path | str) -> Path:
        """Write events.jsonl, watch.json and report.html into a directory; return the directory."""
        from bender_loop.shell.files import prepare_directory, write_atomically, write_result
        from bender_watch.report.page import report_page

        facts = self.to_dict()
        page = report_page(list(self.events), self.watcher, facts)
        out = prepare_directory(Path(folder))
        write_atomically(out / EVENTS, lines_of(self.events))
        write_result(out / SUMMARY, facts)
        write_atomically(out / REPORT, page)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the largest statistic over its threshold; return the axes drawn into."""
        drawn, rows = axes_or_new(axes), self.watcher.lane.table
        drawn.plot(rows[:, 0], rows[:, 3], lw=1.0)
        drawn.axhline(1.0, ls="--", lw=0.8)
        for x in self.alarms:
            drawn.axvline(x["time_s"], lw=1.0)
        drawn.set(xlabel="time (s)", ylabel="largest statistic over its threshold")
        return drawn

    def __repr__(self) -> str:
        return f"<Watched {self.watcher.rows} rows: {self.watcher.alarms} alarms>"

    def _repr_html_(self) -> str:
        rows = [(x["number"], x["time_s"], x["since"]["time_s"], x["test"]) for x in self.alarms]
        return html_table(repr(self)[1:-1], ("alarm", "time (s)", "since (s)", "test"), rows)


def _column(name: str, values: "ArrayLike") -> NDArray[np.float64]:
    try:
        column = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError):
        column = np.zeros((0, 0))
    if column.ndim != 1:
        raise InputError(f"take: found {name} = {values!r:.60}, expected a number or a row of numbers")
    return column


class LiveWatch:
    """A device that is watched while its rows come in, from `start_watch`.

    Attributes:
        watcher: as it stands.
        units: of the commands and readings that `take` expects: those of the training record.
    """

    def __init__(self, watcher: Watcher, units: tuple[str, str]) -> None:
        self.units = units
        self.watcher = watcher
        self._events: list[dict[str, Any]] = []
        self._last_s = -math.inf

    @name_arguments_in_errors
    def take(self, time_s: "ArrayLike", command: "ArrayLike", reading: "ArrayLike") -> tuple[dict[str, Any], ...]:
        """Take one row or some; return what there is to say of them: alarms, explanations, notes.

        Args:
            time_s: (n,) or one, increasing from call to call.
            command: (n,) or one, in the first of `units`.
            reading: (n,) or one, in the second of `units`; nan where it is lost.

        Raises:
            InputError: the columns do not fit together, or the time does not go on.
        """
        columns = (("time_s", time_s), ("command", command), ("reading", reading))
        time, commands, readings = (_column(name, x) for name, x in columns)
        if not time.size == commands.size == readings.size:
            raise InputError(
                f"take: found {time.size}, {commands.size} and {readings.size} rows, expected as many of each"
            )
        if not time.size:
            return ()
        times = np.concatenate([[self._last_s], time])
        if not np.isfinite(commands).all() or not np.isfinite(time).all() or np.any(np.diff(times) <= 0.0):
            raise InputError(
                f"take: found a command or a time that is no number, or a time that is not after {self._last_s:g} s, "
                "expected increasing times"
            )
        rows, is_first = Rows(time, commands, readings), not math.isfinite(self._last_s)
        said = list(self.watcher.begin_record("live", rows)) if is_first else []
        said += self.watcher.take(rows)
        self._last_s = float(time[-1])
        self._events += said
        return tuple(said)

    def finish(self) -> Watched:
        """Return all that was said, once nothing further comes; an alarm that waits is explained by what there is."""
        self._events += self.watcher.finish()
        return Watched(tuple(self._events), self.watcher)


@name_arguments_in_errors
def start_watch(
    model: AnyModel | None = None,
    *,
    training: "Source",
    rows_between_false_alarms: float = 1e6,
    diagnose: bool = True,
    explain_rows: int = 1000,
    input_hold: str = "hold",
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    progress: Progress = silent,
) -> LiveWatch:
    """Begin to watch a device whose rows come in one after another; arguments of `watch`.

    Raises:
        InputError: the model, the training record or a setting will not do.
    """
    one_of("input_hold", input_hold, ("hold", "linear"))
    require_number("rows_between_false_alarms", rows_between_false_alarms, "number of rows")
    require_number("explain_rows", explain_rows, "number of rows")
    linear = input_hold == "linear"
    settings = Settings(rows_between_false_alarms, linear=linear, diagnose=diagnose, explain_rows=explain_rows)
    plant = load_model("paper" if model is None else model).model
    given = load_record(training, columns, units)
    known = LoadedRecord(in_units_of([given.record], plant.units, [given.source])[0], given.source)
    baseline = learn(plant, known.record, rows_between_false_alarms, linear=linear, name=known.source, tell=progress)
    quantities = known.record.quantities
    return LiveWatch(
        Watcher(plant, known.record, baseline, settings, None, progress), (quantities.command, quantities.reading)
    )


@name_arguments_in_errors
def watch(
    records: "Source | Iterable[Any]",
    model: AnyModel | None = None,
    *,
    training: "Source",
    rows_between_false_alarms: float = 1e6,
    diagnose: bool = True,
    explain_rows: int = 1000,
    input_hold: str = "hold",
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    progress: Progress = silent,
) -> Watched:
    """Watch records of a device with its model: whether, since when and how it is no longer that model.

    Args:
        records: one record or several, in their order.
        model: a built-in name, a model file, or from `load_model`; "paper" unless given.
        training: a record of the device while all was well.
        rows_between_false_alarms: mean, of all tests together.
        diagnose: an alarm is followed by a diagnosis of the rows since the change.
        explain_rows: that a diagnosis waits for.
        input_hold: "hold" or "linear": the voltage between two rows.
        columns: other names of the columns of files and tables.
        units: of these columns.
        progress: is told what is being done.

    Raises:
        InputError: the model, a record or a setting will not do.
    """
    live = start_watch(
        model,
        training=training,
        rows_between_false_alarms=rows_between_false_alarms,
        diagnose=diagnose,
        explain_rows=explain_rows,
        input_hold=input_hold,
        columns=columns,
        units=units,
        progress=progress,
    )
    watcher = live.watcher
    events: list[dict[str, Any]] = []
    kept = watcher.training.quantities[:2]
    for record in several(records, columns, units):
        rows = Rows.of(in_units_of([record.record], kept, [record.source])[0])
        events += watcher.begin_record(record.source, rows)
        events += watcher.take(rows)
    events += watcher.finish()
    return Watched(tuple(events), watcher)
