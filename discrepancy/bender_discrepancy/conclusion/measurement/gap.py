"""The gap, measured: as given, recalibrated, and with the corrected FMU driven with the records in a child process."""

import contextlib
import ctypes
import gc
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.measurement.corrected_model import (
    RAMP_STEPS,
    SMOOTH_RAMP_STEPS,
    Gap,
    carried,
    driven,
    gap,
)
from bender_discrepancy.conclusion.measurement.driver import Driver
from bender_discrepancy.conclusion.measurement.playable import playable_for
from bender_export.build import build_plant_fmu
from bender_export.platform_support import unsupported
from bender_inference.fitting.blocked import ERRORS, predicted_residuals
from bender_inference.fitting.fit_problem import COARSER, Calibration
from bender_inference.records.excerpt import Excerpt
from bender_inference.records.noise import by_chance_um2, noise_floor_um
from bender_inference.records.observations import Array, Mask, Observations
from bender_inference.search.judgement.score import difference
from bender_inference.search.result import SearchResult
from bender_loop.records.between_rows import Exposed
from bender_loop.records.outliers import outlying
from bender_loop.records.record import Record
from bender_loop.shell.files import write_atomically
from bender_plant.model import Model
from bender_plant.plant import sub_step_bounds_s
from bender_report.wording import HALF_WIDTH

# differences of two runs of one model: sub-steps of other lengths, and the printed digits of a record
SAME_um, SAME_OF_FLOOR = 1e-5, 1e-2
MOST_STEPS = 50_000
"""Of the FMU of one record: a longer one is driven so far, and simulated from there if both agreed until then."""
MOST_SUBSTEPS = 5e6
"""Of one simulation with the sub-steps of the FMU; memory grows with them."""
SETTLES_ROWS = 100
"""Commands that are kept beyond the last row that is read, so that a smooth course there is that of the record."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The gap at three stages over the whole records, and the readings of the rows that were searched.

    Attributes:
        before: the model as given.
        recalibrated: after calibration alone.
        after: the corrected FMU.
        floor_um: what no model could go below: the noise, and the step of coarse readings.
        before_um: (n,) readings of every record, as given.
        recalibrated_um: after calibration alone.
        after_um: of the corrected FMU.
        judged: rows that the gap was measured on.
        by_chance_um2: by how much noise alone may set the mean squares of `after` and `recalibrated` apart.
        by_chance_given_um2: the same of `after` and `before`.
        closed: part of the variance above the noise that calibration alone leaves and `after` closes, and its standard
            error, of the reported blocks and of the noise; nan where there is no such variance.
        is_corrected: whether the model driven is another one than the model as given.
    """

    before: Gap
    recalibrated: Gap
    after: Gap
    floor_um: float
    before_um: list[Array]
    recalibrated_um: list[Array]
    after_um: list[Array]
    judged: int = 0
    by_chance_um2: float = 0.0
    by_chance_given_um2: float = 0.0
    closed: tuple[float, float] = (math.nan, math.inf)
    is_corrected: bool = True

    @property
    def closes(self) -> float | None:
        """The part of the gap that is closed, from 0 to 1; None where calibration alone leaves no more than noise."""
        share = self.closed[0]
        return None if math.isnan(share) else min(max(share, 0.0), 1.0)

    @property
    def is_worse(self) -> bool:
        """Whether the corrected model leaves more than the model as given or calibration alone, on the reported rows.

        It is then not written. The FMU and a simulation of the same model differ by nanometres, which do not count;
        nor does what the noise of these rows does by chance.
        """
        return self.is_corrected and (
            self._is_beyond(self.recalibrated.rms_um, self.by_chance_um2)
            or self._is_beyond(self.before.rms_um, self.by_chance_given_um2)
        )

    @property
    def is_unproved(self) -> bool:
        """Whether the part of the gap that the corrected model closes, on the reported rows, may be 0 (95 % interval).

        It is then not written either: it may be better where it was fitted alone.
        """
        share, error = self.closed
        return self.is_corrected and math.isfinite(error) and share <= HALF_WIDTH * error

    def falls_short(self, closes: float) -> bool:
        """Return whether the corrected model closes less than a part of the gap, by more than the error of that."""
        share, error = self.closed
        return share + ERRORS * error < closes

    def _is_beyond(self, other_um: float, chance_um2: float) -> bool:
        after_um = self.after.rms_um
        is_more = after_um > other_um + max(SAME_um, SAME_OF_FLOOR * self.floor_um)
        return is_more and after_um**2 - other_um**2 > chance_um2


