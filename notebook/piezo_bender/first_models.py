"""First models: gain, delay, lags and modes from records alone."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from bender_identify.first_model.choice import FirstModel
from bender_identify.first_model.course import experiments_of
from bender_identify.first_model.learned import learn
from bender_identify.first_model.report import choice_sentence, facts, sentences, table
from bender_identify.first_model.report import columns as table_columns
from bender_identify.first_model.structures import TEMPLATES
from bender_identify.settings import InputHold
from bender_loop.records.common_units import in_units_of
from bender_loop.tables.quantities import Quantities
from bender_report.palette import light
from bender_report.wording import unit_text
from piezo_bender.models import PlantModel, build_fmu
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
class FittedModel:
    """The simplest structure that records support.

    Attributes:
        outcome: every structure that was tried, the chosen one with standard deviations.
        records: what it was fitted to.
        quantities: units of the command and of the reading.
        name: of the model.
        model: for `diagnose`, `tune`, `build_fmu` and `simulate`.
    """

    outcome: FirstModel
    records: tuple[LoadedRecord, ...]
    quantities: Quantities
    name: str
    model: PlantModel

    @property
    def plant(self) -> PlantModel:
        """The same as `model`."""
        return self.model

    def save(self, folder: Path | str) -> Path:
        """Write model.toml, model.fmu and model.json into a directory; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        from bender_loop.shell.files import write_atomically, write_result

        fmu = build_fmu(self.plant).content
        out = self.plant.save(folder)
        write_atomically(out / "model.fmu", fmu)
        write_result(out / "model.json", self.to_dict())
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the first record and what the model makes of its command; return the axes drawn into."""
        record = self.records[0]
        simulated = self.plant.simulate(record.time_s, record.voltage_V)
        drawn = axes_or_new(axes)
        drawn.plot(record.time_s, record.displacement_um, ".", ms=2.5, color=light("measured"), label="measured")
        drawn.plot(record.time_s, simulated, lw=1.0, color=light("with"), label=self.outcome.chosen.structure.name)
        drawn.set(xlabel="time (s)", ylabel=f"reading ({unit_text(self.quantities.reading)})", title=self.name)
        drawn.legend(frameon=False)
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the content of model.json: structure, numbers with intervals, what was tried."""
        return facts(self.outcome, self.quantities)

    def to_frame(self) -> "DataFrame":
        """Return one row for each number of the model: name, value, unit, std, low_95, high_95 (needs pandas)."""
        told = self.to_dict()
        offsets = [
            {"name": f"offset of {x['name']}", "value": y, "unit": told["unit"], "std": None, "interval": None}
            for x, y in zip(told["records"], told["offsets"], strict=True)
        ]
        return interval_frame([*told["numbers"], *offsets], ("name", "value", "unit", "std"), "interval")

    def __repr__(self) -> str:
        told = [*sentences(self.outcome, self.quantities), choice_sentence(self.outcome)]
        return f"<FittedModel {self.outcome.chosen.structure.name}: {'; '.join(filter(None, told))}>"

    def _repr_html_(self) -> str:
        return html_table(self.name, table_columns(self.quantities), table(self.outcome))


@name_arguments_in_errors
def fit_model(
    records: Any,
    *,
    template: str = "auto",
    input_hold: str = "auto",
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    name: str = "",
    progress: Progress = silent,
) -> FittedModel:
    """Fit structures up to the fourth order to records and return the simplest one that they support.

    Args:
        records: one record or several of one device, each a path, a DataFrame, a mapping of arrays, or from
            `load_record`.
        template: "auto", or the structure to fit.
        input_hold: "hold", "linear" or "smooth": the command between two rows; "auto" where the records are to tell.
        columns: other names of the records' columns.
        units: of these columns.
        name: of the device; that of the first record unless given.
        progress: is told what is being fitted.

    Raises:
        InputError: a record or an argument cannot be used, or no structure follows the records.
    """
    one_of("template", template, ("auto", *TEMPLATES))
    one_of("input_hold", input_hold, ("auto", "hold", "linear", "smooth"))
    loaded = several(records, columns, units)
    own = in_units_of([x.record for x in loaded], None, [x.source for x in loaded])
    hold = cast(InputHold | Literal["auto"], input_hold)
    experiments = experiments_of(own, [x.name for x in loaded], hold)
    named, quantities = name or Path(loaded[0].name).stem, own[0].quantities
    only = None if template == "auto" else TEMPLATES[template]
    found, model = learn(experiments, named, quantities, progress, only)
    kept = tuple(LoadedRecord(x, y.source) for x, y in zip(own, loaded, strict=True))
    return FittedModel(found, kept, quantities, named, PlantModel(model))
