"""Parameters of an FMU, fitted to records by the FMU itself: sensitivities first, then the error of its output.

The fit runs in coordinates from 0 to 1 over the range of every parameter. A third of the rows, in blocks, is held out.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.foreign.suspects import Suspect, suspects_of
from bender_identify.fitting.correlation import correlation_rows
from bender_inference.records.noise import noise_floor_um
from bender_inference.records.observations import Observations, observe
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.drive import InputHold
from bender_loop.records.record import Record
from bender_loop.records.replay import replay
from bender_loop.records.sizes import check_sizes

Array = NDArray[np.float64]
Run = Callable[[dict[str, float]], list[Array]]
"""Readings (n,) of every record at values of parameters; raises RunError where the FMU cannot be run with them."""

SMALL, LEAST_SMALL = 0.005, 1e-4
"""Change of a coordinate by which sensitivities are measured, and the one of a fit."""
UNSEEN = 0.5
"""A parameter whose standard deviation would be more of its range than this is one that the record cannot see."""
ALIKE = 0.9998
"""Two parameters whose effects correlate by more than this act only together, unless the noise allows more."""
SCANNED, EVALUATIONS = 6, 40


@dataclass(frozen=True, slots=True)
class Fitted:
    """One fitted parameter: its value, the standard deviation, and whether it lies at the end of its range."""

    suspect: Suspect
    value: float
    std: float
    at_the_end: bool

    @property
    def is_off(self) -> bool:
        """Whether it changed by more than the records leave open, at three standard deviations."""
        return abs(self.value - self.suspect.given) > 3.0 * self.std


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """What the records say of the parameters.

    Attributes:
        parameters: those that were fitted.
        unseen: why a parameter was left as it is, by name.
        combinations: parameters that act only together: the first of each was fitted, the others left.
        gain: of the reading, by the first sensor; 1 where it was not free.
        offsets_um: of the reading, in every record; 0 where they were not free.
        readings_um: (n,) of every record, gain and offset in them.
        before_um: (n,) of every record as the model is given.
        rms_um: on held-out rows.
        before_rms_um: on held-out rows as the model is given.
        noise_um: what no model could go below.
        runs: of the FMU over all records.
    """

    parameters: tuple[Fitted, ...]
    unseen: dict[str, str]
    combinations: tuple[tuple[str, ...], ...]
    gain: float
    offsets_um: tuple[float, ...]
    readings_um: list[Array]
    before_um: list[Array]
    rms_um: float
    before_rms_um: float
    noise_um: float
    runs: int

    def values(self) -> dict[str, float]:
        """Return the fitted values by name."""
        return {x.suspect.name: x.value for x in self.parameters}


class _Task:
    """Readings of the FMU at coordinates, with gain and offsets solved for where they are free."""

    def __init__(
        self, run: Run, seen: Sequence[Observations], free_reading: bool, sensors: Sequence[int] | None = None
    ) -> None:
        self.run, self.seen, self.free = run, seen, free_reading
        self.masks = [x.usable & ~x.held_out for x in seen]
        self.measured = np.concatenate([x.measured_um[m] for x, m in zip(seen, self.masks, strict=True)])
        self.runs = 0
        rows = [np.full(int(m.sum()), k) for k, m in enumerate(self.masks)]
        self.record = np.concatenate(rows)
        of_record = np.array(sensors if sensors is not None else [0] * len(seen))
        self.sensor, self.sensors = of_record[self.record], int(of_record.max()) + 1

    def readings(self, suspects: Sequence[Suspect], point: Sequence[float]) -> list[Array]:
        self.runs += 1
        return self.run({x.name: x.outward(float(p)) for x, p in zip(suspects, point, strict=True)})

    def flat(self, readings: Sequence[Array]) -> Array:
        return np.concatenate([y[m] for y, m in zip(readings, self.masks, strict=True)])

    def without_reading(self, column: Array, simulated: Array) -> Array:
        """Return a column without what gain and offsets of the reading explain of it."""
        if not self.free:
            return column
        basis = self._basis(simulated)
        return column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]

    def _basis(self, simulated: Array) -> Array:
        gains = [np.where(self.sensor == k, simulated, 0.0) for k in range(self.sensors)]
        return np.column_stack([*gains, *[(self.record == k).astype(float) for k in range(len(self.masks))]])

    def reading(self, simulated: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the gain of every sensor and the offsets that meet the measurement best; 1 and 0 if not free."""
        if not self.free:
            return (1.0,) * self.sensors, (0.0,) * len(self.masks)
        found = np.linalg.lstsq(self._basis(simulated), self.measured, rcond=None)[0].tolist()
        return tuple(found[: self.sensors]), tuple(found[self.sensors :])

    def residual(self, readings: Sequence[Array]) -> Array:
        simulated = self.flat(readings)
        gains, offsets = self.reading(simulated)
        return self.measured - np.array(gains)[self.sensor] * simulated - np.array(offsets)[self.record]