def measure(
    search: SearchResult,
    model: Model,
    calibration: Calibration,
    fmu: Path,
    of_record: int = 0,
    tell: Callable[[str], None] | None = None,
    driver: Driver | None = None,
) -> Measured:
    """Build the FMU of the corrected model at a path, drive it with the records, and compare on held-out rows.

    Args:
        search: of the records.
        model: corrected, with the surroundings and the offset of one record in it.
        calibration: gain and offsets in the corrected model, one offset for each record.
        fmu: where it is written.
        of_record: which record that is.
        tell: is told that the driving begins ("") and how far it is.
        driver: may have begun a process to drive it in.

    Raises:
        RunError: the FMU could not be driven.
        InputError: the FMU could not be written.
    """
    given, recalibrated = recalibrated_readings(search)
    _build(model, fmu)
    if tell is not None:
        tell("")
    own = calibration.offsets_um[of_record]
    readings = _driven(search, model, fmu, of_record, tell, driver)
    readings = [y + d for y, d in zip(readings, _of_the_record(search), strict=True)]
    after = [y + (offset - own) for y, offset in zip(readings, calibration.offsets_um, strict=True)]
    return replace(compared(search, given, recalibrated, after), is_corrected=model is not search.base)


def _of_the_record(search: SearchResult) -> list[Array]:
    """Return (n,) of every record, what the effects that belong to it add to the readings of the corrected model."""
    best = search.best
    device = carried(best, with_record_effects=search.settings.with_record_effects)
    if device is best:
        return [np.zeros(x.measured_um.size) for x in search.whole]
    coarser = COARSER if search.excerpts else 1.0
    found = []
    for k, x in enumerate(search.whole):
        simulator = Simulator(x.drive, coarser=coarser)
        both = (simulator.run(y.hypothesis.model(search.base, k)).reading_um for y in (best, device))
        found.append(best.calibration.gain * (next(both) - next(both)))
    return found


def recalibrated_readings(search: SearchResult) -> tuple[list[Array], list[Array]]:
    """Return the simulated readings (n,) of every record, of the model as given and after calibration alone.

    Where calibration predicts unseen blocks no better than the model as given, that stands: gain and offsets would
    follow what is missing.
    """
    # nothing of nanometres shows beside the memory that a long record takes
    coarser = COARSER if search.excerpts else 1.0
    if search.excerpts:  # whole records need the memory that simulations of their excerpts keep
        for simulator in (*search.problem.fine, *search.problem.rough):
            simulator.forget()
        _give_back()
    given = [Simulator(x.drive, coarser=coarser).run(search.base).reading_um for x in search.whole]
    return given, after_calibration(search, given, _searched(search, given))


def after_calibration(search: SearchResult, given: list[Array], searched: list[Array]) -> list[Array]:
    """Return the readings (n,) of the model as given after calibration alone, where that predicts unseen blocks better.

    Args:
        search: of the records.
        given: (n,) readings of every record.
        searched: those of the rows that were searched.
    """
    if not _calibration_predicts(search, searched):
        return given
    alone = search.found.base.calibration
    return [alone.gain * y + offset for y, offset in zip(given, alone.offsets_um, strict=True)]


def _calibration_predicts(search: SearchResult, given: list[Array]) -> bool:
    """Return whether gain and offsets predict held-out blocks better than the model as given, by more than the error.

    As everywhere, the simpler one stands within one standard error.
    """
    predicted = predicted_residuals(search.problem, search.found.base)
    if predicted is None:
        return True
    observed = search.problem.observations
    counted = [x.searched for x in observed]
    left = [np.where(m, x.beyond(x.measured_um - y), 0.0) for x, y, m in zip(observed, given, counted, strict=True)]
    return difference(predicted, left, counted).deviations > search.rules.standard_errors


