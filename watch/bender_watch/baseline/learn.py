"""From a model and its training record to a baseline: what is normal, and which tests hold the device to it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from bender_loop.errors import InputError
from bender_loop.records.initial_motion import clearly_better, starts_at_rest
from bender_loop.records.missing_rows import completed
from bender_loop.records.record import Record
from bender_plant.model import Model, model_from_table
from bender_watch.baseline.beginning import COUNT, Beginning
from bender_watch.baseline.candidates import candidates
from bender_watch.baseline.courses import AMPLITUDE
from bender_watch.baseline.drift import SLOPES, Drift
from bender_watch.baseline.expectation import Expectation, OfModel
from bender_watch.baseline.noise import doubt_of_noise, doubt_of_variance, fit_noise, innovations
from bender_watch.baseline.pause import Pause
from bender_watch.baseline.signatures import Group, distinct_groups
from bender_watch.sequential.detector import CLIP, COLOURS, JUDGED, QUIET_CLIP, Detector, Noise, Tests, make_tests
from bender_watch.sequential.kernel import CUSUMS, QUIET_REFERENCE

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_ROWS = 200
MOST_ROWS = 40_000
SIZED_ON = 4_000
"""Rows on which signatures are sized: enough to see them, few enough to simulate each several times."""
LEAST_PART = 1e-6
"""Of the span of the readings: what simulations differ by; no noise is below it."""
SETTLING, MOST_SETTLING = 0.05, 200
"""Part and number of rows at the beginning of a record in motion that are not judged: nobody knows what was before."""
SIGNIFICANT = 3.0
MARGIN = 1.2
"""By which a threshold lies above the largest statistic of the training record itself, where that is the larger one."""
BLOCKS = (16, 64, 256, 1024)
FEWEST_BLOCKS = 4
BEYOND = 0.05
"""Of the span of commands, and of expected readings: that far outside the training range is still inside."""
SEED = 58
OF_FMU = ("transport_delay", "electrostriction", "stiffening")

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Range:
    """Where the training record has been: commands in V, expected readings in um."""

    low_V: float
    high_V: float
    low_um: float
    high_um: float

    def outside(self, voltage_V: Array, expected_um: Array) -> Mask:
        """Return which rows (n,) lie beyond it by more than `BEYOND` of its span."""
        volts, microns = BEYOND * (self.high_V - self.low_V), BEYOND * (self.high_um - self.low_um)
        beyond_V = (voltage_V < self.low_V - volts) | (voltage_V > self.high_V + volts)
        return beyond_V | (expected_um < self.low_um - microns) | (expected_um > self.high_um + microns)


@dataclass(frozen=True, slots=True)
class Signatures:
    """The signatures of a model that a record told apart, for another record of the device.

    Attributes:
        variants: of the model, one for each signature behind level and gain; none of an FMU.
        effects: ids of the effects that each signature stands for, by its name.
        one_sided, grows_only: as tests and baseline have them.
    """

    variants: tuple[Model, ...]
    effects: dict[str, tuple[str, ...]]
    one_sided: tuple[bool, ...]
    grows_only: tuple[bool, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return what `of` takes, as JSON can hold it."""
        own = {"effects": self.effects, "one_sided": self.one_sided, "grows_only": self.grows_only}
        return own | {"variants": [x.to_table() for x in self.variants]}

    @classmethod
    def of(cls, known: dict[str, Any]) -> "Signatures":
        """Return the signatures that were kept."""
        effects = {name: tuple(x) for name, x in known["effects"].items()}
        variants = tuple(model_from_table(x) for x in known["variants"])
        return cls(variants, effects, tuple(known["one_sided"]), tuple(known["grows_only"]))


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """What is normal.

    Attributes:
        expectation: of the readings, with the signatures of the effects that the tests hold.
        noise: of the training record.
        tests: thresholds by signature.
        effects: ids of the effects that each signature stands for, by its name.
        scales: (j,) from raw signatures to those of unit size: as large as the noise, rms on the training record.
        gain: factor on the expected reading.
        offset_um: added to it.
        jitter_s: deviation of the times of the readings, as the residual shows it.
        interval_s: median time between two rows.
        range: of the training record.
        rows: of it.
        raised: tests whose thresholds the training record itself has raised.
        rest: whether the training record begins at rest.
        beginning: what came before a record; here at the end of the training record.
        past: (COUNT,) amplitudes of what came before the training record.
        drift: of level and gain, that is followed.
        pause: ways of the command where rows are missing.
        grows_only: (j,) signatures of effects that are there or not, with one sign only.
    """

    expectation: Expectation
    noise: Noise
    tests: Tests
    effects: dict[str, tuple[str, ...]]
    scales: Array
    gain: float
    offset_um: float
    jitter_s: float
    interval_s: float
    range: Range
    rows: int
    raised: tuple[str, ...]
    rest: bool
    grows_only: NDArray[np.bool_]
    beginning: Beginning
    past: Array
    drift: Drift
    pause: Pause

    @property
    def signatures(self) -> Signatures:
        """The signatures, for another record of the device."""
        variants = tuple(self.expectation.variants) if isinstance(self.expectation, OfModel) else ()
        sides = self.tests.one_sided[: len(self.effects)].tolist()
        return Signatures(variants, self.effects, tuple(sides), tuple(self.grows_only.tolist()))

    @property
    def noise_um(self) -> float:
        """Deviation of the noise."""
        return float(self.noise.spreads_um[0])

    @property
    def stroke_um(self) -> float:
        """Peak to peak of the expected readings of the training record."""
        return self.range.high_um - self.range.low_um

    def signatures_um(self, expected_um: Array, raw: Array) -> Array:
        """Return the signatures (n, j) of unit size: level, gain, and those of the effects."""
        return np.column_stack([np.ones(expected_um.size), expected_um, raw]) * self.scales

    def residual_um(self, measured_um: Array, expected_um: Array) -> Array:
        """Return measured minus expected (n,)."""
        return measured_um - self.offset_um - self.gain * expected_um

    def spread(self, expected_um: Array, before_um: float, steps_s: Array) -> Array:
        """Return the factor (n,) on the noise of readings whose times jitter, by the rate of the expected reading."""
        if self.jitter_s == 0.0:
            return np.ones(expected_um.size)
        rate = np.diff(expected_um, prepend=before_um) / np.maximum(steps_s, 1e-12)
        return np.sqrt(1.0 + (self.jitter_s * rate / self.noise_um) ** 2)

    def facts(self) -> dict[str, Any]:
        """Return what the tests rest on, for people and programs."""
        return {
            "rows": self.rows,
            "noise_um": self.noise_um,
            "innovation_um": float(self.noise.spreads_um[-1]),
            "order": int(self.noise.coefficients.shape[1]),
            "gain": self.gain,
            "offset_um": self.offset_um,
            "jitter_s": self.jitter_s,
            "range_V": [self.range.low_V, self.range.high_V],
            "tests": {name: list(self.effects.get(name, ())) for name in self.tests.names},
            "rows_between_false_alarms": self.tests.rows_between_false_alarms,
            "raised_by_training": list(self.raised),
        }


