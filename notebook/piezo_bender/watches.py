"""Watching: a model beside records of a device, and what has changed since it was that model."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_watch.baseline.learn import learn
from bender_watch.command import summary_of
from bender_watch.follow.rows import Rows
from bender_watch.session import EVENTS, REPORT, SUMMARY, lines_of
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher
from piezo_bender.models import AnyModel, load_model
from piezo_bender.records import load_record, several
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
    one_of("input_hold", input_hold, ("hold", "linear"))
    require_number("rows_between_false_alarms", rows_between_false_alarms, "number of rows")
    require_number("explain_rows", explain_rows, "number of rows")
    linear = input_hold == "linear"
    settings = Settings(rows_between_false_alarms, linear=linear, diagnose=diagnose, explain_rows=explain_rows)
    plant = load_model("paper" if model is None else model).model
    known = load_record(training, columns, units)
    loaded = several(records, columns, units)
    baseline = learn(plant, known.record, rows_between_false_alarms, linear=linear, name=known.source, tell=progress)
    watcher = Watcher(plant, known.record, baseline, settings, None, progress)
    events: list[dict[str, Any]] = []
    for record in loaded:
        rows = Rows.of(record.record)
        events += watcher.begin_record(record.source, rows)
        events += watcher.take(rows)
    events += watcher.finish()
    return Watched(tuple(events), watcher)
