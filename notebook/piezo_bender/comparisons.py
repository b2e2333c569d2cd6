"""Comparison: a model, or any FMU, driven with a record's voltage and laid over its displacement."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from bender_inference.records.checks import refuse_other_device
from bender_loop.errors import InputError
from bender_loop.records.common_units import driven_in, in_units_of
from bender_loop.records.compare import Comparison, require_readings
from bender_loop.records.compare import compare as compare_readings
from bender_loop.records.drive import InputHold
from bender_loop.records.replay import Replay, replay
from bender_loop.records.sizes import check_sizes, check_work
from bender_loop.records.variables import variables_of
from bender_loop.tables.quantities import MICROMETRE, Quantities
from bender_plant.model import Model
from bender_report.palette import light
from bender_report.wording import shown_in, unit_text
from piezo_bender.models import AnyModel, file_or_model, load_model
from piezo_bender.records import LoadedRecord, load_record
from piezo_bender.shared import axes_or_new, frame_of, html_table, name_arguments_in_errors, one_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.fmu.process.watched import WatchedPlant
    from piezo_bender.records import Source

Steps = Callable[[int], None]
MOST_STEPS = 2e7
"""Of the plant over a record, at some 15 µs each: five minutes."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RecordComparison:
    """A simulation beside a record.

    Attributes:
        record: what was measured.
        subject: the model or FMU, in words.
        model: its name or file; None for a foreign FMU.
        fmu: the foreign FMU; None for a model.
        input_hold: how the voltage ran between two rows.
        untimed: whether every row was a settled pair.
        replayed: the simulated readings.
        comparison: the figures.
        parameters: of the FMU, those that were set.
        remark: that the record leaves the range in which the model was learned; "" where it does not.
    """

    record: LoadedRecord
    subject: str
    model: str | None
    fmu: str | None
    input_hold: str
    untimed: bool
    replayed: Replay
    comparison: Comparison
    parameters: dict[str, float] = field(default_factory=dict)
    remark: str = ""

    @property
    def simulated_um(self) -> NDArray[np.float64]:
        """(n,) readings of the simulation."""
        return self.replayed.simulated_um

    @property
    def recalibrated_um(self) -> NDArray[np.float64]:
        """(n,) the same with the best gain and offset."""
        return self.comparison.recalibration.apply(self.replayed.simulated_um)

    @property
    def axis(self) -> NDArray[np.float64]:
        """(n,) time in s, or the row of an untimed record."""
        return np.arange(len(self.record), dtype=np.float64) if self.untimed else self.record.time_s

    @property
    def axis_label(self) -> str:
        """What the axis shows."""
        return "row" if self.untimed else "time (s)"

    def picture(self) -> bytes:
        """Return the overlay, its loop and its residual as PNG.

        Raises:
            InputError: matplotlib is not installed.
        """
        from bender_report.drawing import require_drawing
        from bender_report.record_overlay import Overlay, draw_overlay

        require_drawing("picture")
        overlay = Overlay(
            title=f"{Path(self.record.source).name} over {self.subject}",
            axis=self.axis,
            axis_label=self.axis_label,
            acting_V=self.replayed.acting_V,
            measured_um=self.record.displacement_um,
            simulated_um=self.simulated_um,
        )
        with shown_in(*self.record.record.quantities[:2]):
            return draw_overlay(overlay, self.comparison)

    def save(self, folder: Path | str) -> Path:
        """Write comparison.json, and overlay.png where it can be drawn, into a directory; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        from bender_loop.shell.files import prepare_directory, write_atomically, write_result
        from bender_report.drawing import can_draw

        picture = self.picture() if can_draw() else None
        out = prepare_directory(Path(folder))
        write_result(out / "comparison.json", self.to_dict())
        if picture is not None:
            write_atomically(out / "overlay.png", picture)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw measured, simulated and recalibrated readings; return the axes drawn into."""
        drawn = axes_or_new(axes)
        drawn.plot(self.axis, self.record.displacement_um, ".", ms=2.5, color=light("measured"), label="measured")
        drawn.plot(self.axis, self.simulated_um, lw=1.0, color=light("given"), label="as given")
        drawn.plot(self.axis, self.recalibrated_um, lw=1.0, color=light("without"), label="recalibrated")
        drawn.set(
            xlabel=self.axis_label,
            ylabel=f"reading ({unit_text(self.record.record.quantities.reading)})",
            title=f"{self.record.name}, {self.subject}",
        )
        drawn.legend(frameon=False)
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the content of comparison.json."""
        return {
            "record": self.record.source,
            "model": self.model,
            "fmu": self.fmu,
            "start_values": dict(self.parameters),
            "input_hold": self.input_hold,
            "start": self.replayed.start,
            "unit": self.record.record.quantities.reading,
            **_with_rms(asdict(self.comparison), self.record.record.quantities.reading),
            "question": self.comparison.question,
            "remark": self.remark,
        }

    def to_frame(self) -> "DataFrame":
        """Return one row for each reading (needs pandas)."""
        return frame_of(
            {
                "time_s": self.record.time_s,
                "acting_V": self.replayed.acting_V,
                "measured_um": self.record.displacement_um,
                "simulated_um": self.simulated_um,
                "recalibrated_um": self.recalibrated_um,
            }
        )

    def __repr__(self) -> str:
        x, unit = self.comparison, unit_text(self.record.record.quantities.reading)
        return (
            f"<RecordComparison {self.record.name} and {self.subject}: {x.before.rms_um:.3g} {unit} rms, "
            f"{x.recalibrated.rms_um:.3g} recalibrated>"
        )

    def _repr_html_(self) -> str:
        unit = unit_text(self.record.record.quantities.reading)
        stages = {"as given": self.comparison.before, "recalibrated": self.comparison.recalibrated}
        rows = [(name, x.rms_um, x.nrmse_percent, x.fit_percent) for name, x in stages.items()]
        return html_table(
            f"{self.record.name} and {self.subject}", ("model", f"rms ({unit})", "NRMSE %", "fit %"), rows
        )


@name_arguments_in_errors
def compare(
    record: "Source",
    model: AnyModel | None = None,
    *,
    fmu: Path | str | None = None,
    input_name: str | None = None,
    output_name: str | None = None,
    input_hold: str = "hold",
    untimed: bool = False,
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    parameters: Mapping[str, float] | None = None,
    further: Mapping[str, str] | None = None,
    reading: str | None = None,
    progress: Steps = lambda _: None,
) -> RecordComparison:
    """Drive the FMU of a model, or any FMU, with the voltage of a record and compare the displacements.

    Args:
        record: a path, a DataFrame, a mapping of arrays, or from `load_record`.
        model: a built-in name, a model file, or from `load_model`; paper where neither it nor an FMU is named.
        fmu: any co-simulation FMU (FMI 2.0 or 3.0) instead of a model.
        input_name: the FMU's input, a voltage; None for the only one.
        output_name: its output, a displacement; None for the only one.
        input_hold: "hold", "linear" or "smooth": the voltage between two rows.
        untimed: each row is a settled pair of readings.
        columns: other names of the record's columns.
        units: of these columns.
        parameters: of the FMU, by name, in its own units.
        further: inputs of the FMU beside the command, and the columns that they follow.
        reading: the column of the output's readings, where it is not the displacement.
        progress: is told how many steps the plant has done.

    Raises:
        InputError: both an FMU and a model are named, or the record or the plant cannot be used.
        RunError: the plant failed.
    """
    if fmu is not None and model is not None:
        raise InputError("--fmu and --model both name a plant; give only one")
    given = file_or_model("paper" if model is None else model)
    one_of("input_hold", input_hold, ("hold", "linear", "smooth"))
    if further and fmu is None:
        raise InputError("--further-input: found without --fmu, expected with it: a model has one input")
    named = {} if fmu is None else variables_of(fmu, input_name, output_name)
    loaded = load_record(record, columns, units, further=further, reading=reading, variables=named)
    check_sizes(loaded.source, loaded.record, untimed)
    require_readings(loaded.displacement_um)
    if fmu is None and not untimed:
        check_work(loaded.source, float(np.ptp(loaded.time_s)), _longest_step_s(given), MOST_STEPS)
    quantities = loaded.record.quantities
    remark = ""
    if fmu is None:
        plant_model = _loaded(given)
        refuse_other_device(plant_model, loaded.source, quantities)
        of_model = in_units_of([loaded.record], plant_model.units, [loaded.source])[0]
        if plant_model.valid is not None:
            remark = plant_model.valid.left_by(of_model.voltage_V.tolist(), of_model.quantities.command)
        quantities = driven_in(quantities, plant_model.units)
    path, subject, name = _plant_fmu(given) if fmu is None else (Path(fmu), Path(fmu).name, None)
    names = (input_name, output_name)
    with _opened(path, fmu is not None, names, progress, parameters or {}, quantities) as plant:
        hold = cast(InputHold, input_hold)
        replayed = replay(plant, loaded.record, input_hold=hold, untimed=untimed)
    figures = compare_readings(loaded.displacement_um, replayed.simulated_um)
    foreign = None if fmu is None else str(fmu)
    return RecordComparison(
        loaded, subject, name, foreign, input_hold, untimed, replayed, figures, dict(parameters or {}), remark
    )


def _with_rms(figures: dict[str, Any], unit: str) -> dict[str, Any]:
    """Return figures with `rms` in the record's own unit; `rms_um` stays for micrometres."""
    for stage in ("before", "recalibrated"):
        rms = figures[stage]["rms_um"]
        figures[stage] |= {"rms": rms, "rms_um": rms if unit == MICROMETRE else None}
    return figures


