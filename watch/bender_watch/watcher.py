"""The watch itself: rows in, events out; what it remembers does not grow.

A row is judged where it has a reading, inside the training range, and behind the first rows of a record in motion.
An alarm names the test and what it suspects at once; the diagnosis waits for enough rows since the change. Then these
rows become the training record, of the corrected model or of the one before, and the tests begin anew.
"""

import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from bender_loop.errors import InputError
from bender_loop.records.initial_motion import starts_at_rest
from bender_loop.records.record import Record
from bender_loop.tables.quantities import USUAL
from bender_plant.model import Model
from bender_watch.alarm.evidence import Evidence
from bender_watch.alarm.explain import (
    CALIBRATION,
    Explanation,
    Loop,
    explain,
    first_rows,
    not_diagnosed,
    record_since,
    unread_before,
)
from bender_watch.alarm.history import KEPT, History
from bender_watch.alarm.onset import Onset
from bender_watch.alarm.still import ADVICE, NO_READING, repeats_of, silent_after
from bender_watch.baseline.beginning import COUNT, fitted, whitened_rows
from bender_watch.baseline.courses import AMPLITUDE, doubt_of
from bender_watch.baseline.drift import FOLLOWED
from bender_watch.baseline.expectation import OfModel
from bender_watch.baseline.learn import Baseline, learn, settling_rows
from bender_watch.baseline.pause import WAYS
from bender_watch.baseline.place import moved_before, reads_rest
from bender_watch.excursions import Excursions
from bender_watch.follow.rows import Rows
from bender_watch.held import Block, Pending
from bender_watch.lane import Lane
from bender_watch.sequential.detector import CLIP, GAP, JUDGED, NOT_JUDGED, Detector, Exceedance, Judged
from bender_watch.settings import Settings
from bender_watch.trend import OF, SIGNIFICANT, Trend, Trends

Array = NDArray[np.float64]
Event = dict[str, Any]
Tell = Callable[[str], None]

AT_ONCE = 4096
"""Rows that the model is driven with at once, at most: what it computes of them stays in the cache of a core."""
STRETCH = 1024
"""Rows that are judged at once, at most; explanations and trends come at multiples of it."""
A_GAP = 1.5
"""Times the usual interval: rows further apart than that have a gap between them."""
LED_BY = 1000
"""Rows before those of a diagnosis that lead it to where the device was: before a step it moved as its model."""
SURE = 0.99
"""Weight of all suspects other than level and gain from which on a calibration alone explains nothing."""
MOST_WAITED = 4
"""Times the rows that an explanation waits for: it does where they were too few to explain anything."""
FEWEST_TO_LEARN = 256
"""Judged rows since a change from which it is learned what is normal now."""
ANY_LEVEL = 1e6
"""Deviations of the noise by which the level of a record that began in motion may lie anywhere."""
PAST, PAUSED = slice(1, 1 + COUNT), slice(1 + COUNT, 1 + COUNT + len(WAYS))
UNKNOWNS = PAUSED.stop
"""Columns that are not known of a record: its level, what came before it, and while rows were missing."""
OPENED_AT = np.cumsum([1, 1, 1, 1, UNKNOWNS, FOLLOWED]).tolist()
OPENED = OPENED_AT[-1] + 1
"""Columns of the first rows of a record: residual, spread, gap, step, what is not known, the drift, and a doubt."""
BLIND = 8
"""Times the rows that are missing, behind which an FMU is not judged: nobody can lead its state on other ways."""
BACK = 8
"""Times the rows of an exceedance that its beginning is sought in."""


