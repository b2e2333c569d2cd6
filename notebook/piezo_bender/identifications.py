"""Identification: a hysteresis model learned from records."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bender_identify.fitting.resimulation import quasi_static
from bender_identify.identification import identify as identify_experiments
from bender_identify.identification_result import Identification
from bender_identify.records.experiment import experiment_of
from bender_identify.report.figures import COLUMNS, figures, table
from bender_identify.report.files import contents, written_model
from bender_identify.settings import InputHold, Settings
from bender_loop.errors import InputError
from bender_report.palette import light
from piezo_bender.models import AnyModel, PlantModel, load_model
from piezo_bender.records import LoadedRecord, several
from piezo_bender.shared import (
    Progress,
    axes_or_new,
    frame_of,
    html_table,
    name_arguments_in_errors,
    one_of,
    shows_settings,
    silent,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IdentifiedModel:
    """A model learned from records, beside its rivals.

    Attributes:
        outcome: rows of the table, coefficients, what the records cannot tell.
        name: of the model.
    """

    outcome: Identification
    name: str

    @property
    def plant(self) -> PlantModel:
        """The learned model."""
        return PlantModel(written_model(self.outcome, self.name))

    @property
    def equation(self) -> str:
        """The learned equation."""
        return self.outcome.written.candidate.equation

    def save(self, folder: Path | str) -> Path:
        """Write the model file with its report, picture and figures into a directory; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        from bender_loop.shell.files import prepare_directory, write_atomically

        files = contents(self.outcome, self.name)
        out = prepare_directory(Path(folder))
        for name, content in files.items():
            write_atomically(out / name, content)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the held-out error of every model; return the axes drawn into."""
        drawn = axes_or_new(axes)
        rows = self.outcome.rows[::-1]
        colours = [light("with" if x is self.outcome.written else "given") for x in rows]
        drawn.barh([x.candidate.title for x in rows], [x.held_out.error_percent for x in rows], color=colours)
        drawn.axvline(self.outcome.floor_percent, color=light("muted"), lw=1.0)
        drawn.set(xlabel="held-out error (%)", title=f"{self.name}: {self.outcome.written.candidate.title}")
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as JSON has them."""
        return figures(self.outcome)

    def to_frame(self) -> "DataFrame":
        """Return one row for each model (needs pandas)."""
        rows = table(self.outcome)
        return frame_of({name: [row[k] for row in rows] for k, name in enumerate(COLUMNS)})

    def __repr__(self) -> str:
        x = self.outcome.written
        return f"<IdentifiedModel {x.candidate.title}: held-out error {x.held_out.error_percent:.3g} %>"

    def _repr_html_(self) -> str:
        return html_table("re-simulated displacement (* is written)", COLUMNS, table(self.outcome))


@shows_settings(Settings)
@name_arguments_in_errors
def identify(
    records: Any,
    model: AnyModel = "paper",
    *,
    held_out: Any = (),
    input_hold: str = "hold",
    untimed: bool = False,
    quasi_static_only: bool = False,
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    seed: int = 1,
    name: str = "model",
    progress: Progress = silent,
    **settings: Any,
) -> IdentifiedModel:
    """Learn a hysteresis model from records.

    Args:
        records: one record or several, each a path, a DataFrame, a mapping of arrays, or from `load_record`.
        model: gives supply, structure and sensor.
        held_out: records that are excluded from fits.
        input_hold: "hold", "linear" or "smooth": the voltage between two rows.
        untimed: each row is a settled pair.
        quasi_static_only: leave the structure of the model out.
        columns: other names of the records' columns.
        units: of these columns.
        seed: of the resampling.
        name: of the learned model.
        progress: is told what is being done.
        **settings: those of `bender_identify.settings.Settings`: library, terms, ensemble, ...

    Raises:
        InputError: a record or a setting cannot be used.
        RunError: no model that a model file can hold follows the records.
    """
    one_of("input_hold", input_hold, ("hold", "linear", "smooth"))
    if seed < 0:
        raise InputError(f"seed: found {seed}, expected 0 or more")
    wanted = _settings(settings)
    base = load_model(model).model
    fitted = several(records, columns, units)
    seen = several(held_out, columns, units) if not isinstance(held_out, list | tuple) or held_out else []
    _refuse_twice(fitted + seen)

    def ready(x: LoadedRecord) -> Any:
        return experiment_of(x.record, Path(x.source).name, wanted, cast(InputHold, input_hold), untimed)

    outcome = identify_experiments(
        [ready(x) for x in fitted],
        quasi_static(base) if quasi_static_only else base,
        wanted,
        np.random.default_rng(seed),
        [ready(x) for x in seen],
        progress,
    )
    return IdentifiedModel(outcome, name)


def _settings(given: dict[str, Any]) -> Settings:
    known = [x.name for x in fields(Settings)]
    for name in given:
        if name not in known:
            raise InputError(f"{name}: no such setting of an identification, expected one of {', '.join(known)}")
    try:
        return Settings(**given)
    except ValueError as error:
        raise InputError(str(error)) from None


def _refuse_twice(records: list[LoadedRecord]) -> None:
    for k, record in enumerate(records):
        if any(np.array_equal(record.displacement_um, x.displacement_um, equal_nan=True) for x in records[:k]):
            raise InputError(
                f"{record.source}: named twice, expected each record once: held-out rows must not be fitted"
            )
