"""What a diagnosis starts from: records and model read, and refused where nothing can be learned from them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bender_effects.rigs import is_piezo_bender
from bender_inference.records.first_look import ROUGH, first_look
from bender_inference.settings import Settings
from bender_loop.errors import InputError
from bender_loop.records.common_units import with_stated_unit
from bender_loop.records.distinct import refuse_twice_the_same
from bender_loop.records.record import Record, read_record
from bender_loop.records.sizes import check_readings, check_sizes, check_work
from bender_loop.tables.quantities import MICROMETRE, USUAL, VOLT, Quantities
from bender_plant.model import Model, load_model
from bender_plant.parameter import ModelError
from bender_plant.plant import sub_step_bounds_s

FEWEST_READINGS = 40
MOST_ROUGH_STEPS = 1e7
"""Of the first look: they all lie in memory, some 100 bytes each."""
# gain that a bench may have beside its model: halfway from a hundred to a thousand, as a wrong prefix makes it
PLAUSIBLE_GAIN = (1.0 / 300.0, 300.0)
# from one row to the next: a fast digitiser, an hourly reading
PLAUSIBLE_STEP_S = (1e-7, 3600.0)


def read_model(name_or_path: str) -> Model:
    """Return a built-in model or that of a file.

    Raises:
        InputError: there is none, or it cannot be.
    """
    try:
        return load_model(name_or_path)
    except ModelError as error:
        raise InputError(str(error)) from None


def read_records(paths: Sequence[Path]) -> list[Record]:
    """Return the records of one bench.

    Raises:
        InputError: a file cannot be read.
    """
    return [read_record(path) for path in paths]


def refuse_unusable(model: Model, names: Sequence[str], records: Sequence[Record], settings: Settings) -> None:
    """Refuse records from which nothing can be learned about a model.

    Args:
        model: as given.
        names: of the records or their files.
        records: of one bench.
        settings: how they are read.

    Raises:
        InputError: a record is too short, still, there twice, in the wrong units, or the model cannot follow it.
    """
    for name, record in zip(names, records, strict=True):
        refuse_other_device(model, name, record.quantities, "use --model auto")
        check_readings(name, record)
        _refuse_what_teaches_nothing(name, record)
    refuse_twice_the_same(names, records)
    _refuse_wrong_units(model, names, records, settings)


def refuse_other_device(
    model: Model, name: str, quantities: Quantities, instead: str = "give its model by --model"
) -> None:
    """Refuse the columns of another device for a model of a piezo bender, in the units of their file.

    Args:
        model: as given.
        name: of the record.
        quantities: of the record.
        instead: what to do with another device, beside making a model.

    Raises:
        InputError: the columns are not in V and lengths.
    """
    if not is_piezo_bender(model) or quantities[:2] == USUAL[:2]:
        return
    kept = zip(quantities.stated, quantities[:2], strict=True)
    found = " and ".join(stated or unit for stated, unit in kept)
    raise InputError(
        f"{name}: found columns in {found}, expected V and lengths for the model {model.name}, a piezo bender; for "
        f"another device {instead}, or make a model first: bender model fit"
    )


def _refuse_what_teaches_nothing(name: str, record: Record) -> None:
    seen = np.flatnonzero(np.isfinite(record.displacement_um))
    if seen.size < FEWEST_READINGS:
        gone = np.flatnonzero(~np.isfinite(record.displacement_um))
        lost = f", {gone.size} of them lost, the first in line {gone[0] + 2}" if gone.size else ""
        raise InputError(
            f"{name}, column displacement_um: found {seen.size} readings in {len(record)} rows{lost}, "
            f"expected at least {FEWEST_READINGS}; give a longer record"
        )
    voltage = record.voltage_V
    if np.ptp(voltage) == 0.0:
        found = with_stated_unit(record, voltage[0], VOLT, 6)
        raise InputError(
            f"{name}, column voltage_V: found {found} in every row from line 2 on, expected a voltage that "
            "changes; a constant one shows no effect"
        )
    readings = record.displacement_um[seen]
    if np.ptp(readings) == 0.0:
        found = with_stated_unit(record, readings[0], MICROMETRE, 6)
        raise InputError(
            f"{name}, column displacement_um: found {found} in every row from line {seen[0] + 2} on, "
            "expected readings that change; is the sensor connected?"
        )


def _refuse_implausible_times(name: str, record: Record) -> None:
    steps = np.diff(record.time_s)
    usual = float(np.median(steps))
    low, high = PLAUSIBLE_STEP_S
    if low <= usual <= high:
        return
    row = int(np.argmax(np.abs(steps - usual) <= 0.01 * usual)) + 1
    raise InputError(
        f"{name}, line {row + 2}, column time_s: found a row {usual:.3g} s after the one before, as in most of the "
        f"record; expected {low:g} to {high:g} s; say what units the columns have, as in --units ms,V,um"
    )


def _refuse_wrong_units(model: Model, names: Sequence[str], records: Sequence[Record], settings: Settings) -> None:
    """Refuse records whose readings no plausible gain brings near the model."""
    for name, record in zip(names, records, strict=True):
        if not settings.untimed:
            _refuse_implausible_times(name, record)
            duration_s = float(record.time_s[-1] - record.time_s[0])
            check_sizes(name, record)
            check_work(name, duration_s, ROUGH * sub_step_bounds_s(model)[1], MOST_ROUGH_STEPS)
        try:
            rows, simulated = first_look(model, record, settings)
        except (ModelError, ArithmeticError) as error:
            row = int(np.argmax(np.abs(record.voltage_V)))
            found = with_stated_unit(record, record.voltage_V[row], VOLT)
            raise InputError(
                f"{name}, line {row + 2}, column voltage_V: found up to {found}, under which the "
                f"model {model.name} cannot be simulated ({error}); are these the right model and units?"
            ) from None
        _refuse_implausible(name, record, rows, simulated, model.name)


def _refuse_implausible(name: str, record: Record, rows: np.ndarray, simulated: np.ndarray, model_name: str) -> None:
    is_read = np.isfinite(record.displacement_um[rows])
    seen = rows[is_read]
    if not seen.size:
        return
    measured = record.displacement_um[seen]
    spread, expected = _spread(measured), _spread(simulated[is_read])
    low, high = PLAUSIBLE_GAIN
    most = float(np.ptp(simulated))
    if most == 0.0:
        raise InputError(
            f"{name}: found a model that does not move under the voltage of the record, expected one that does; is its "
            "sensitivity or gain 0?"
        )
    # a record that is at rest but for a few rows says by those how far the model goes
    if expected == 0.0 or low * expected <= spread <= high * most:
        return
    row = int(seen[np.argmax(np.abs(measured - np.median(measured)))])
    found = with_stated_unit(record, record.displacement_um[row], MICROMETRE)
    command = with_stated_unit(record, record.voltage_V[row], VOLT)
    stroke, wanted = (with_stated_unit(record, x, MICROMETRE, digits=3) for x in (spread, expected))
    raise InputError(
        f"{name}, line {row + 2}: found {found} at {command}, in a record whose readings spread over {stroke}; "
        f"expected {wanted} times {low:.2g} to {high:g}, as of the model {model_name}; say what units the columns "
        "have, as in --units s,V,um, or, of another device, --model auto"
    )


def _spread(values: np.ndarray) -> float:
    low, high = np.quantile(values, [0.02, 0.98])
    return float(high - low)