def acts_late(time_s: Array, command_time_s: Array | None) -> bool:
    """Return whether the first command acts behind the first reading, as that of a run does."""
    return command_time_s is not None and bool(command_time_s[0] > time_s[0])


def settling_rows(rest: bool, rows: int) -> int:
    """Return how many rows at the beginning of a record are not judged."""
    return 0 if rest else min(MOST_SETTLING, max(1, int(SETTLING * rows)))


def learn(
    model: Model | Expectation,
    training: Record,
    rows_between_false_alarms: float,
    *,
    linear: bool = False,
    name: str = "the training record",
    tell: Tell = lambda _: None,
    like: Signatures | None = None,
    drifts: bool = False,
) -> Baseline:
    """Return the baseline of a model and its training record.

    Args:
        model: of this project, or the expectation of an FMU.
        training: while all was well; its last `MOST_ROWS` rows where there are more.
        rows_between_false_alarms: mean, of all tests together.
        linear: the command runs straight from row to row.
        name: of the record, for messages.
        tell: is told what is being done.
        like: signatures learned for the same model; None to choose those that the record distinguishes.
        drifts: level and gain may be moving.

    Raises:
        InputError: too few rows, or the model explains nothing of them.
    """
    record = completed(_last(training, MOST_ROWS))
    usable = np.isfinite(record.displacement_um)
    if int(usable.sum()) < LEAST_ROWS:
        raise InputError(
            f"{name}: found {int(usable.sum())} readings, expected at least {LEAST_ROWS} to learn the noise"
        )
    tell("driving the model with the training record")
    plain = OfModel(model, linear=linear) if isinstance(model, Model) else model
    rest, (expected, raw) = _begun(plain, record)
    read = usable.copy()
    usable[: settling_rows(rest, len(record))] = False
    beginning, pasts = _pasts(model if isinstance(model, Model) else None, record, linear=linear, rest=rest)
    times = record.time_s[usable]
    drift = Drift(float(times[-1] - times[0])) if drifts else Drift()
    lines = drift.lines_um(record.time_s, expected, float(np.mean(times)))
    columns = np.column_stack([expected, np.ones(expected.size), pasts, lines])
    deviations = _deviations(record.displacement_um[usable], expected)
    found = _calibration(columns, record.displacement_um, usable, deviations)
    gain, offset = found[:2].tolist()
    residual = record.displacement_um - columns @ found
    noise, kept, spread, jitter_s = _noise(record, expected, residual, usable)
    white = _Whitened(noise, kept, spread)
    full, groups, one_sided = plain, [Group(k, (x,)) for k, x in enumerate(("offset", "gain_error", *OF_FMU))], []
    only: list[bool] = []
    if like is not None:
        full = OfModel(model, like.variants, linear) if isinstance(model, Model) else plain
        groups = [Group(k, x) for k, x in enumerate(like.effects.values())]
        one_sided, only = list(like.one_sided), list(like.grows_only)
        raw = _driven(full, record, rest)[1]
    elif isinstance(model, Model):
        tell("what each effect would add")
        full, groups, one_sided, only = _distinct_signatures(model, record, expected, white, linear)
        raw = _driven(full, record, rest)[1]
    shapes = np.column_stack([np.ones(expected.size), expected, raw])
    sizes = np.sqrt(np.mean(shapes[kept] ** 2, axis=0))
    beginning.courses.least_um = noise_um = float(noise.spreads_um[0])
    scales = np.where(sizes > 0.0, noise_um / np.where(sizes > 0.0, sizes, 1.0), 0.0)
    titles = _unique([x.effects[0] for x in groups])
    sides = np.array(one_sided or [False] * len(titles))
    tests = _tests(titles, white, residual, shapes * scales, sides, rows_between_false_alarms)
    if drifts:
        covariance = _covariance_of_slopes(white.of(columns), deviations, scales, tests)
        drift = replace(drift, slopes=found[-SLOPES:], covariance=covariance)
    if noise.spreads_um[-1] <= _least_um(expected):
        # what lies below the least noise is quieter than that from the beginning
        tests = replace(tests, cusum_limits=np.append(tests.cusum_limits[:-1], np.inf))
    where = _range(record.voltage_V, expected, read, rest=rest)
    pause = Pause(
        beginning.model, linear, (where.low_V, where.high_V), noise_um, beginning.interval_s,
        float(np.std(np.diff(record.voltage_V))),
    )  # fmt: skip
    baseline = Baseline(
        full, noise, tests, dict(zip(titles, (x.effects for x in groups), strict=True)), scales, gain, offset,
        jitter_s, beginning.interval_s, where, int(kept.sum()), (), rest,
        np.array(only or [False] * len(titles)), beginning, found[2:-SLOPES], drift, pause,
    )  # fmt: skip
    tell("holding the tests against the training record itself")
    return _quiet_on_training(baseline, residual, shapes * scales, usable, spread)


