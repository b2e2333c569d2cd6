"""A watch over the records of a unit: the first says what is normal, the others whether it still is."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_fleet.work.diagnose import ForeignModel
from bender_fleet.work.job import UnitResult
from bender_fleet.work.reading import Reading
from bender_loop.records.common_units import in_units_of
from bender_loop.records.record import Record
from bender_plant.model import Model

if TYPE_CHECKING:
    from bender_watch.settings import Settings

CHANGED, STEADY = "changed", "steady"


@dataclass(frozen=True, slots=True)
class WatchWork:
    """Watch a unit.

    Attributes:
        model: as given, of this project or anybody's FMU.
        reading: how the records are read.
        settings: of the watch.
        every: mean between two false alarms, in rows or as a time.
    """

    model: Model | ForeignModel
    reading: Reading
    settings: "Settings"
    every: str

    def do(self, paths: Sequence[Path], names: Sequence[str]) -> UnitResult:
        """Return what was raised, and the files of the watch; see `job.Work`."""
        from bender_watch.baseline.learn import learn
        from bender_watch.command import summary_of
        from bender_watch.follow.rows import Rows
        from bender_watch.report.page import report_page
        from bender_watch.session import EVENTS, REPORT, SUMMARY, lines_of
        from bender_watch.settings import rows_of
        from bender_watch.watcher import Watcher

        stated = self.model.units if isinstance(self.model, Model) else None
        training, watched = self._split_records(in_units_of(self.reading.records(paths), stated, names), names)
        interval_s = float((training.time_s[-1] - training.time_s[0]) / (len(training) - 1))
        how = replace(self.settings, rows_between_false_alarms=rows_of(self.every, interval_s))
        base = learn(self._expected(), training, how.rows_between_false_alarms, linear=how.linear, name=names[0])
        watcher = Watcher(self.model if isinstance(self.model, Model) else None, training, base, how)
        events: list[dict[str, Any]] = []
        for name, record in watched:
            rows = Rows.of(record)
            events += [*watcher.begin_record(name, rows), *watcher.take(rows)]
        events += watcher.finish()
        facts = summary_of(watcher, events)
        texts = {
            EVENTS: lines_of(events),
            SUMMARY: json.dumps(facts, indent=2, allow_nan=False) + "\n",
            REPORT: report_page(events, watcher, facts),
        }
        return UnitResult(*rows_of_watch(facts), {name: text.encode() for name, text in texts.items()})

    def _expected(self) -> Any:
        from bender_watch.baseline.expectation import OfFmu

        if isinstance(self.model, Model):
            return self.model
        given = self.model
        return OfFmu(Path(given.path), given.input, given.output, dict(given.parameters))

    def _split_records(
        self, records: Sequence[Record], names: Sequence[str]
    ) -> tuple[Record, list[tuple[str, Record]]]:
        """Return the training record and those that are watched; of a single one, its first rows are the training."""
        if len(records) > 1:
            return records[0], list(zip(names[1:], records[1:], strict=True))
        columns: dict[str, Any] = {k: x[: self.settings.learn_rows] for k, x in records[0].columns().items()}
        return Record(**columns, quantities=records[0].quantities), [(names[0], records[0])]


def rows_of_watch(facts: Mapping[str, Any]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the row of the unit and those of what its alarms look like, from the content of `watch.json`."""
    from bender_watch.words import sentence

    alarms = [x for x in facts["events"] if x["event"] == "alarm"]
    explained = {x["alarm"]: x for x in facts["events"] if x["event"] == "explained"}
    told = [explained.get(x["number"], x) for x in alarms]
    alike = list(dict.fromkeys(name for x, alarm in zip(told, alarms, strict=True) for name in _alike(x, alarm)))
    moved = {x["name"]: x["now"] for x in facts["trends"]}
    row = {
        "verdict": CHANGED if alarms else STEADY,
        "effects": alike,
        "sentence": sentence(told[0]) if told else "",
        "alarms": float(len(alarms)),
        "since_s": told[0]["since"]["time_s"] if told else None,
        "change_um": told[0]["size"].get("rms_um") if told else None,
        "noise_um": facts["baseline"]["noise_um"],
        "gain_change": moved.get("gain"),
        "offset_change_um": moved.get("offset"),
    }
    return row, [
        {
            "effect": name, "stage": "", "certain": True, "share_of_gap": None, "rivals": [], "evidence": "",
            "parameters": [],
        }
        for name in alike
    ]  # fmt: skip


def _alike(told: Mapping[str, Any], alarm: Mapping[str, Any]) -> list[str]:
    """Return what a change is: the effects of its diagnosis, else what it looks like most, a dead sensor, the test."""
    named = [x["id"] for x in told.get("effects", ())]
    suspected = [" or ".join(x["effects"]) for x in told["suspects"][:1]]
    return named or suspected or [*alarm.get("advice", ()), alarm["test"]][:1]