@dataclass(slots=True)
class Watcher:
    """A device that is watched.

    Attributes:
        model: that the device was; None for an FMU.
        training: its record.
        baseline: what is normal.
        settings: how it is watched.
        loop: that the device is in, None where nobody said.
        tell: is told what is being done.
        seen: is given times, innovations and statistics of rows that were looked at.
    """

    model: Model | None
    training: Record
    baseline: Baseline
    settings: Settings
    loop: Loop | None = None
    tell: Tell = lambda _: None
    seen: Callable[[Array, Array, Array], None] = lambda *_: None
    detector: Detector = field(init=False)
    history: History = field(init=False)
    trends: Trends = field(init=False)
    lane: Lane = field(init=False)
    alarms: int = field(default=0, init=False)
    rows: int = field(default=0, init=False)
    judged: int = field(default=0, init=False)
    lost: int = field(default=0, init=False)
    excursions: Excursions = field(default_factory=Excursions, init=False)
    explanations: list[Explanation] = field(default_factory=list, init=False)
    _pending: Pending | None = field(default=None, init=False)
    _last: tuple[float, float, float] | None = field(default=None, init=False)
    _unjudged: int = field(default=0, init=False)
    _blind: int = field(default=0, init=False)
    _told: set[str] = field(default_factory=set, init=False)
    _raised: set[str] = field(default_factory=set, init=False)
    _silent_rows: int = field(default=0, init=False)
    _silent_after: int = field(init=False)
    _repeats: float = field(init=False)
    _opening: Array = field(init=False)
    _deviations: Array = field(default_factory=lambda: np.zeros(UNKNOWNS), init=False)
    _moved: Array = field(init=False)
    _behind_s: float = field(default=0.0, init=False)
    _clock_s: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.lane, self.trends, self._moved = Lane(), Trends(), np.zeros(2)
        read = self.training.displacement_um
        self._silent_after, self._repeats = silent_after(read), repeats_of(read)
        self._take_baseline(self.baseline, 0.0)

    def _take_baseline(self, baseline: Baseline, level_um: float) -> None:
        self.baseline, self._opening = baseline, np.zeros((0, OPENED))
        self.detector = Detector(baseline.noise, baseline.tests, UNKNOWNS + FOLLOWED, FOLLOWED)
        known = np.zeros(UNKNOWNS)
        known[0], known[PAST] = level_um, baseline.past
        self._take_known(known, np.zeros((UNKNOWNS, UNKNOWNS)), *baseline.drift.at_the_end())
        self.history = History(len(baseline.tests.names))
        self._raised |= set(baseline.raised)

    def begin_record(self, name: str, first: Rows) -> Iterator[Event]:
        """Begin another record; what was learned stays.

        Raises:
            InputError: the model cannot be driven to where it begins.
        """
        time_s = float(first.time_s[0])
        # a clock that was set back goes on where it was
        self._behind_s += max(self._last[0] - time_s, 0.0) if self._last else 0.0
        try:
            rest, stood = self._begin_model(first)
        except ArithmeticError as error:
            raise InputError(f"row {self.rows + 1}: {error}") from None
        settling = settling_rows(stood, self.baseline.rows)
        self._last, self._opening = None, np.zeros((0, OPENED))
        # nobody looks at the past of an FMU: its course is over before its level is looked at
        self._unjudged = settling if self.model is not None else 2 * settling
        self.history.clear()
        self.detector.reset()
        self._deviations = np.append(
            0.0 if rest else ANY_LEVEL * self.baseline.noise_um, np.full(UNKNOWNS - 1, AMPLITUDE)
        )
        unknown = np.diag(self._deviations**2) if stood else np.zeros((UNKNOWNS, UNKNOWNS))
        self._take_known(np.zeros(UNKNOWNS), unknown, *self.detector.drift)
        yield {"event": "record", "record": name, "row": self.rows, "time_s": time_s, "rest": rest}

    def _begin_model(self, first: Rows) -> tuple[bool, bool]:
        """Drive the model to the first row; return whether it begins at rest, and whether it stood there for long."""
        one, time_s, voltage_V = first.part(slice(0, 1)), float(first.time_s[0]), float(first.voltage_V[0])
        rest = starts_at_rest(first.voltage_V[:2]) or reads_rest(self.baseline, one)
        self.baseline.beginning.begin(time_s, voltage_V, rest=rest)
        self.baseline.pause.courses.end()
        stood = rest and not moved_before(self.baseline, one, lambda x: self._drift_um(x, self._steps(one.time_s)))
        self.baseline.expectation.begin(time_s, voltage_V, rest=rest)
        return rest, stood

    def _take_known(self, amplitudes: Array, covariance: Array, drift: Array, of_drift: Array) -> None:
        """Take what is known of a record (its level, what came before it), and of the drift beside it."""
        every = np.array(block_diag(covariance, of_drift), dtype=np.float64)
        self.detector.take_known(np.append(amplitudes, drift), every)

    def _steps(self, time_s: Array) -> Array:
        """Return the time before each row (n,) in lengths of the drift; that of a pause counts."""
        clock_s = time_s + self._behind_s
        return self.baseline.drift.steps(clock_s, float(clock_s[0]) if self._clock_s is None else self._clock_s)

    def _drift_um(self, expected: Array, ahead: Array) -> Array:
        """Return what the drift adds to readings (n,), so many of its lengths from now."""
        return self.detector.drift_um(self.baseline.drift.columns_um(expected), ahead)

    def take(self, rows: Rows) -> Iterator[Event]:
        """Take rows of a record that was begun; yield what there is to say.

        Raises:
            InputError: the model cannot be driven with them.
        """
        begin = 0
        while begin < len(rows):
            part = rows.part(slice(begin, begin + AT_ONCE))
            pauses = np.flatnonzero(np.diff(part.time_s) > A_GAP * self.baseline.interval_s)
            begin += yield from self._block(part.part(slice(0, int(pauses[0]) + 1)) if pauses.size else part)

    def finish(self) -> Iterator[Event]:
        """Explain an alarm that still waits, and say what the trends are."""
        while self._pending is not None and not self._pending.stands:
            yield from self._explained(is_end=True)
        yield from (x.to_event() | self.units for x in self.trend())

    def trend(self) -> list[Trend]:
        """Return the trends of gain and offset so far, relative to the first baseline."""
        return self.trends.trends(self.settings.tolerance, self.baseline.stroke_um, names=self._steady)

    @property
    def _steady(self) -> list[str]:
        """What has a trend: none of that for which the training record itself is beyond the thresholds."""
        return [x for x, test in zip(OF, ("gain_error", "offset"), strict=True) if test not in self._raised]

    @property
    def units(self) -> Event:
        """What an event says of the units that its numbers come in; nothing for V and um, as their names have it."""
        command, reading, _ = self.training.quantities
        return {} if (command, reading) == USUAL[:2] else {"units": [command, reading]}

    @property
    def _evidence(self) -> Evidence:
        """What the last rows say of a change."""
        return Evidence(self.history, self.baseline, self._repeats)

    def state(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return all that is remembered: what JSON can hold, and arrays by name."""
        pending = self._pending
        facts = {
            "model": None if self.model is None else self.model.to_table(),
            "counts": [self.alarms, self.rows, self.judged, self.lost],
            "last": self._last, "unjudged": self._unjudged, "blind": self._blind, "excursions": asdict(self.excursions),
            "behind_s": self._behind_s, "clock_s": self._clock_s,
            "told": sorted(self._told), "raised": sorted(self._raised),
            "trends": self.trends.state(), "moved": self._moved.tolist(),
            "deviations": self._deviations.tolist(),
            "silence": [self._silent_rows, self._silent_after, self._repeats],
            "offset_um": self.baseline.offset_um, "drifts": self.baseline.drift.is_followed,
            "quantities": list(self.training.quantities),
            "signatures": self.baseline.signatures.to_dict(),
            "lane": [self.lane.size, self.lane.filled],
            "pending": None
            if pending is None
            else [pending.event, asdict(pending.exceedance), pending.first_row, pending.rows, pending.stands],
            "expectation": self.baseline.expectation.state(), "beginning": self.baseline.beginning.courses.state(),
            "pause": self.baseline.pause.courses.state(),
        }  # fmt: skip
        arrays: dict[str, NDArray[Any]] = {"history": self.history.table, "opening": self._opening}
        arrays |= {f"training.{name}": values for name, values in self.training.columns().items()}
        arrays |= {f"detector.{name}": values for name, values in self.detector.state().items()}
        return facts, arrays | {"lane.table": self.lane.table}

    def restore(self, facts: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Go on from a state of a watch with the same model and training record.

        Raises:
            ValueError: it is of another one.
        """
        self.alarms, self.rows, self.judged, self.lost = facts["counts"]
        self._last = None if facts["last"] is None else tuple(facts["last"])
        self._unjudged, self._blind = facts["unjudged"], facts["blind"]
        self.excursions = Excursions(**facts["excursions"])
        self._behind_s, self._clock_s = facts["behind_s"], facts["clock_s"]
        self._told, self._raised, self._moved = set(facts["told"]), set(facts["raised"]), np.array(facts["moved"])
        self._deviations, self._opening = np.array(facts["deviations"]), arrays["opening"]
        self._silent_rows, self._silent_after, self._repeats = facts["silence"]
        self.trends.restore(facts["trends"])
        self.baseline = replace(self.baseline, offset_um=facts["offset_um"])
        if facts["pending"] is not None:
            event, exceedance, *rows = facts["pending"]
            self._pending = Pending(event, Exceedance(**exceedance), *rows)
        self.baseline.expectation.restore(facts["expectation"])
        self.baseline.beginning.courses.restore(facts["beginning"])
        self.baseline.pause.courses.restore(facts["pause"])
        self.history.restore(arrays["history"])
        own = {name.removeprefix("detector."): x for name, x in arrays.items() if name.startswith("detector.")}
        self.detector.restore(own)
        self.lane = Lane(arrays["lane.table"], *facts["lane"])

    def _block(self, rows: Rows) -> Generator[Event, None, int]:
        """Take rows; return how many: no further than to where something else becomes normal."""
        base = self.baseline
        self._pass_over(float(rows.time_s[0]), float(rows.voltage_V[0]))
        try:
            expected, raw = base.expectation.advance(rows.time_s, rows.voltage_V, rows.command_time_s)
            of_courses = (base.beginning.courses, base.pause.courses)
            pasts, ways = (x.advance(rows.time_s, rows.voltage_V, rows.command_time_s) for x in of_courses)
        except ArithmeticError as error:
            raise InputError(f"row {self.rows + 1}: {error}") from None
        before_s, before_um = self._last[:2] if self._last else (rows.time_s[0] - base.interval_s, expected[0])
        steps = np.diff(rows.time_s, prepend=before_s)
        drift, doubt = base.drift.columns_um(expected), np.hypot(*(doubt_of(x, base.noise_um) for x in (pasts, ways)))
        columns = np.column_stack([np.ones(len(rows)), pasts, ways, drift, doubt])
        block = Block(
            rows, expected, base.signatures_um(expected, raw), base.residual_um(rows.displacement_um, expected),
            columns, self._steps(rows.time_s), base.spread(expected, before_um, steps),
            base.range.outside(rows.voltage_V, expected), np.where(steps > A_GAP * base.interval_s, GAP, 0),
        )  # fmt: skip
        begin, silences = 0, self._silences(rows.displacement_um)
        while begin < len(rows) and self.baseline is base:
            # stretches end at the same rows however rows arrive, so that what is said does not depend on that
            size = STRETCH - self.rows % STRETCH
            size = min(size, self._unjudged) if self._unjudged else size
            end = min([begin + size, *(x for x in silences if x > begin)])
            part = block.part(slice(begin, end))
            begin += len(part.rows)
            yield from self._stretch(part)
        return begin

    def _pass_over(self, time_s: float, voltage_V: float) -> None:
        """Let what is not known of a pause before a row be learned from the rows behind it."""
        base, (before_s, _, before_V) = self.baseline, self._last or (time_s, 0.0, voltage_V)
        if time_s - before_s <= A_GAP * base.interval_s:
            return
        if not isinstance(base.expectation, OfModel):
            missing = round((time_s - before_s) / base.interval_s) - 1 if voltage_V != before_V else 0
            self._blind = max(self._blind, min(BLIND * missing, 2 * settling_rows(False, base.rows)))
        elif base.pause.pass_over(base.expectation.own_state, (before_s, before_V), (time_s, voltage_V)):
            self.detector.unlearn(PAUSED, AMPLITUDE)

    def _silences(self, read: Array) -> list[int]:
        """Return behind which rows (n,) a sensor has just been silent for too long."""
        rows = np.arange(read.size)
        silent = rows - np.maximum.accumulate(np.where(np.isfinite(read), rows, -1 - self._silent_rows))
        return (np.flatnonzero(silent == self._silent_after) + 1).tolist()

    def _stretch(self, block: Block) -> Iterator[Event]:
        rows, residual = block.rows, block.residual_um
        kinds = block.gaps + np.where(block.beyond, NOT_JUDGED, JUDGED)
        settling = min(self._unjudged, len(rows))
        blind = max(settling, min(self._blind, len(rows)))
        kinds[:blind] = NOT_JUDGED + block.gaps[:blind]
        self._blind = max(self._blind - len(rows), 0)
        yield from self.excursions.take(self.baseline.range, block, self.rows, self.units)
        if settling:
            opened = [residual, block.spread, block.gaps, block.steps, block.columns_um]
            self._opening = np.concatenate([self._opening, np.column_stack(opened)[:settling]])
        begin = 0
        while begin < len(rows):
            own = kinds if self._pending is None else np.where(kinds % GAP == JUDGED, kinds + NOT_JUDGED, kinds)
            found = self.detector.judge(
                residual, block.signatures_um, own, block.spread, begin, block.columns_um, block.steps
            )
            part = slice(begin, len(rows) if found.exceedance is None else found.exceedance.row + 1)
            seen = rows.part(part)
            self._remember(seen, block.expected_um[part], found, kinds, part)
            for taken in (self.lane.add, self.seen):
                taken(seen.time_s, found.innovations[part], found.tops[part])
            self.judged += found.rows
            begin = part.stop
            if found.exceedance is not None:
                yield self._alarm(found.exceedance)
        self._last = (float(rows.time_s[-1]), float(block.expected_um[-1]), float(rows.voltage_V[-1]))
        self._clock_s = self._last[0] + self._behind_s
        self._unjudged -= settling
        read = np.flatnonzero(np.isfinite(rows.displacement_um))
        self._silent_rows = len(rows) - 1 - int(read[-1]) if read.size else self._silent_rows + len(rows)
        if self._silent_rows == self._silent_after:
            yield self._silence()
        if settling and self._unjudged == 0:
            self._open()
        if self.rows % STRETCH:
            return
        if self._pending is not None and self._pending.stands:
            yield from self._moves_again(self._pending)
        elif self._pending is not None and (
            self.rows - self._pending.first_row >= self._pending.rows or self._evidence.stands(self._pending.first_row)
        ):
            yield from self._explained()
        yield from self._trends()

    def _remember(self, rows: Rows, expected: Array, found: Judged, kinds: NDArray[np.int64], part: slice) -> None:
        count, e, whitened = len(rows), found.innovations[part], found.whitened[part]
        lost = np.isnan(rows.displacement_um)
        judged = (kinds[part] % GAP == JUDGED) & ~lost
        columns = {
            "row": self.rows + 1.0 + np.arange(count),
            "time_s": rows.time_s,
            "voltage_V": rows.voltage_V,
            "command_time_s": rows.time_s if rows.command_time_s is None else rows.command_time_s,
            "displacement_um": rows.displacement_um,
            "expected_um": expected,
            "innovation": e,
            "judged": judged.astype(float),
        }
        self.history.add(columns, whitened)
        self.rows += count
        self.lost += int(lost.sum())
        if self._pending is None:
            own = np.clip(e, -CLIP, CLIP) + found.drifts[part]
            self._add_to_trends(rows.time_s[judged] + self._behind_s, own[judged], whitened[judged])

    def _add_to_trends(self, time_s: Array, e: Array, whitened: Array) -> None:
        """Add rows to the trends as if nothing but the level of a record had ever been taken for normal."""
        scales = self.baseline.scales[:2]
        z = whitened[:, :2] / np.where(scales > 0.0, scales, np.inf)
        self.trends.add(time_s, e + z[:, 0] * self._moved[0] + z[:, 1] * self._moved[1], z[:, 0], z[:, 1])

    def _open(self) -> None:
        """Take from the first rows what nobody knew before them: the level of this record, and what came before it."""
        rows = self._opening if self.model is not None else self._opening[len(self._opening) // 2 :]
        residual, spread, gaps, steps, columns, drift, doubt = np.split(rows, OPENED_AT, axis=1)
        residual, spread = residual[:, 0], spread[:, 0] * np.hypot(1.0, doubt[:, 0])
        passed = np.cumsum(steps)
        usable = np.isfinite(residual)
        every = np.column_stack([residual - self.detector.drift_um(drift, passed - passed[-1]), columns])
        white = whitened_rows(self.baseline.noise, every, usable, spread, np.flatnonzero(gaps[:, 0]).tolist())[usable]
        self._take_known(*fitted(white[:, 0], white[:, 1:], self._deviations), *self.detector.drift)
        self.detector.reset()
        self._opening = self._opening[:0]

    def _alarm(self, found: Exceedance) -> Event:
        self.alarms += 1
        evidence = self._evidence
        seen = evidence.looked_back(BACK * found.rows + 64)
        onset, suspects = evidence.onset(found.test, seen)
        rows, times = self.history.column("row"), self.history.column("time_s")
        first_row = int(rows[seen.places[onset.place]])
        event = {
            "event": "alarm",
            "number": self.alarms,
            "row": int(rows[-1]),
            "time_s": float(times[-1]),
            "test": found.test,
            "statistic": found.statistic,
            "threshold": found.threshold,
            "since": evidence.since(seen.places, onset),
            "suspects": suspects,
            "size": evidence.size("" if suspects else found.test, onset),
        } | self.units
        if evidence.stands(first_row):
            event |= {"suspects": [], "advice": [ADVICE]}
        self._pending = Pending(event, found, first_row, self.settings.explain_rows)
        return event

    def _silence(self) -> Event:
        """Return the alarm of a sensor that gives no reading: no test is held where none comes."""
        self.alarms += 1
        row, times = self.rows - self._silent_rows + 1, self.history.column("time_s")
        since_s = float(times[max(len(times) - self._silent_rows, 0)])
        return {
            "event": "alarm",
            "number": self.alarms,
            "row": self.rows,
            "time_s": float(times[-1]),
            "test": "silence",
            "statistic": self._silent_rows,
            "threshold": self._silent_after,
            "since": {f"row{x}": row for x in ("", "_low", "_high")}
            | {f"time{x}_s": since_s for x in ("", "_low", "_high")},
            "suspects": [],
            "size": {"lost_rows": self._silent_rows, "grows": False, "shape": "step"},
            "advice": [NO_READING],
        }

    def _moves_again(self, waiting: Pending) -> Iterator[Event]:
        """Go on as before an alarm of a reading that stood, where it moves again."""
        if not self._evidence.moves(max(waiting.first_row, self.rows - STRETCH + 1)):
            return
        self._pending = None
        self.detector.reset()
        self.detector.forget()
        yield {"event": "moves_again", "row": self.rows, "time_s": float(self.history.column("time_s")[-1])}

    def _explained(self, *, is_end: bool = False) -> Iterator[Event]:
        """Diagnose the rows since the change, say what it was, and take what they are like for normal.

        Where they were too few to explain anything or to learn from, it waits for more of them, unless none come.
        """
        assert self._pending is not None
        waiting, self._pending = self._pending, None
        evidence, rows = self._evidence, self.history.column("row")
        seen = evidence.looked_back(len(self.history))
        seen = seen.where(rows[seen.places] >= waiting.first_row - BACK * waiting.exceedance.rows - 64)
        places = seen.places
        since = int(np.searchsorted(rows[places], waiting.first_row))
        onset, suspects = evidence.onset(waiting.exceedance.test, seen, since)
        began = int(places[onset.place])
        since_change = int(np.sum((rows[places] >= rows[began]) & (rows[places] <= waiting.event["row"])))
        is_last = is_end or 2 * waiting.rows > KEPT
        if not is_last and places.size - onset.place < FEWEST_TO_LEARN:
            self._pending = replace(waiting, rows=2 * waiting.rows)
            return
        if not is_end and (further := self._until_whole(waiting, onset, places.size)):
            self._pending = replace(waiting, rows=further)
            return
        # of what came in slowly, the rows in which all of it is there, or half of what has grown so far
        enough = max(onset.place, places.size - FEWEST_TO_LEARN)
        first = int(places[min(onset.whole, enough)])
        told = {
            "event": "explained",
            "alarm": waiting.event["number"],
            "row": int(rows[-1]),
            "time_s": float(self.history.column("time_s")[-1]),
            "since": evidence.since(places, onset),
            "suspects": suspects,
            "size": evidence.size("" if suspects else waiting.exceedance.test, onset),
        } | self.units
        if evidence.stands(int(rows[began])):
            found = not_diagnosed(ADVICE, (ADVICE,), len(self.history) - began)
            self.explanations.append(found)
            self._pending = replace(waiting, stands=True)
            yield told | {"suspects": []} | found.to_dict() | {"goes_on": "where the reading moves again"}
            return
        model = self.model
        if self.model is not None and self.settings.diagnose and len(self.history) - first >= 2:
            found = self._diagnosed(waiting, first, suspects, is_end=is_end)
            if found is None:
                self._pending = replace(waiting, rows=2 * waiting.rows)
                return
            self.explanations.append(found)
            told |= found.to_dict()
            if self.settings.adopt and found.verdict in ("named", "likely", "recalibrated"):
                model = found.model or self.model
        # what grows goes on, and what has changed again may: a small fade looks like a change that stands
        learned = self._learned(model, first, drifts=onset.ramp or onset.grows or self.alarms > 1)
        corrected = "with the corrected model" if model is not self.model else "with the rows since then as normal"
        if not (onset.ramp or onset.grows):
            self.trends.split(since_change)
        yield told | {"goes_on": "as before" if learned is None else corrected}
        self.detector.reset()
        if learned is not None:
            self._go_on(model, first, *learned)

    def _until_whole(self, waiting: Pending, onset: Onset, rows: int) -> int:
        """Return for how many rows since a change its explanation waits until all of it is there for long enough, or 0.

        A diagnosis says what stands while its rows last: of what comes in slowly, another number at every row.
        """
        lacking = self.settings.explain_rows - (rows - onset.whole)
        if not onset.ramp or lacking <= 0:
            return 0
        since = self.rows - waiting.first_row + (2 if math.isinf(onset.length) else 1) * lacking
        return since if since <= min(MOST_WAITED * self.settings.explain_rows, KEPT) else 0

    def _diagnosed(self, waiting: Pending, first: int, suspects: list[Event], *, is_end: bool) -> Explanation | None:
        """Return what a diagnosis of the rows since a change says; None where it has to wait for more of them."""
        assert self.model is not None
        names = [x for y in suspects for x in y["effects"]]
        is_sure = sum(x["weight"] for x in suspects if not set(CALIBRATION) & {*x["effects"]}) > SURE
        every, begin = len(self.history) - first, max(first - LED_BY, 0)
        rows = min(waiting.rows, every)
        record = unread_before(first_rows(record_since(self.history, begin), first - begin + rows), first - begin)
        self.tell(f"diagnosing {rows} rows since the change")
        found = explain(self.model, record, rows, self.loop, names, linear=self.settings.linear, tell=self.tell)
        noise = self.baseline.noise
        white = float(noise.spreads_um[-1] / noise.spreads_um[0]) ** 2
        most = min(MOST_WAITED * self.settings.explain_rows, KEPT)
        is_last = 2 * waiting.rows > most or (is_end and rows == every)
        return found if is_last or found.is_settled(self.baseline.noise_um, white, suspected=is_sure) else None

    def _learned(self, model: Model | None, first: int, *, drifts: bool) -> tuple[Record, Baseline] | None:
        """Learn anew from the rows since a change; those before it lead to where the device is. None for too few."""
        record = record_since(self.history, 0)
        counted = (self.history.column("judged") > 0.0) & (np.arange(len(record)) >= first)
        read = np.where(counted, record.displacement_um, np.nan)
        record = replace(record, displacement_um=read, quantities=self.training.quantities)
        if counted.sum() < FEWEST_TO_LEARN:
            return None
        return record, learn(
            model or self.baseline.expectation,
            record,
            self.settings.rows_between_false_alarms,
            linear=self.settings.linear,
            tell=self.tell,
            like=self.baseline.signatures if model is self.model else None,
            drifts=drifts,
        )

    def _go_on(self, model: Model | None, first: int, training: Record, learned: Baseline) -> None:
        """Take what was learned for normal, and remember by how much level and gain have moved with it."""
        expected = before = self.history.column("expected_um")[first:]
        if model is not None and model is not self.model:
            plain = OfModel(model, linear=self.settings.linear)
            plain.begin(float(training.time_s[0]), float(training.voltage_V[0]), rest=learned.rest)
            expected = plain.advance(training.time_s, training.voltage_V, training.command_time_s)[0][first:]
        level_um = float(self.detector.amplitudes[0])
        now = learned.offset_um - level_um + learned.gain * expected
        columns = np.column_stack([np.ones(before.size), before])
        self._moved = self._moved + np.linalg.lstsq(columns, self.baseline.residual_um(now, before), rcond=None)[0]
        self.model, self.training = model, training
        self._take_baseline(replace(learned, offset_um=learned.offset_um - level_um), level_um)

    def _trends(self) -> Iterator[Event]:
        """Say of a trend once that it is one."""
        if not (untold := [x for x in self._steady if x not in self._told]):
            return
        # they are looked at again and again: of all looks together, no more are wrong than of the tests
        wrong = min(0.5 * STRETCH / self.settings.rows_between_false_alarms, 1.0 - SIGNIFICANT)
        for found in self.trends.trends(self.settings.tolerance, self.baseline.stroke_um, 1.0 - wrong, untold):
            if found.significant and found.leaves_in_s is not None:
                self._told.add(found.name)
                here = {"row": self.rows, "time_s": self._last[0] if self._last else None}
                yield found.to_event() | self.units | here