def _noise(record: Record, expected: Array, residual: Array, usable: Mask) -> tuple[Noise, Mask, Array, float]:
    """Return the noise, the rows that count, the factor on its deviation, and the jitter of the times."""
    least_um = _least_um(expected)
    steps = np.diff(record.time_s, prepend=2.0 * record.time_s[0] - record.time_s[1])
    rate = np.abs(np.diff(expected, prepend=expected[0])) / steps
    even = np.ones(usable.size)
    noise, kept = fit_noise(residual, usable, even, least_um)
    jitter_s = _jitter_s(innovations(noise, residual, kept, even), rate, noise)
    if jitter_s == 0.0:
        return noise, kept, even, 0.0
    spread = np.sqrt(1.0 + (jitter_s * rate / noise.spreads_um[0]) ** 2)
    noise, kept = fit_noise(residual, usable, spread, least_um)
    return noise, kept, spread, jitter_s


def _least_um(expected: Array) -> float:
    return max(LEAST_PART * float(np.ptp(expected)), 1e-12)


def _distinct_signatures(
    model: Model, record: Record, expected: Array, white: "_Whitened", linear: bool
) -> tuple[OfModel, list[Group], list[bool], list[bool]]:
    """Return the expectation and the signatures that the record distinguishes, their groups, which have one sign."""
    begin = int(np.argmax(white.kept))
    part = slice(begin, min(len(record), begin + SIZED_ON))
    time_s, voltage_V, readings_um = record.time_s[part], record.voltage_V[part], expected[part]
    found = candidates(model, time_s, voltage_V, readings_um, float(white.noise.spreads_um[0]), linear=linear)
    small = np.column_stack([np.ones(part.stop - begin), readings_um, *(x.added_um for x in found)])
    names = ["offset", "gain_error", *(x.effect for x in found)]
    groups = distinct_groups(names, white.part(part).of(small), 2)
    chosen = [found[x.place - 2] for x in groups[2:]]
    sides = [False, False, *(x.one_sided for x in chosen)]
    # of several effects that look alike one may have the other sign
    only = [x.grows_only and len(group.effects) == 1 for x, group in zip(chosen, groups[2:], strict=True)]
    return OfModel(model, [x.model for x in chosen], linear), groups, sides, [False, False, *only]


