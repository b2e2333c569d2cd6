"""The watch itself: rows in, events out; what it remembers does not grow.

A row is judged where it has a reading, inside the training range, and behind the first rows of a record in motion.
An alarm names the test and what it suspects at once; the diagnosis waits for enough rows since the change. Then the
corrected model, or the amplitudes of the signatures, become what is expected, and the tests begin anew.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.records.initial_motion import starts_at_rest
from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_watch.alarm.explain import Explanation, Loop, explain, record_since
from bender_watch.alarm.history import KEPT, History
from bender_watch.alarm.onset import Onset, onset_of, onset_of_variance, wide_clip
from bender_watch.alarm.suspects import compared
from bender_watch.baseline.expectation import OfModel
from bender_watch.baseline.learn import Baseline, learn, settling_rows
from bender_watch.follow.rows import Rows
from bender_watch.lane import Lane
from bender_watch.sequential.detector import CLIP, COLOURS, GAP, JUDGED, NOT_JUDGED, Detector, Exceedance
from bender_watch.settings import Settings
from bender_watch.trend import OF, SIGNIFICANT, Trend, Trends

Array = NDArray[np.float64]
Event = dict[str, Any]
Tell = Callable[[str], None]

STRETCH = 1024
"""Rows that are taken at once, at most; explanations and trends come at multiples of it."""
A_GAP = 1.5
"""Times the usual interval: rows further apart than that have a gap between them."""
SUSPECTED = 3
INSIDE_AGAIN = 64
"""Rows inside the training range after which an excursion is over: every crest of a sine is no news."""
MOST_WAITED = 4
"""Times the rows that an explanation waits for: it does where they were too few to explain anything."""
ALARMS_OF_VARIANCE = ("louder", "quieter")
ALARMS_OF_LEVEL = ("level_up", "level_down")
NEARER, FAR = 0.5, 6.0
"""By how much the first reading is nearer to rest than to the first command, and how far from that in noise."""
BACK = 8
"""Times the rows of an exceedance that its beginning is sought in."""


@dataclass(slots=True)
class _Pending:
    """An alarm that waits for its explanation: by so many rows since the change."""

    event: Event
    exceedance: Exceedance
    first_row: int
    rows: int


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
    outside: int = field(default=0, init=False)
    explanations: list[Explanation] = field(default_factory=list, init=False)
    correction: Array = field(init=False)
    _allowances: Array = field(init=False)
    _pending: _Pending | None = field(default=None, init=False)
    _last: tuple[float, float] | None = field(default=None, init=False)
    _unjudged: int = field(default=0, init=False)
    _zeroing: bool = field(default=False, init=False)
    _is_outside: bool = field(default=False, init=False)
    _inside: int = field(default=0, init=False)
    _told: set[str] = field(default_factory=set, init=False)
    _level_of_record: float = field(default=0.0, init=False)
    _moved: Array = field(init=False)

    def __post_init__(self) -> None:
        self.lane, self.trends, self._moved = Lane(), Trends(), np.zeros(2)
        self._take_baseline(self.baseline)

    def _take_baseline(self, baseline: Baseline) -> None:
        self.baseline = baseline
        self.detector = Detector(baseline.noise, baseline.tests)
        self.history = History(len(baseline.tests.names))
        self.correction, self._level_of_record = np.zeros(len(baseline.tests.names) - len(COLOURS)), 0.0
        self._allowances = baseline.tests.allowances.copy()

    def begin_record(self, name: str, first: Rows) -> Iterator[Event]:
        """Begin another record; what was learned stays."""
        rest = starts_at_rest(first.voltage_V[:2]) or self._reads_rest(first.part(slice(0, 1)))
        time_s = float(first.time_s[0])
        self.baseline.expectation.begin(time_s, float(first.voltage_V[0]), rest=rest)
        self._last, self._unjudged = None, settling_rows(rest, self.baseline.rows)
        self._zeroing = not rest
        self._take_level(0.0)
        self.history.clear()
        self.detector.reset()
        self.detector.tests = replace(self.detector.tests, allowances=self._allowances.copy())
        yield {"event": "record", "record": name, "row": self.rows, "time_s": time_s, "rest": rest}

    def _reads_rest(self, first: Rows) -> bool:
        """Return whether the first reading is that of a device at rest, whose first command acts behind it."""
        errors = []
        for rest in (True, False):
            self.baseline.expectation.begin(float(first.time_s[0]), float(first.voltage_V[0]), rest=rest)
            expected, _ = self.baseline.expectation.advance(first.time_s, first.voltage_V, first.command_time_s)
            errors.append(abs(float(self.baseline.residual_um(first.displacement_um, expected)[0])))
        at_rest, stood = errors
        return at_rest < NEARER * stood and stood > FAR * self.baseline.noise_um

    def take(self, rows: Rows) -> Iterator[Event]:
        """Take rows of a record that was begun; yield what there is to say.

        Raises:
            InputError: the model cannot be driven with them.
        """
        begin = 0
        while begin < len(rows):
            # stretches end at the same rows however rows arrive, so that what is said does not depend on that
            size = STRETCH - self.rows % STRETCH
            size = min(size, self._unjudged) if self._unjudged else size
            part = rows.part(slice(begin, begin + size))
            begin += len(part)
            yield from self._stretch(part)

    def finish(self) -> Iterator[Event]:
        """Explain an alarm that still waits, and say what the trends are."""
        while self._pending is not None:
            yield from self._explained(is_end=True)
        yield from (_told_trend(x) for x in self.trend())

    def trend(self) -> list[Trend]:
        """Return the trends of gain and offset so far, relative to the first baseline."""
        return self.trends.trends(self.settings.tolerance, self._stroke_um)

    @property
    def _stroke_um(self) -> float:
        return self.baseline.range.high_um - self.baseline.range.low_um

    def state(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return all that is remembered: what JSON can hold, and arrays by name."""
        pending = self._pending
        facts = {
            "model": None if self.model is None else self.model.to_table(),
            "counts": [self.alarms, self.rows, self.judged, self.lost, self.outside],
            "last": self._last, "unjudged": self._unjudged, "zeroing": self._zeroing, "is_outside": self._is_outside,
            "inside": self._inside,
            "told": sorted(self._told), "correction": self.correction.tolist(), "trends": self.trends.state(),
            "level_of_record": self._level_of_record, "moved": self._moved.tolist(),
            "allowances": self.detector.tests.allowances.tolist(), "standing": self._allowances.tolist(),
            "lane_size": self.lane.size,
            "pending": None
            if pending is None
            else [pending.event, asdict(pending.exceedance), pending.first_row, pending.rows],
            "expectation": self.baseline.expectation.state(),
        }  # fmt: skip
        arrays: dict[str, NDArray[Any]] = {"history": self.history.table}
        arrays |= {f"training.{name}": values for name, values in self.training.columns().items()}
        arrays |= {f"detector.{name}": values for name, values in self.detector.state().items()}
        lane = self.lane.state()
        return facts, arrays | {"lane.table": lane["table"], "lane.waiting": lane["waiting"]}

    def restore(self, facts: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Go on from a state of a watch with the same model and training record.

        Raises:
            ValueError: it is of another one.
        """
        self.alarms, self.rows, self.judged, self.lost, self.outside = facts["counts"]
        self._last = None if facts["last"] is None else tuple(facts["last"])
        self._unjudged, self._zeroing, self._is_outside = facts["unjudged"], facts["zeroing"], facts["is_outside"]
        self._inside = facts["inside"]
        self._told, self.correction = set(facts["told"]), np.array(facts["correction"])
        self._level_of_record, self._moved = facts["level_of_record"], np.array(facts["moved"])
        self.trends.restore(facts["trends"])
        self.detector.tests = replace(self.detector.tests, allowances=np.array(facts["allowances"]))
        self._allowances = np.array(facts["standing"])
        if facts["pending"] is not None:
            event, exceedance, *rows = facts["pending"]
            self._pending = _Pending(event, Exceedance(**exceedance), *rows)
        self.baseline.expectation.restore(facts["expectation"])
        self.history.table = arrays["history"]
        own = {name.removeprefix("detector."): x for name, x in arrays.items() if name.startswith("detector.")}
        self.detector.restore(own)
        size = facts["lane_size"]
        self.lane.restore({"table": arrays["lane.table"], "waiting": arrays["lane.waiting"], "size": size})

    def _stretch(self, rows: Rows) -> Iterator[Event]:
        base = self.baseline
        try:
            expected, raw = base.expectation.advance(rows.time_s, rows.voltage_V, rows.command_time_s)
        except ArithmeticError as error:
            raise InputError(f"row {self.rows + 1}: {error}") from None
        signatures = base.signatures_um(expected, raw)
        residual = base.residual_um(rows.displacement_um, expected) - np.sum(signatures * self.correction, axis=1)
        before_s, before_um = self._last or (float(rows.time_s[0]) - base.interval_s, float(expected[0]))
        steps = np.diff(rows.time_s, prepend=before_s)
        spread = base.spread(expected, before_um, steps)
        beyond = base.range.outside(rows.voltage_V, expected)
        kinds = np.where(beyond, NOT_JUDGED, JUDGED).astype(np.int64)
        settling = min(self._unjudged, len(rows))
        kinds[:settling] = NOT_JUDGED
        kinds[steps > A_GAP * base.interval_s] += GAP
        yield from self._outside(rows, expected, beyond)
        begin = 0
        while begin < len(rows):
            own = kinds if self._pending is None else np.where(kinds % GAP == JUDGED, kinds + NOT_JUDGED, kinds)
            found = self.detector.judge(residual, signatures, own, spread, begin)
            part = slice(begin, len(rows) if found.exceedance is None else found.exceedance.row + 1)
            self._remember(rows.part(part), expected[part], found.innovations[part], kinds[part], found.whitened[part])
            for taken in (self.lane.add, self.seen):
                taken(rows.time_s[part], found.innovations[part], found.tops[part])
            self.judged += found.rows
            begin = part.stop
            if found.exceedance is not None:
                yield self._alarm(found.exceedance)
        self._last = (float(rows.time_s[-1]), float(expected[-1]))
        self._unjudged -= settling
        if settling and self._unjudged == 0 and self._zeroing:
            self._zero()
        if self.rows % STRETCH:
            return
        if self._pending is not None and self.rows - self._pending.first_row >= self._pending.rows:
            yield from self._explained()
        yield from self._trends()

    def _remember(self, rows: Rows, expected: Array, e: Array, kinds: NDArray[np.int64], whitened: Array) -> None:
        count = len(rows)
        lost = np.isnan(rows.displacement_um)
        judged = (kinds % GAP == JUDGED) & ~lost
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
            self._add_to_trends(rows.time_s[judged], np.clip(e[judged], -CLIP, CLIP), whitened[judged])

    def _add_to_trends(self, time_s: Array, e: Array, whitened: Array) -> None:
        """Add rows to the trends as if nothing but the level of a record had ever been taken for normal."""
        scales = self.baseline.scales[:2]
        z = whitened[:, :2] / np.where(scales > 0.0, scales, np.inf)
        taken = self.correction.copy()
        taken[0] -= self._level_of_record
        # row by row: a product of matrices rounds differently for another number of rows
        away = np.sum(whitened[:, : taken.size] * taken, axis=1) + z[:, 0] * self._moved[0] + z[:, 1] * self._moved[1]
        self.trends.add(time_s, e + away, z[:, 0], z[:, 1])

    def _outside(self, rows: Rows, expected: Array, beyond: NDArray[np.bool_]) -> Iterator[Event]:
        """Say where the commands leave what the training record has seen, and where they have come back for good."""
        self.outside += int(beyond.sum())
        begin = 0
        for k in [*np.flatnonzero(beyond).tolist(), len(rows)]:
            back = begin + INSIDE_AGAIN - self._inside - 1
            if self._is_outside and back < k:
                self._is_outside = False
                yield {"event": "inside_again", "row": self.rows + back + 1, "time_s": float(rows.time_s[back])}
            if k == len(rows):
                self._inside += k - begin
                break
            if not self._is_outside:
                known = self.baseline.range
                yield {
                    "event": "outside_training_range", "row": self.rows + k + 1, "time_s": float(rows.time_s[k]),
                    "voltage_V": float(rows.voltage_V[k]), "expected_um": float(expected[k]),
                    "range_V": [known.low_V, known.high_V], "range_um": [known.low_um, known.high_um],
                }  # fmt: skip
            self._is_outside, self._inside, begin = True, 0, k + 1

    def _zero(self) -> None:
        """Take the level of a record that began in motion from its first rows: nobody knows what was before them."""
        seen = np.isfinite(self.history.column("innovation"))
        z = self.history.whitened()[seen, 0]
        information = float(z @ z)
        if information > 0.0:
            residual = self.history.column("displacement_um")[seen] - self.baseline.offset_um
            residual = residual - self.baseline.gain * self.history.column("expected_um")[seen]
            self._take_level(float(np.median(residual)) / self.baseline.scales[0] - self.correction[0])
            # of this record alone: the next one has a level of its own
            allowances = self._allowances.copy()
            allowances[0] = np.sqrt(allowances[0] ** 2 + 1.0 / information)
            self.detector.tests = replace(self.detector.tests, allowances=allowances)
        self.detector.reset()
        self.history.clear()
        self._zeroing = False

    def _take_level(self, amplitude: float) -> None:
        """Take a level for what this record alone has, in place of the one that was taken before."""
        self.correction[0] += amplitude - self._level_of_record
        self._level_of_record = amplitude

    def _allow(self, information: Array, places: list[int]) -> None:
        """Widen allowances by what so much information leaves open of the amplitudes at some places."""
        wider = 1.0 / np.maximum(information, 1e-12)
        for allowances in (self._allowances, now := self.detector.tests.allowances.copy()):
            allowances[places] = np.sqrt(allowances[places] ** 2 + wider)
        self.detector.tests = replace(self.detector.tests, allowances=now)

    def _looked_back(self, rows: int) -> tuple[NDArray[np.int64], Array, Array]:
        """Return places in the history, innovations and whitened signatures of the last rows that were judged."""
        places = np.flatnonzero(self.history.column("judged") > 0.0)
        places = places[np.isfinite(self.history.column("innovation")[places])][-rows:]
        return places, self.history.column("innovation")[places], self.history.whitened()[places]

    def _alarm(self, found: Exceedance) -> Event:
        self.alarms += 1
        places, e, z = self._looked_back(BACK * found.rows + 64)
        onset, suspects = self._onset(found.test, e, z)
        first = places[onset.place]
        rows, times = self.history.column("row"), self.history.column("time_s")
        event = {
            "event": "alarm",
            "number": self.alarms,
            "row": int(rows[-1]),
            "time_s": float(times[-1]),
            "test": found.test,
            "statistic": found.statistic,
            "threshold": found.threshold,
            "since": self._since(places, onset),
            "suspects": suspects,
            "size": self._size("" if suspects else found.test, onset),
        }
        self._pending = _Pending(event, found, int(rows[first]), self.settings.explain_rows)
        return event

    def _onset(self, test: str, e: Array, z: Array, clip: float = CLIP) -> tuple[Onset, list[Event]]:
        """Return when the change began along what shows it best, and the effects that it suspects.

        The test that found it does not say what it is: a loop that grows is louder first.
        """
        names = self.baseline.tests.names
        own = [onset_of(e, z[:, j], clip) for j in range(len(names) - len(COLOURS))]
        likelihood, own = compared(e, z[:, : len(own)], own, self.baseline.grows_only)
        best = int(np.argmax(likelihood))
        if test in ALARMS_OF_VARIANCE:
            other = onset_of_variance(e, test == "louder")
        else:
            other = onset_of(e, z[:, names.index(test)]) if test in COLOURS else None
        if other is not None and other.log_likelihood > likelihood[best]:
            return other, []
        weights = np.exp(likelihood - likelihood[best])
        weights /= weights.sum()
        order = np.argsort(-weights)[:SUSPECTED]
        suspects = [
            {"effects": list(self.baseline.effects[names[j]]), "weight": float(weights[j])}
            for j in order.tolist()
            if weights[j] > 1e-3
        ]
        return own[best], suspects

    def _since(self, places: NDArray[np.int64], onset: Onset) -> Event:
        rows, times = self.history.column("row"), self.history.column("time_s")
        at = {"": onset.place, "_low": onset.low, "_high": onset.high}
        return {f"row{name}": int(rows[places[x]]) for name, x in at.items()} | {
            f"time{name}_s": float(times[places[x]]) for name, x in at.items()
        }

    def _size(self, test: str, onset: Onset) -> Event:
        """Return how large a change is: rms of what it adds while moving as in training; of a variance, its ratio.

        Args:
            test: whose change it is; "" for one along a signature.
            onset: of it.
        """
        growth = {"grows": onset.grows, "shape": "ramp" if onset.ramp else "step"}
        if test in ALARMS_OF_VARIANCE:
            return {"noise_ratio": float(np.sqrt(max(1.0 + onset.amplitude, 0.0))), "std": onset.std} | growth
        if test in COLOURS:
            return {"correlation": onset.amplitude, "std": onset.std} | growth
        noise_um = self.baseline.noise_um
        return {"rms_um": abs(onset.amplitude) * noise_um, "std_um": onset.std * noise_um} | growth

    def _explained(self, *, is_end: bool = False) -> Iterator[Event]:
        """Diagnose the rows since the change, say what it was, and take what is now for normal.

        Where they were too few to explain anything, it waits for more of them, unless none come.
        """
        assert self._pending is not None
        waiting, self._pending = self._pending, None
        places, e, z = self._looked_back(len(self.history))
        rows = self.history.column("row")
        since = rows[places] >= waiting.first_row - BACK * waiting.exceedance.rows - 64
        places, e, z = places[since], e[since], z[since]
        clip = wide_clip(e[rows[places] >= waiting.first_row])
        onset, suspects = self._onset(waiting.exceedance.test, e, z, clip)
        first = int(places[onset.place])
        told = {
            "event": "explained",
            "alarm": waiting.event["number"],
            "row": int(rows[-1]),
            "time_s": float(self.history.column("time_s")[-1]),
            "since": self._since(places, onset),
            "suspects": suspects,
            "size": self._size("" if suspects else waiting.exceedance.test, onset),
        }
        names = [x for y in suspects for x in y["effects"]]
        if self.model is not None and self.settings.diagnose and len(self.history) - first >= 2:
            record = _first(every := record_since(self.history, first), waiting.rows)
            self.tell(f"diagnosing {len(record)} rows since the change")
            found = explain(self.model, record, self.loop, names, linear=self.settings.linear, tell=self.tell)
            noise = self.baseline.noise
            white = float(noise.spreads_um[-1] / noise.spreads_um[0]) ** 2
            most = min(MOST_WAITED * self.settings.explain_rows, KEPT)
            is_last = 2 * waiting.rows > most or (is_end and len(every) == len(record))
            if not is_last and not found.is_settled(self.baseline.noise_um, white):
                self._pending = replace(waiting, rows=2 * waiting.rows)
                return
            self.explanations.append(found)
            told |= found.to_dict()
            if self.settings.adopt and found.model is not None and found.verdict in ("named", "likely", "recalibrated"):
                yield told | {"goes_on": "with the corrected model"}
                self._adopt(found.model, first)
                return
        self._correct(np.clip(e[onset.place :], -clip, clip), z[onset.place :])
        yield told | {"goes_on": "with what is left taken for normal"}

    def _correct(self, e: Array, z: Array) -> None:
        """Take what the signatures say of the rows since a change (n,) for normal."""
        size = self.correction.size
        own = z[:, :size]
        normal = own.T @ own + np.eye(size)
        self.correction = self.correction + np.linalg.solve(normal, own.T @ e)
        self._allow(np.diag(normal), list(range(size)))
        self.detector.reset()

    def _adopt(self, model: Model, first: int) -> None:
        """Go on with a corrected model: the training record as that would have read it, its noise unchanged."""
        assert self.model is not None
        old, record, linear = self.baseline, self.training, self.settings.linear
        readings = []
        for one in (self.model, model):
            plain = OfModel(one, linear=linear)
            plain.begin(float(record.time_s[0]), float(record.voltage_V[0]), rest=old.rest)
            readings.append(plain.advance(record.time_s, record.voltage_V, record.command_time_s)[0])
        noise = old.residual_um(record.displacement_um, readings[0])
        training = replace(record, displacement_um=readings[1] + noise)
        table = self.history
        self.training, self.model = training, model
        learned = learn(model, training, self.settings.rows_between_false_alarms, linear=linear, tell=self.tell)
        change = old.residual_um(learned.offset_um + learned.gain * readings[1], readings[0])
        columns = np.column_stack([np.ones(change.size), readings[0]])
        self._moved = self._moved + np.linalg.lstsq(columns, change, rcond=None)[0]
        self._take_baseline(learned)
        kept = {name: table.column(name) for name in ("time_s", "voltage_V", "command_time_s", "displacement_um")}
        learned.expectation.begin(float(kept["time_s"][0]), float(kept["voltage_V"][0]), rest=False)
        expected, raw = learned.expectation.advance(kept["time_s"], kept["voltage_V"], kept["command_time_s"])
        residual = learned.residual_um(kept["displacement_um"], expected)
        shapes = learned.signatures_um(expected, raw)
        seen = np.isfinite(residual[first:])
        self._take_level(float(np.median(residual[first:][seen])) / learned.scales[0] if seen.any() else 0.0)
        spread = float(learned.noise.spreads_um[-1])
        information = np.sum((shapes[first:][seen] / spread) ** 2, axis=0)
        self._allow(information, list(range(information.size)))
        self._last = (float(kept["time_s"][-1]), float(expected[-1]))

    def _trends(self) -> Iterator[Event]:
        """Say of a trend once that it is one."""
        if not (untold := [x for x in OF if x not in self._told]):
            return
        # they are looked at again and again: of all looks together, no more are wrong than of the tests
        wrong = min(0.5 * STRETCH / self.settings.rows_between_false_alarms, 1.0 - SIGNIFICANT)
        for found in self.trends.trends(self.settings.tolerance, self._stroke_um, 1.0 - wrong, untold):
            if found.significant and found.leaves_in_s is not None:
                self._told.add(found.name)
                yield _told_trend(found) | {"row": self.rows, "time_s": self._last[0] if self._last else None}


def _first(record: Record, rows: int) -> Record:
    if len(record) <= rows:
        return record
    columns: dict[str, Any] = {name: values[:rows] for name, values in record.columns().items()}
    return Record(**columns, quantities=record.quantities)


def _told_trend(found: Trend) -> Event:
    return {
        "event": "trend",
        "of": found.name,
        "now": found.now,
        "per_s": found.per_s,
        "per_s_std": found.per_s_std,
        "significant": found.significant,
        "leaves_in_s": found.leaves_in_s,
        "leaves_low_s": found.leaves_low_s,
        "leaves_high_s": found.leaves_high_s,
    }
