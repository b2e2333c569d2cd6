"""Calibration of an FMU: its own parameters fitted to records."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from bender_discrepancy.foreign.calibrate_command import RESULT, facts
from bender_discrepancy.foreign.calibration import Calibrated, calibrate_fmu
from bender_loop.errors import InputError
from bender_loop.records.common_units import in_units_of
from bender_loop.records.drive import InputHold
from bender_loop.records.variables import variables_of
from bender_report.palette import light
from bender_report.wording import unit_text
from piezo_bender.records import LoadedRecord, several
from piezo_bender.shared import (
    Progress,
    axes_or_new,
    html_table,
    interval_frame,
    name_arguments_in_errors,
    one_of,
    silent,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CalibratedFmu:
    """Values of the parameters of an FMU, with intervals.

    Attributes:
        outcome: what the records say of each parameter, and the readings before and after.
        fmu: its file.
        records: what it was fitted to.
    """

    outcome: Calibrated
    fmu: Path
    records: tuple[LoadedRecord, ...]

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by name, as `parameters` of `compare`, `tune` and `diagnose` takes them."""
        return self.outcome.values()

    def save(self, folder: Path | str) -> Path:
        """Write calibration.json and parameters.ssv into a directory; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        from bender_export.system import parameter_file
        from bender_loop.shell.files import prepare_directory, write_atomically, write_result

        out = prepare_directory(Path(folder))
        write_result(out / RESULT, self.to_dict())
        write_atomically(out / "parameters.ssv", parameter_file("calibrated", {"": self.values}))
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the first record beside the FMU as given and calibrated; return the axes drawn into."""
        record, x = self.records[0], self.outcome
        drawn = axes_or_new(axes)
        drawn.plot(record.time_s, record.displacement_um, ".", ms=2.5, color=light("measured"), label="measured")
        drawn.plot(record.time_s, x.before_um[0], lw=1.0, color=light("given"), label="as given")
        drawn.plot(record.time_s, x.readings_um[0], lw=1.0, color=light("with"), label="calibrated")
        reading = unit_text(record.record.quantities.reading)
        drawn.set(xlabel="time (s)", ylabel=f"reading ({reading})", title=f"{record.name}, {self.fmu.name}")
        drawn.legend(frameon=False)
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the content of calibration.json."""
        return facts(self.outcome, self.fmu, self.records[0].record.quantities)

    def to_frame(self) -> "DataFrame":
        """Return one row for each parameter that was fitted (needs pandas)."""
        rows = [{"name": name, **row} for name, row in self.to_dict()["parameters"].items()]
        keys = ("name", "before", "after", "unit", "std", "is_off", "at_the_end_of_its_range")
        return interval_frame(rows, keys, "interval_95")

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name} {value:.4g}" for name, value in self.values.items())
        return f"<CalibratedFmu {self.fmu.name}: {numbers or 'nothing that the records show'}>"

    def _repr_html_(self) -> str:
        rows = [(x.suspect.name, x.suspect.given, x.value, x.std) for x in self.outcome.parameters]
        return html_table(self.fmu.name, ("parameter", "as given", "calibrated", "std"), rows)


@name_arguments_in_errors
def calibrate(
    records: Any,
    fmu: Path | str,
    suspects: Sequence[str],
    *,
    input_name: str | None = None,
    output_name: str | None = None,
    parameters: Mapping[str, float] | None = None,
    input_hold: str = "hold",
    untimed: bool = False,
    free_reading: bool = False,
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    further: Mapping[str, str] | None = None,
    reading: str | None = None,
    progress: Progress = silent,
) -> CalibratedFmu:
    """Fit parameters of an FMU to records of the device.

    Args:
        records: one record or several, each a path, a DataFrame, a mapping of arrays, or from `load_record`.
        fmu: a co-simulation FMU (FMI 2.0 or 3.0); it runs in a process of its own.
        suspects: "NAME", "NAME=LOW:HIGH", or "tunable" for all that the FMU declares tunable.
        input_name: the FMU's input; None for the only one.
        output_name: its output; None for the only one.
        parameters: start values of others, by name.
        input_hold: "hold", "linear" or "smooth": the command between two rows.
        untimed: times are only an order.
        free_reading: gain and offset of the reading are free beside the parameters.
        columns: other names of the records' columns.
        units: of these columns.
        further: inputs of the FMU beside the command, and the columns that they follow.
        reading: the column of the output's readings, where it is not the displacement.
        progress: is told what is being done.

    Raises:
        InputError: a record, the FMU or an argument cannot be used.
        RunError: the FMU fails, crashes or hangs.
    """
    one_of("input_hold", input_hold, ("hold", "linear", "smooth"))
    if not suspects:
        raise InputError("suspects: found none, expected the name of a parameter, or 'tunable'")
    path = Path(fmu)
    named = variables_of(path, input_name, output_name)
    loaded = several(records, columns, units, further, reading, named)
    own = in_units_of([x.record for x in loaded], None, [x.source for x in loaded])
    found = calibrate_fmu(
        path,
        own,
        [suspects] if isinstance(suspects, str) else list(suspects),
        names=[x.source for x in loaded],
        input_name=input_name,
        output_name=output_name,
        parameters=parameters,
        input_hold=cast(InputHold, input_hold),
        untimed=untimed,
        free_reading=free_reading,
        tell=lambda runs: progress(f"driving the FMU, {runs} times"),
    )
    return CalibratedFmu(found, path, tuple(LoadedRecord(x, y.source) for x, y in zip(own, loaded, strict=True)))