def _tests(
    titles: tuple[str, ...], white: "_Whitened", residual: Array, signatures: Array, sides: Mask, rows: float
) -> Tests:
    z, count = white.of(signatures), int(white.kept.sum())
    e = np.clip(np.nan_to_num(white.innovations(residual)), -CLIP, CLIP)
    allowances = np.sqrt(_astray(z, e) ** 2 + 1.0 / np.maximum(np.sum(z**2, axis=0), 1e-12))
    doubt = doubt_of_noise(white.noise, signatures, count, np.random.default_rng(SEED))
    tests = make_tests(titles, allowances, doubt, sides, rows, float(doubt[0]), doubt_of_variance(count))
    colours = np.column_stack([np.append(np.zeros(k), e[:-k]) for k in range(1, len(COLOURS) + 1)])
    own = np.sqrt(_astray(colours, e) ** 2 + 1.0 / count)
    square = np.clip(e, -QUIET_CLIP, QUIET_CLIP) ** 2
    factors = np.array([_unsteady(x, white.kept) for x in (e, e, square, square)])
    if _largest_sum(QUIET_REFERENCE - square[white.kept]) >= tests.cusum_limits[-1]:
        # a record that is quiet for long by itself, as one is whose device stands, foretells no end of that
        factors[-1] = np.inf
    return replace(tests, allowances=np.append(allowances, own), cusum_limits=tests.cusum_limits * factors)


def _last(record: Record, rows: int) -> Record:
    if len(record) <= rows:
        return record
    columns: dict[str, Any] = {name: values[-rows:] for name, values in record.columns().items()}
    return Record(**columns, quantities=record.quantities)


def _range(voltage_V: Array, expected_um: Array, read: Mask, *, rest: bool) -> Range:
    """Return where readings have seen the device; one that begins at rest has been at 0 V."""
    commands = np.append(voltage_V[read], [0.0] if rest and read[0] else [])
    return Range(*(float(of(x)) for x in (commands, expected_um[read]) for of in (np.min, np.max)))


def _begun(expectation: Expectation, record: Record) -> tuple[bool, tuple[Array, Array]]:
    """Return whether a record begins at rest, and what is expected of it.

    The first command of a run acts behind its first reading: that says where the device was.
    """
    from_rest = _driven(expectation, record, rest=True)
    if starts_at_rest(record.voltage_V):
        return True, from_rest
    in_motion = _driven(expectation, record, rest=False)
    if not acts_late(record.time_s, record.command_time_s):
        return False, in_motion
    rest = clearly_better(record, from_rest[0], in_motion[0])
    return rest, from_rest if rest else in_motion