def compared(search: SearchResult, given: list[Array], recalibrated: list[Array], after: list[Array]) -> Measured:
    """Return the gap between the records and simulated readings of all of their rows, (n,) of every record."""
    noise, whole = search.archive.noise_um, search.whole
    if search.excerpts:
        whole = [_without_outlying(*x, noise) for x in zip(whole, search.excerpts, after, strict=True)]
    measured = [np.where(x.usable, x.measured_um, np.nan) for x in whole]
    judged = [x.reporting for x in whole]
    before, alone_left, left = (gap(measured, simulated, judged) for simulated in (given, recalibrated, after))
    floor = math.hypot(noise, search.sensor_step_um / math.sqrt(12.0))
    if search.sensor_step_um > 0.0:
        floor = max(floor, _shown_by_readings_um([x - y for x, y in zip(measured, after, strict=True)]))
    shown = (_searched(search, x) for x in (given, recalibrated, after))
    chance, chance_given = (chance_um2(search, floor, after, x, judged) for x in (recalibrated, given))
    rows = sum(int(x.sum()) for x in judged)
    alone, corrected = ([x - y for x, y in zip(measured, z, strict=True)] for z in (recalibrated, after))
    closed = closed_part(alone, corrected, whole, floor)
    return Measured(
        before, alone_left, left, floor, *shown,
        judged=rows, by_chance_um2=chance, by_chance_given_um2=chance_given, closed=closed,
    )  # fmt: skip


def closed_part(
    alone: Sequence[Array], after: Sequence[Array], records: Sequence[Observations], floor_um: float
) -> tuple[float, float]:
    """Return the part of the variance above the noise that is closed on reported rows, and its standard error.

    The part is a ratio of sums over blocks. Its error has two sources: blocks differ, and the residual is noisy.
    The second one counts where the corrected model leaves hardly more than noise.
    """
    gaps, lefts = (np.array(_above_noise(x, records, floor_um)) for x in (alone, after))
    gap_um2, count = float(gaps.sum()), gaps.size
    if count < 2 or gap_um2 <= 0.0:
        return math.nan, math.inf
    left_um2, rows = float(lefts.sum()), sum(int(x.reporting.sum()) for x in records)
    spread = float(np.sum((lefts - left_um2 / gap_um2 * gaps) ** 2)) * count / (count - 1)
    noise = 2.0 * rows * floor_um**4 + 4.0 * floor_um**2 * max(left_um2, 0.0)
    return 1.0 - left_um2 / gap_um2, math.sqrt(spread + noise) / gap_um2


def _above_noise(left: Sequence[Array], records: Sequence[Observations], floor_um: float) -> list[float]:
    """Return the sum of squares above the noise in every block of the reported rows."""
    found: list[float] = []
    for x, record in zip(left, records, strict=True):
        rows = record.reporting & np.isfinite(x)
        blocks, squares = record.folds[rows], x[rows] ** 2 - floor_um**2
        found += [float(squares[blocks == k].sum()) for k in np.unique(blocks)]
    return found


def chance_um2(
    search: SearchResult, floor_um: float, one: list[Array], other: list[Array], judged: Sequence[Mask]
) -> float:
    """Return by how much noise alone may set the mean squares of two simulations apart on some rows."""
    apart = [(y - z)[rows] for y, z, rows in zip(one, other, judged, strict=True)]
    return by_chance_um2(floor_um, np.concatenate(apart), search.settings.confidence)


def _shown_by_readings_um(left: list[Array]) -> float:
    """Return the noise of coarse readings as they are; what lies within a step counts as well.

    Noise that carries readings over the edges of steps adds to these, and what lies beyond the steps hardly shows it.
    """
    squares = [noise_floor_um(np.nan_to_num(x), np.isfinite(x)) ** 2 for x in left]
    return math.sqrt(sum(squares) / len(squares))


def _without_outlying(x: Observations, excerpt: Excerpt, simulated: Array, noise_um: float) -> Observations:
    """Return a record without the outlying readings outside of its excerpt, which no search has set aside."""
    stray: Mask = outlying(x, x.measured_um - simulated, noise_um)
    stray[excerpt.rows] = False
    return x.without(stray)


def _searched(search: SearchResult, readings: list[Array]) -> list[Array]:
    if not search.excerpts:
        return readings
    return [y[x.rows] for x, y in zip(search.excerpts, readings, strict=True)]


def _build(model: Model, fmu: Path) -> Path:
    """Write the FMU of a model: that of PythonFMU, or one without Python where that cannot run."""
    if unsupported() is None:
        return build_plant_fmu(model, fmu)
    from bender_native.build import native_plant_fmu, way

    write_atomically(fmu, native_plant_fmu(model, way(), own=True))
    return fmu