def calibrate(
    run: Run,
    seen: Sequence[Observations],
    suspects: Sequence[Suspect],
    *,
    free_reading: bool = False,
    sensors: Sequence[int] | None = None,
) -> Calibrated:
    """Return what the records say of the suspected parameters.

    Args:
        run: the FMU.
        seen: the records.
        suspects: in the order in which they are preferred where some act only together.
        free_reading: gain and offset of the reading are free beside them.
        sensors: number of the sensor of every record, from 0 on, each with a gain of its own; None for one.

    Raises:
        RunError: the FMU cannot be run as it is given.
    """
    task = _Task(run, seen, free_reading, sensors)
    given = [x.inward(x.given) for x in suspects]
    before = task.readings(suspects, given)
    noise = _noise_um(seen, before)
    columns, unseen, combinations = _sensitivities(task, suspects, before, noise)
    used = [x for x in suspects if x.name in columns]
    point = _fit(task, used) if used else np.empty(0)
    after = task.readings(used, point.tolist()) if used else before
    gains, offsets = task.reading(task.flat(after))
    deviations = _deviations(task, used, point, after)
    noise = min(noise, _noise_um(seen, after))
    of_record = sensors if sensors is not None else [0] * len(seen)
    readings = [gains[k] * y + offset for y, offset, k in zip(after, offsets, of_record, strict=True)]
    fitted = [
        Fitted(x, x.outward(float(p)), d, not 1e-6 < p < 1.0 - 1e-6)
        for x, p, d in zip(used, point, deviations, strict=True)
    ]
    return Calibrated(
        tuple(fitted), unseen, combinations, gains[0], offsets, readings, before, held_out_rms_um(seen, readings),
        held_out_rms_um(seen, before), noise, task.runs,
    )  # fmt: skip


def held_out_rms_um(seen: Sequence[Observations], readings: Sequence[Array]) -> float:
    """Return the rms of measured minus simulated on held-out rows."""
    left = [(x.measured_um - y)[x.usable & x.held_out] for x, y in zip(seen, readings, strict=True)]
    return math.sqrt(float(np.mean(np.concatenate(left) ** 2)))


def _noise_um(seen: Sequence[Observations], readings: Sequence[Array]) -> float:
    left = [noise_floor_um(x.measured_um - y, x.usable) for x, y in zip(seen, readings, strict=True)]
    return math.sqrt(float(np.mean(np.square(left))))


def _sensitivities(
    task: _Task, suspects: Sequence[Suspect], before: list[Array], noise_um: float
) -> tuple[dict[str, Array], dict[str, str], tuple[tuple[str, ...], ...]]:
    """Return the columns of what can be fitted, why others cannot, and what acts only together."""
    simulated = task.flat(before)
    columns: dict[str, Array] = {}
    unseen: dict[str, str] = {}
    together: dict[str, list[str]] = {}
    for k, suspect in enumerate(suspects):
        try:
            raw = _slope(task, suspects, k)
        except RunError as problem:
            unseen[suspect.name] = f"the FMU does not run with another value of it ({problem})"
            continue
        column = task.without_reading(raw, simulated)
        least = noise_um / UNSEEN
        if not float(np.linalg.norm(raw)) > max(least, 1e-9 * float(np.ptp(simulated))):
            unseen[suspect.name] = (
                "the record does not determine it: changing it changes the simulation by less than the noise"
            )
        elif not float(np.linalg.norm(column)) > max(least, 2e-3 * float(np.linalg.norm(raw))):
            unseen[suspect.name] = (
                "it cannot be distinguished from gain and offset of the reading, which are fitted too"
            )
        else:
            twin = next((x for x, y in columns.items() if _alike(column, y, noise_um)), None)
            if twin is None:
                columns[suspect.name] = column
            else:
                together.setdefault(twin, [twin]).append(suspect.name)
                unseen[suspect.name] = f"the record determines it only together with {twin}, which was fitted"
    unseen |= {
        x: "the record determines it only together with others, which were fitted"
        for x in _dependent(columns, noise_um)
    }
    kept = {x: y for x, y in columns.items() if x not in unseen}
    dependent = [tuple(columns)] if len(kept) < len(columns) else []
    return kept, unseen, (*(tuple(x) for x in together.values()), *dependent)


def _slope(task: _Task, suspects: Sequence[Suspect], k: int) -> Array:
    """Return the change of the readings over the whole range of a parameter, as its slope where it is given has it."""
    point = [x.inward(x.given) for x in suspects]
    low, high = max(point[k] - SMALL, 0.0), min(point[k] + SMALL, 1.0)
    ends = [task.flat(task.readings(suspects, [*point[:k], end, *point[k + 1 :]])) for end in (low, high)]
    return (ends[1] - ends[0]) / (high - low)


def _alike(a: Array, b: Array, noise_um: float) -> bool:
    cosine = abs(float(a @ b)) / float(np.linalg.norm(a) * np.linalg.norm(b))
    shorter = min(float(np.linalg.norm(a)), float(np.linalg.norm(b)))
    # what of the one the other cannot do, against the noise
    apart = shorter * math.sqrt(max(0.0, 1.0 - cosine * cosine))
    return cosine > ALIKE or apart < noise_um / UNSEEN