def _driven(expectation: Expectation, record: Record, rest: bool) -> tuple[Array, Array]:
    expectation.begin(float(record.time_s[0]), float(record.voltage_V[0]), rest=rest)
    return expectation.advance(record.time_s, record.voltage_V, record.command_time_s)


def _pasts(model: Model | None, record: Record, *, linear: bool, rest: bool) -> tuple[Beginning, Array]:
    """Return the beginning of a record, driven to its end, and what each past adds to its readings (n, COUNT)."""
    range_V = (float(np.min(record.voltage_V)), float(np.max(record.voltage_V)))
    beginning = Beginning(model, linear, range_V, 0.0, float(np.median(np.diff(record.time_s))))
    beginning.begin(float(record.time_s[0]), float(record.voltage_V[0]), rest=rest)
    return beginning, beginning.courses.advance(record.time_s, record.voltage_V, record.command_time_s)


def _deviations(readings_um: Array, expected: Array) -> Array:
    """Return the deviations beforehand of gain, level, pasts, and slopes: no more than all that was read, all gain."""
    span_um = max(float(np.ptp(readings_um)), _least_um(expected))
    return np.array([np.inf, np.inf, *[AMPLITUDE] * COUNT, span_um, 1.0])


def _calibration(columns: Array, measured: Array, usable: Mask, deviations: Array) -> Array:
    """Return the amplitudes (j,) of the columns (n, j) in a reading by least squares, outlying rows set aside.

    Beforehand they are known to be within their deviations (j,) of nought.
    """
    kept = usable.copy()
    beforehand = np.diag(1.0 / deviations)
    found, spread = np.zeros(deviations.size), 0.0
    for _ in range(5):
        own = np.concatenate([columns[kept], max(spread, 1e-9) * beforehand])
        found = np.linalg.lstsq(own, np.append(measured[kept], np.zeros(deviations.size)), rcond=None)[0]
        left = np.where(usable, measured - columns @ found, 0.0)
        spread = 1.4826 * float(np.median(np.abs(left[kept])))
        kept = usable & (np.abs(left) <= 6.0 * spread + 1e-12)
    return found.astype(np.float64)


def _covariance_of_slopes(whitened: Array, deviations: Array, scales: Array, tests: Tests) -> Array:
    """Return the covariance of level and gain per length, the last columns (n, j), whatever the others are.

    It is as much wider than noise makes it as the amplitudes of level and gain, of unit size, are by the tests.
    """
    normal = whitened.T @ whitened + np.diag(1.0 / deviations**2)
    own = np.linalg.pinv(normal, rcond=1e-12, hermitian=True)[-SLOPES:, -SLOPES:]
    information = np.sum((whitened[:, 1::-1] * scales[:SLOPES]) ** 2, axis=0)
    wider = np.sqrt(tests.inflations[:SLOPES] * information) * tests.allowances[:SLOPES]
    return (own * np.outer(wider, wider)).astype(np.float64)


def _jitter_s(e: Array, rate_um_per_s: Array, noise: Noise) -> float:
    """Return by how much the times of the readings vary, 0 where the residual does not grow with the rate."""
    counted = np.isfinite(e)
    square = np.minimum(e[counted] ** 2, CLIP**2)
    drive = rate_um_per_s[counted] ** 2
    if counted.sum() < LEAST_ROWS // 2 or np.ptp(drive) == 0.0:
        return 0.0
    centred = drive - drive.mean()
    slope = float(centred @ (square - square.mean())) / float(centred @ centred)
    left = square - square.mean() - slope * centred
    error = float(np.std(left)) / math.sqrt(float(centred @ centred))
    return float(noise.spreads_um[-1]) * math.sqrt(slope) if slope > SIGNIFICANT * error else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Whitened:
    noise: Noise
    kept: Mask
    spread: Array

    def part(self, where: slice) -> "_Whitened":
        """Return the filter on some of the rows."""
        return _Whitened(self.noise, self.kept[where], self.spread[where])

    def of(self, columns: Array) -> Array:
        """Return whitened columns (n, j), 0 where a row does not count."""
        return np.column_stack([np.nan_to_num(self.innovations(x)) for x in columns.T])

    def innovations(self, column: Array) -> Array:
        """Return a whitened column (n,), NaN where a row does not count."""
        return innovations(self.noise, np.nan_to_num(column), self.kept, self.spread)


