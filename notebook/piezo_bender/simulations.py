"""Simulations without a record: a plant under a command."""

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.control.plant import Plant
from bender_loop.errors import InputError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.drive import InputHold, drive_record
from bender_loop.records.record import Record, record_from_columns, write_record
from bender_loop.tables.quantities import USUAL, Quantities, of_input_and_output
from bender_plant.model import Model
from bender_report.palette import light
from bender_report.wording import unit_text
from piezo_bender.models import AnyModel, file_or_model
from piezo_bender.shared import axes_or_new, frame_of, name_arguments_in_errors, one_of, require_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Simulation:
    """What a plant does under a command.

    Attributes:
        record: times, commands and readings.
        subject: the plant.
    """

    record: Record
    subject: str

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(n,) instants of the readings."""
        return self.record.time_s

    @property
    def displacement_um(self) -> NDArray[np.float64]:
        """(n,) readings."""
        return self.record.displacement_um

    def save(self, folder: Path | str) -> Path:
        """Write simulation.csv, a record, into a directory; return the directory.

        Raises:
            InputError: it cannot be written.
        """
        from bender_loop.shell.files import prepare_directory

        out = prepare_directory(Path(folder))
        write_record(out / "simulation.csv", self.record)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the readings over time; return the axes drawn into."""
        drawn = axes_or_new(axes)
        drawn.plot(self.time_s, self.displacement_um, lw=1.2, color=light("with"))
        drawn.set(
            xlabel="time (s)", ylabel=f"reading ({unit_text(self.record.quantities.reading)})", title=self.subject
        )
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the columns as lists."""
        return {key: values.tolist() for key, values in self.record.columns().items()}

    def to_frame(self) -> "DataFrame":
        """Return the columns as a DataFrame (needs pandas)."""
        return frame_of(self.record.columns())

    def __repr__(self) -> str:
        return f"<Simulation {self.subject}: {len(self.record)} rows in {np.ptp(self.time_s):.4g} s>"


@name_arguments_in_errors
def simulate(
    model: AnyModel | None = None,
    *,
    time_s: ArrayLike,
    voltage_V: ArrayLike,
    fmu: Path | str | None = None,
    input_name: str | None = None,
    output_name: str | None = None,
    input_hold: str = "hold",
    parameters: Mapping[str, float] | None = None,
    further: Mapping[str, ArrayLike] | None = None,
    units: str | None = None,
) -> Simulation:
    """Drive a plant from rest with a command.

    Args:
        model: a built-in name, a model file, or from `load_model`; paper where neither it nor an FMU is named.
        time_s: (n,) instants of the readings, increasing.
        voltage_V: (n,) commands; row k is read before command k acts.
        fmu: any co-simulation FMU (FMI 2.0 or 3.0) instead of a model.
        input_name: the FMU's input; None for the only one.
        output_name: its output; None for the only one.
        input_hold: "hold", "linear" or "smooth": the command between two rows.
        parameters: of the FMU, by name, in its own units.
        further: inputs of the FMU beside the command, (n,) each, in its own units.
        units: of command and reading, as "W,K"; every V and um then stands for these.

    Raises:
        InputError: both a model and an FMU are named, or a column or the plant cannot be used.
        RunError: the plant failed.
    """
    one_of("input_hold", input_hold, ("hold", "linear", "smooth"))
    columns = {"time_s": time_s, "voltage_V": voltage_V, "displacement_um": np.zeros(np.shape(time_s))}
    values = {name: np.asarray(x, dtype=np.float64) for name, x in (further or {}).items()}
    more = {f"further {name}": x for name, x in values.items()}
    asked = record_from_columns(columns | more, "simulate", further={name: f"further {name}" for name in values})
    require_text("units", units, "W,K")
    given = USUAL if units is None else of_input_and_output(units)
    with _plant(model, fmu, (input_name, output_name), parameters, given) as (plant, subject):
        readings = drive_record(plant, asked, input_hold=cast(InputHold, input_hold))
    found = Record(asked.time_s, asked.voltage_V, readings, quantities=given, further=asked.further)
    return Simulation(found, subject)


@contextlib.contextmanager
def _plant(
    model: AnyModel | None,
    fmu: Path | str | None,
    names: tuple[str | None, str | None],
    parameters: Mapping[str, float] | None,
    quantities: Quantities,
) -> Iterator[tuple[Plant, str]]:
    """Open the plant that is meant, ours in this process, a foreign FMU in one of its own; give it with its name."""
    if fmu is not None and model is not None:
        raise InputError("--fmu and --model both name a plant; give only one")
    if fmu is not None:
        opened = WatchedPlant(Path(fmu), input_name=names[0], output_name=names[1], quantities=quantities)
        with opened.with_parameters(dict(parameters or {})) as plant:
            yield plant, Path(fmu).name
        return
    if parameters:
        raise InputError("parameters: found without fmu, expected with it; load_model(...).with_values sets a model's")
    from bender_native.ready import ready_plant_fmu

    own = file_or_model("paper" if model is None else model)
    with FmuPlant(ready_plant_fmu(own)) as plant:
        yield plant, own.name if isinstance(own, Model) else Path(own).stem