def _give_back() -> None:
    """Give memory that is free back to the system, where its allocator keeps it for later."""
    gc.collect()
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library than that of GNU
            ctypes.CDLL(None).malloc_trim(0)


def _driven(
    search: SearchResult,
    model: Model,
    fmu: Path,
    of_record: int,
    tell: Callable[[str], None] | None,
    driver: Driver | None,
) -> list[Array]:
    """Return the readings (n,) of the FMU driven with every record, of a long one simulated beyond its beginning.

    Records that the FMU does not stand for get it with surroundings of their own.
    """
    best = carried(search.best, with_record_effects=search.settings.with_record_effects).hypothesis
    drives = [x.drive for x in search.whole]
    models = [best.around(model, k) if best.has_surroundings else model for k in range(len(drives))]
    begun = [_beginning(x, y) for x, y in zip(drives, models, strict=True)]
    readings = _played(models, begun, fmu, of_record, tell, driver)
    for k in (k for k, (x, y) in enumerate(zip(drives, begun, strict=True)) if y is not x):
        beyond = _simulated_beyond(models[k], drives[k], readings[k], search.whole[k].measured_um)
        if beyond is None:
            return _played(models, drives, fmu, of_record, tell, driver)
        readings[k] = np.concatenate([readings[k], beyond])
    return readings


def _simulated_beyond(model: Model, drive: Drive, begun: Array, measured_um: Array) -> Array | None:
    """Return what is simulated of a record beyond what an FMU was driven with; None where both differ until there.

    Sub-steps are longer than those of the FMU where these already agree; a record that needs too many is driven.
    """
    rows = begun.size
    most_um = max(SAME_um, SAME_OF_FLOOR * _rms_um(begun - measured_um[:rows]))
    substeps = drive.row_time_s.size + float(np.ptp(drive.row_time_s)) / sub_step_bounds_s(model)[1]
    for coarser in (COARSER, 1.0) if substeps <= MOST_SUBSTEPS else (COARSER,):
        simulated = Simulator(drive, coarser=coarser).run(model).reading_um
        if _rms_um(begun - simulated[:rows]) <= most_um:
            return simulated[rows:]
    return None


def _rms_um(left_um: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(left_um))))


def _beginning(drive: Drive, model: Model) -> Drive:
    """Return a drive, or its beginning where an FMU would take too many steps to the end."""
    record, _ = playable_for(model, drive)
    steps = record.time_s.size * _steps_of_ramp(drive)
    if steps <= MOST_STEPS:
        return drive
    rows = max(drive.row_time_s.size * MOST_STEPS // steps, 1)
    commands = int(np.searchsorted(drive.command_time_s, drive.row_time_s[rows - 1], side="right")) + SETTLES_ROWS
    return replace(
        drive,
        row_time_s=drive.row_time_s[:rows],
        command_time_s=drive.command_time_s[:commands],
        voltage_V=drive.voltage_V[:commands],
    )


def _steps_of_ramp(drive: Drive) -> int:
    return (SMOOTH_RAMP_STEPS if drive.smooth else RAMP_STEPS) if drive.linear else 1


def _played(
    models: Sequence[Model],
    drives: Sequence[Drive],
    fmu: Path,
    of_record: int,
    tell: Callable[[str], None] | None,
    driver: Driver | None,
) -> list[Array]:
    """Return the readings (n,) of FMUs driven with each record, that at a path where a model is that of its record."""
    how = any(x.linear for x in drives), SMOOTH_RAMP_STEPS if any(x.smooth for x in drives) else RAMP_STEPS
    read: list[Exposed] = []

    def played(drive: Drive) -> Record:
        record, exposed = playable_for(models[of_record], drive)
        read.append(exposed)
        return record

    if all(x is models[of_record] for x in models):
        # one record at a time is in memory, and none while the FMU is driven
        found = driven(fmu, map(played, drives), *how, tell, driver)
    else:
        found = []
        with tempfile.TemporaryDirectory() as folder:
            for k, drive in enumerate(drives):
                own = fmu if k == of_record else _build(models[k], Path(folder) / f"{k}.fmu")
                found += driven(own, map(played, [drive]), *how, tell, driver)
    return [x.readings(y) for x, y in zip(read, found, strict=True)]