def _astray(z: Array, e: Array) -> Array:
    """Return by how much the amplitude of each signature varies from block to block, beyond what noise makes of it."""
    found = np.zeros(z.shape[1])
    for length in BLOCKS:
        count = e.size // length
        if count < FEWEST_BLOCKS:
            break
        cut = slice(0, count * length)
        score = np.sum((z[cut] * e[cut, None]).reshape(count, length, -1), axis=1)
        information = np.sum((z[cut] ** 2).reshape(count, length, -1), axis=1)
        seen = information > 1e-9
        square = np.where(seen, score**2 / np.where(seen, information, 1.0), 0.0)
        blocks = np.maximum(seen.sum(axis=0), 1)
        beyond = square.sum(axis=0) - blocks
        significant = beyond > SIGNIFICANT * np.sqrt(2.0 * blocks)
        most = np.array([_most(x, n) for x, n in zip(square.sum(axis=0), blocks.tolist(), strict=True)]) - blocks
        variance = most / np.maximum(np.sum(np.where(seen, information, 0.0), axis=0), 1e-12)
        found = np.maximum(found, np.where(significant, np.sqrt(np.maximum(variance, 0.0)), 0.0))
    return found


def _largest_sum(score: Array) -> float:
    """Return how far a cumulative sum of a score (n,) rises that begins anew at nought."""
    total = np.cumsum(np.append(0.0, score))
    return float(np.max(total - np.minimum.accumulate(total)))


def _unsteady(score: Array, usable: Mask) -> float:
    """Return by how many times the variance of sums of a score is larger than that of independent rows, 1 at least.

    What a model leaves is not noise of one kind: it is larger where the device moves in another way. The threshold of a
    cumulative sum grows as the variance of what it sums (Siegmund 1985, section 2.6).
    """
    values = score[usable] - score[usable].mean()
    variance, found = float(np.var(values)), 1.0
    for length in BLOCKS:
        count = values.size // length
        if count < FEWEST_BLOCKS or variance == 0.0:
            break
        ratio = float(np.mean(values[: count * length].reshape(count, length).sum(axis=1) ** 2)) / (length * variance)
        if ratio > 1.0 + SIGNIFICANT * math.sqrt(2.0 / count):
            found = max(found, _most(ratio, count))
    return found


def _most(variance: float, blocks: int) -> float:
    """Return what a variance that so many blocks have shown may be at most, with 95 %."""
    return variance * blocks / float(chi2.ppf(0.05, blocks))


def _quiet_on_training(baseline: Baseline, residual: Array, signatures: Array, usable: Mask, spread: Array) -> Baseline:
    """Return the baseline with thresholds that the training record itself stays below."""
    measured = np.where(usable, residual, np.nan)
    kinds = np.full(residual.size, JUDGED, dtype=np.int64)
    raised: list[str] = []
    tests = baseline.tests
    for _ in range(20 * tests.count):
        found = Detector(baseline.noise, tests).judge(measured, signatures, kinds, spread).exceedance
        if found is None:
            break
        if found.test in CUSUMS:
            limits = tests.cusum_limits.copy()
            limits[CUSUMS.index(found.test)] = MARGIN * found.statistic
            tests = replace(tests, cusum_limits=limits)
        else:
            limits = tests.glr_limits.copy()
            limits[tests.names.index(found.test)] = math.sqrt(MARGIN * found.statistic)
            tests = replace(tests, glr_limits=limits)
        raised.append(found.test)
    return replace(baseline, tests=tests, raised=tuple(dict.fromkeys(raised)))


def _unique(names: Sequence[str]) -> tuple[str, ...]:
    found: list[str] = []
    for name in names:
        count = sum(x == name or x.startswith(f"{name}_") for x in found)
        found.append(name if not count else f"{name}_{count + 1}")
    return tuple(found)
