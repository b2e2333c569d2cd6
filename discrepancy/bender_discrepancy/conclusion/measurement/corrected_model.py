"""The corrected model: effects and calibration put in, its FMU built, and the gap measured by driving that FMU."""

import math
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Simulator
from bender_discrepancy.conclusion.measurement.driver import Driver
from bender_effects.catalogue import EFFECTS, READ_OFF
from bender_inference.fitting.fit_problem import Calibration
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.observations import Observations
from bender_loop.errors import RunError
from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_plant.valid_range import ValidRange

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

RAMP_STEPS, SMOOTH_RAMP_STEPS = 16, 2
"""Steps of an FMU along a straight run; a smooth course is in short pieces already."""


@dataclass(frozen=True, slots=True)
class Gap:
    """Measured minus simulated on held-out rows: rms, and rms over the peak-to-peak of the measurement.

    `all_rms_um` is the rms over all readings that count, those of the fit included.
    """

    rms_um: float
    nrmse_percent: float
    all_rms_um: float = math.nan


def calibrated(model: Model, calibration: Calibration, record: int = 0) -> Model:
    """Return a model whose reading has one more gain and offset, those of the record with this number."""
    values = model.values()
    gain = calibration.gain * values.get("calibration.gain", 1.0)
    offset = calibration.gain * values.get("calibration.offset", 0.0) + calibration.offsets_um[record]
    return model.with_block("calibration", gain=gain, offset_um=offset)


def carried(fitted: Fitted, *, with_record_effects: bool = False) -> Fitted:
    """Return a fit without the effects that belong to its records, which are not carried to the next one."""
    if with_record_effects:
        return fitted
    hypothesis = fitted.hypothesis
    kept = tuple(x for x in hypothesis.parts if not EFFECTS[x.form.effect].of_the_record)
    return fitted if len(kept) == len(hypothesis.parts) else replace(fitted, hypothesis=replace(hypothesis, parts=kept))


def corrected(base: Model, fitted: Fitted, sensor_step_um: float = 0.0, record: int = 0) -> Model:
    """Return the base model with the effects and the calibration of a fit in it, as they are in one record."""
    model = calibrated(fitted.hypothesis.model(base, record), fitted.calibration, record)
    return model.with_block(READ_OFF, step_um=sensor_step_um) if sensor_step_um else model


def straight_beyond(model: Model, effects: Sequence[str], valid: ValidRange, seen: Sequence[Observations]) -> Model:
    """Return a model whose curves in the blocks of effects run straight beyond what they were learned from, and 0.

    Powers that fit a range run away outside of it. Curves of the voltage end where the records do, those of the reading
    where what comes before them went. A block without such ends stays as it is.
    """
    blocks = list(model.blocks)
    for k, x in enumerate(model.blocks):
        known = {f.name for f in fields(x.parameters)} if x.id in effects else set[str]()
        if "straight_below_V" in known:
            ends = {"straight_below_V": min(valid.lowest_V, 0.0), "straight_above_V": max(valid.highest_V, 0.0)}
        elif "straight_below_um" in known:
            before = replace(model, blocks=tuple(blocks[:k]))
            levels = [Simulator(y.drive).run(before).reading_um for y in seen]
            low, high = min(float(y.min()) for y in levels), max(float(y.max()) for y in levels)
            ends = {"straight_below_um": min(low, 0.0), "straight_above_um": max(high, 0.0)}
        else:
            continue
        blocks[k] = replace(x, parameters=replace(x.parameters, **ends))
    return replace(model, blocks=tuple(blocks))


def driven(
    fmu: Path,
    records: Iterable[Record],
    linear: bool = False,
    ramp_steps: int = RAMP_STEPS,
    tell: Callable[[str], None] | None = None,
    driver: Driver | None = None,
) -> list[Array]:
    """Drive an FMU with the voltages of records in a child process; returns its readings in um.

    Args:
        fmu: to drive.
        records: played from rest.
        linear: the voltage runs straight from row to row.
        ramp_steps: in which the FMU follows it there.
        tell: is told how far the child is.
        driver: may have begun a child already.

    Raises:
        RunError: the child failed; its last line is passed on.
    """
    with tempfile.TemporaryDirectory() as folder, (driver or Driver()).child() as child:
        places = [_written(record, Path(folder) / f"{k}.npz") for k, record in enumerate(records)]
        problem = child.drive([str(fmu), "linear" if linear else "hold", str(ramp_steps), *map(str, places)], tell)
        if problem:
            raise RunError(f"{fmu}: the FMU could not be driven with the record: {problem}")
        return [np.load(place.with_suffix(".npy")) for place in places]


def _written(record: Record, place: Path) -> Path:
    np.savez(place, allow_pickle=False, **record.columns())
    return place


def gap(measured: Sequence[Array], simulated: Sequence[Array], judged: Sequence[Mask]) -> Gap:
    """Return the gap on the rows that are judged."""
    left = [_squares(d, y, mask) for d, y, mask in zip(measured, simulated, judged, strict=True)]
    everything = [_squares(d, y, np.isfinite(d)) for d, y in zip(measured, simulated, strict=True)]
    span = max(float(np.nanmax(d) - np.nanmin(d)) for d in measured)
    rms, all_rms = _root_mean(left), _root_mean(everything)
    return Gap(rms, 100.0 * rms / span if span > 0.0 else math.nan, all_rms)


def _squares(measured: Array, simulated: Array, counted: Mask) -> tuple[float, int]:
    """Return the sum of the squared residuals of the rows that count, and how many these are."""
    residual = measured[counted]
    residual -= simulated[counted]
    return float(residual @ residual), residual.size


def _root_mean(squares: Sequence[tuple[float, int]]) -> float:
    count = sum(n for _, n in squares)
    return math.sqrt(math.fsum(x for x, _ in squares) / count) if count else math.nan
