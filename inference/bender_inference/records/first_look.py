"""A first look at a record: one rough simulation of the model under its voltage, long before anything is fitted."""

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Simulator
from bender_inference.records.observations import observe
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import Model

ROUGH = 8.0
"""Its steps are that much longer than those of a fit."""
MOST_LOOKED_AT = 200_000
"""Rows of one record: the look tells powers of ten."""
ANOTHER_DEVICE = 10.0
"""A gain that is so many times that of the model, or so small a part of it, is that of another device."""
_FOLLOWS = 0.5
"""Share of the variance that the model has to explain before its gain means anything."""


def first_look(model: Model, record: Record, settings: Settings) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return rows of a record, (n,), and what a model reads in them, (n,) um.

    Raises:
        ModelError, ArithmeticError: the model cannot be simulated under the voltage.
    """
    rows = _looked_at(record)
    observations = observe(_some(record, rows), settings.linear, settings.untimed, settings.smooth)
    return rows, Simulator(observations.drive, coarser=ROUGH).run(model).reading_um


def doubt(model: Model, record: Record, settings: Settings) -> str | None:
    """Return what to say at once where the readings are those of another device than the model; None where not.

    It is a word while the work goes on: the fitted gain decides at the end.

    Raises:
        ModelError, ArithmeticError: the model cannot be simulated under the voltage.
    """
    rows, simulated = first_look(model, record, settings)
    measured = record.displacement_um[rows]
    seen = np.isfinite(measured)
    x, y = simulated[seen] - np.mean(simulated[seen]), measured[seen] - np.mean(measured[seen])
    power = float(x @ x), float(y @ y)
    if not min(power) > 0.0:
        return None
    common = float(x @ y)
    gain = common / power[0]
    if common * common < _FOLLOWS * power[0] * power[1] or 1.0 / ANOTHER_DEVICE < gain < ANOTHER_DEVICE:
        return None
    found = "fall where those of the model rise" if gain < 0.0 else f"are {gain:.2g} times those of the model"
    return (
        f"the readings {found}: this looks like another device than {model.name}. If it is one, stop with Ctrl-C and "
        "give its own model by --model, made by hand or by `bender model fit`; or say --units"
    )


def _looked_at(record: Record) -> NDArray[np.intp]:
    """Return the rows of the look: all of them, or many from all over a long record, the highest among them."""
    every = -(-len(record) // MOST_LOOKED_AT)
    return np.union1d(np.arange(0, len(record), every), [np.argmax(np.abs(record.voltage_V))])


def _some(record: Record, rows: np.ndarray) -> Record:
    if rows.size == len(record):
        return record
    acting_s = record.command_time_s
    # the command of a row that is kept acts within the row, which now is longer
    return Record(
        record.time_s[rows],
        record.voltage_V[rows],
        record.displacement_um[rows],
        None if acting_s is None else acting_s[rows],
    )