def _dependent(columns: dict[str, Array], noise_um: float) -> list[str]:
    """Return parameters, the last ones first, whose effect the others make up for."""
    left = dict(columns)
    out: list[str] = []
    for name in reversed(list(columns)):
        others = [y for x, y in left.items() if x != name]
        if not others:
            break
        basis = np.column_stack(others)
        own = left[name]
        rest = own - basis @ np.linalg.lstsq(basis, own, rcond=None)[0]
        limit = max(noise_um / UNSEEN, math.sqrt(1.0 - ALIKE**2) * float(np.linalg.norm(own)))
        if float(np.linalg.norm(rest)) < limit:
            out.append(name)
            del left[name]
    return out


def _fit(task: _Task, used: Sequence[Suspect]) -> Array:
    """Return the coordinates with the least error on fitted rows, from the model as given and the best of a scan."""
    from scipy.optimize import least_squares

    worst = float(np.linalg.norm(task.measured)) / math.sqrt(task.measured.size)

    def residual(point: Array) -> Array:
        try:
            found = task.residual(task.readings(used, point.tolist()))
        except RunError:
            return np.full(task.measured.size, 10.0 * worst)
        return found

    given = np.array([x.inward(x.given) for x in used])
    rng = np.random.default_rng(0)
    scan = [given, *((rng.permuted(np.arange(SCANNED))[:, None] + rng.random((SCANNED, len(used)))) / SCANNED)]
    ranked = sorted(scan[1:], key=lambda x: float(np.sum(residual(x) ** 2)))
    fits = []
    for start in (given, ranked[0]):
        inside = np.clip(start, 1e-3, 1.0 - 1e-3)
        fits.append(
            least_squares(residual, inside, bounds=(0.0, 1.0), diff_step=LEAST_SMALL, max_nfev=EVALUATIONS, x_scale=1.0)
        )
    return np.asarray(min(fits, key=lambda x: x.cost).x, dtype=np.float64)


def _deviations(task: _Task, used: Sequence[Suspect], point: Array, after: list[Array]) -> list[float]:
    """Return the standard deviations of the parameters, correlation of the residual allowed for."""
    if not used:
        return []
    simulated, left = task.flat(after), task.residual(after)
    gains = np.array(task.reading(simulated)[0])[task.sensor]
    columns: list[Array] = []
    slopes: list[float] = []
    for k, suspect in enumerate(used):
        step = LEAST_SMALL * 10.0 * (1.0 if point[k] < 0.5 else -1.0)
        moved = point.copy()
        moved[k] += step
        other = task.flat(task.readings(used, moved.tolist()))
        columns.append(task.without_reading(gains * (other - simulated) / step, simulated))
        slopes.append((suspect.outward(float(moved[k])) - suspect.outward(float(point[k]))) / step)
    jacobian = np.column_stack(columns)
    free = max(left.size - jacobian.shape[1] - 1, 1)
    variance = float(left @ left) / free * correlation_rows(left)
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    return [abs(s) * math.sqrt(max(float(v), 0.0)) for s, v in zip(slopes, np.diag(covariance), strict=True)]


def calibrate_fmu(
    fmu: Path,
    records: Sequence[Record],
    suspects: Sequence[str],
    *,
    names: Sequence[str],
    input_name: str | None = None,
    output_name: str | None = None,
    parameters: Mapping[str, float] | None = None,
    input_hold: InputHold = "hold",
    untimed: bool = False,
    free_reading: bool = False,
    tell: Callable[[int], None] = lambda _: None,
) -> Calibrated:
    """Fit parameters of an FMU to records; it runs in a process of its own.

    Args:
        fmu: its file.
        records: in the units of the first one.
        suspects: `NAME`, `NAME=LOW:HIGH` or `tunable`.
        names: of the records, for messages.
        input_name: the variable that is commanded, None for the only one.
        output_name: the variable that is read, None for the only one.
        parameters: start values of others, by name.
        input_hold: the command between two rows.
        untimed: the times are only an order.
        free_reading: gain and offset of the reading are free as well.
        tell: is told how often the FMU was driven.

    Raises:
        InputError: a suspect, a variable or a record cannot be used.
        RunError: the FMU fails, crashes or hangs.
    """
    own = dict(parameters or {})
    wanted = suspects_of(fmu, suspects, own)
    for name, record in zip(names, records, strict=True):
        check_sizes(name, record, untimed)
    seen = [observe(x) for x in records]
    for name, x in zip(names, seen, strict=True):
        if int((x.usable & ~x.held_out).sum()) < 10 + len(wanted):
            raise InputError(f"{name}: found {int(x.usable.sum())} readings, expected more to fit parameters to")
    opened = WatchedPlant(fmu, input_name=input_name, output_name=output_name, quantities=records[0].quantities)
    with opened.with_parameters(own) as plant:
        runs = 0

        def readings(values: dict[str, float]) -> list[Array]:
            nonlocal runs
            runs += 1
            tell(runs)
            plant.set_parameters(values)
            return [replay(plant, x, input_hold=input_hold, untimed=untimed).simulated_um for x in records]

        return calibrate(readings, seen, wanted, free_reading=free_reading)