class _CountingPlant:
    """An FMU that tells how many steps it has done."""

    def __init__(self, plant: "FmuPlant", progress: Steps) -> None:
        self._plant, self._progress, self._steps = plant, progress, 0
        self.reset, self.read, self.close = plant.reset, plant.read, plant.close

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance the FMU."""
        self._steps += 1
        self._progress(self._steps)
        return self._plant.step(voltage_V, step_s)


def _longest_step_s(model: str | Path | Model) -> float:
    """Return in which steps the plant is computed where the command rests."""
    from bender_plant.plant import sub_step_bounds_s

    return sub_step_bounds_s(_loaded(model))[1]


def _loaded(model: str | Path | Model) -> Model:
    return load_model(model).model


def _opened(
    path: Path,
    foreign: bool,
    names: tuple[str | None, str | None],
    progress: Steps,
    parameters: Mapping[str, float],
    quantities: Quantities,
) -> "WatchedPlant | _CountingPlant":
    """Our own FMU in this process, any other one in a process of its own that is watched."""
    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.fmu.process.watched import WatchedPlant

    if foreign:
        plant = WatchedPlant(path, input_name=names[0], output_name=names[1], tell=progress, quantities=quantities)
        return plant.with_parameters(parameters)
    plant = FmuPlant(path, input_name=names[0], output_name=names[1], parameters=parameters, quantities=quantities)
    return _CountingPlant(plant, progress)


def _plant_fmu(model: str | Path | Model) -> tuple[Path, str, str]:
    from bender_native.ready import ready_plant_fmu

    if isinstance(model, Model):
        return ready_plant_fmu(model), f"the model {model.name}", model.name
    return ready_plant_fmu(model), model_words(model), str(model)


def model_words(model: str | Path) -> str:
    """Return what a model of a name or a file is called: `the model mine`, or `diagnosis/model.toml`."""
    path = Path(model)
    return "/".join(path.parts[-2:]) if path.name == "model.toml" else f"the model {path.stem}"
