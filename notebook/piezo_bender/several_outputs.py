"""Diagnosis of several outputs of one FMU: each by itself, and what they say together."""

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from bender_discrepancy.foreign.outputs import Together
from bender_discrepancy.foreign.outputs import diagnose_outputs as diagnose_records
from bender_discrepancy.foreign.outputs_report import content, folders_of, joint_numbers, sentence, write
from bender_discrepancy.output_folder import all_or_no_files
from bender_discrepancy.pickling import pickle_with_closures
from bender_inference.settings import Beginning, Settings
from bender_loop.errors import InputError
from bender_loop.records.variables import variables_of
from bender_report.drawing import require_drawing
from bender_report.wording import quantity
from piezo_bender.diagnoses import Diagnosis, as_result
from piezo_bender.records import several
from piezo_bender.shared import Progress, html_table, name_arguments_in_errors, one_of, share_of, silent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OutputsDiagnosis:
    """What several outputs say of one FMU.

    Attributes:
        outcome: the diagnosis of each output, the ways that were weighed, the corrected FMU of all of them.
    """

    outcome: Together

    @property
    def verdict(self) -> str:
        """The word for all outputs together."""
        return self.outcome.verdict

    @property
    def sentence(self) -> str:
        """The verdict in a sentence."""
        return sentence(self.outcome)

    @property
    def by_itself(self) -> Mapping[str, Diagnosis]:
        """The diagnosis of each output, by its name."""
        return cast(Mapping[str, Diagnosis], self.outcome.by_itself)

    def save(self, folder: Path | str) -> Path:
        """Write a folder for each output, outputs.json, report.html and the corrected FMU of all; return the directory.

        Raises:
            InputError: the directory cannot be written.
        """
        out, folders = Path(folder), folders_of(list(self.by_itself))
        with all_or_no_files(out) as stage:
            for name, diagnosis in self.by_itself.items():
                (stage / folders[name]).mkdir()
                diagnosis.write(stage / folders[name])
            write(self.outcome, folders, stage)
        return out

    def plot(self, axes: "Sequence[Axes] | None" = None) -> "Sequence[Axes]":
        """Draw every output, measured, recalibrated and corrected, one below the other; return the axes drawn into."""
        if axes is None:
            require_drawing("plot")
            from matplotlib import pyplot

            count = len(self.by_itself)
            axes = list(pyplot.subplots(count, 1, figsize=(9.0, 3.5 * count), layout="constrained")[1])
        for panel, (name, diagnosis) in zip(axes, self.by_itself.items(), strict=True):
            diagnosis.plot(panel)
            panel.set_title("")
            panel.set_title(f"{name}: {diagnosis.sentence}", fontsize=9, loc="left")
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return the content of outputs.json."""
        return content(self.outcome, folders_of(list(self.by_itself)))

    def to_frame(self) -> "DataFrame":
        """Return the numbers of the effects of every output, one row each (needs pandas).

        What only all outputs together put on one of them has the grade `together`.
        """
        import pandas as pd

        frames = {}
        for name, x in self.by_itself.items():
            joint = [
                {"effect": effect, "parameter": n.name, "value": n.value, "unit": n.unit, "in_model": True,
                 "grade": "together"}
                for effect, n in joint_numbers(self.outcome, name)
            ]  # fmt: skip
            frames[name] = pd.concat([y for y in (pd.DataFrame(joint), x.to_frame()) if len(y)] or [x.to_frame()])
        return pd.concat(frames, names=["output"]).reset_index(level="output").reset_index(drop=True)

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (pickle_with_closures(self.outcome),)

    def __repr__(self) -> str:
        return f"<OutputsDiagnosis {self.verdict}: {self.sentence}>"

    def _repr_html_(self) -> str:
        rows = []
        for name, x in self.by_itself.items():
            unit, gap = x.quantities.reading, x.gap
            together = self.outcome.after.get(name)
            figures = (gap.recalibrated.rms_um, gap.after.rms_um, together, gap.floor_um)
            told = ("–" if y is None else quantity(y, unit) for y in figures)
            rows.append((name, x.verdict, ", ".join(y.id for y in x.added) or "nothing", *told))
        columns = ("output", "verdict", "missing", "recalibrated", "by itself", "together", "noise")
        return html_table(self.sentence, columns, rows)


def _unpickled(outcome: bytes) -> OutputsDiagnosis:
    return OutputsDiagnosis(pickle.loads(outcome))


@name_arguments_in_errors
def diagnose_outputs(
    records: Any,
    fmu: str | Path,
    outputs: Mapping[str, str] | Sequence[str],
    *,
    input_name: str | None = None,
    further: Mapping[str, str] | None = None,
    parameters: Mapping[str, float] | None = None,
    suspects: Sequence[str] = (),
    input_hold: str = "auto",
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    start: Beginning = "auto",
    confidence: float = 0.99,
    relevant: float | str = 0.005,
    progress: Progress = silent,
) -> OutputsDiagnosis:
    """Diagnose several outputs of an FMU, each by itself and all together.

    Args:
        records: one table or several of one bench, each a path, a DataFrame or a mapping of arrays.
        fmu: a co-simulation FMU; it runs in a process of its own.
        outputs: variables of the FMU and the columns of their readings; names alone where both are called alike.
        input_name: the variable that takes the command, where the FMU has several inputs.
        further: inputs beside the command, and the columns that they follow.
        parameters: of the FMU, by name, in its own units.
        suspects: parameters of the FMU that may be off, as "NAME" or "NAME=LOW:HIGH": one value for all outputs.
        input_hold: "hold", "linear" or "smooth": the command between two rows; "auto" as in `diagnose`.
        columns: other names of time and command, as "time=t,voltage=P".
        units: of these columns.
        start: how the records begin: from "rest", in "motion", or "auto".
        confidence: one minus the error rate of what is said.
        relevant: share of the stroke; a residual that is smaller makes no verdict by itself.
        progress: is told what is being done.

    Raises:
        InputError: the FMU or a record will not do, or there are not two outputs.
        RunError: the FMU failed.
    """
    one_of("input_hold", input_hold, ("auto", "hold", "linear", "smooth"))
    one_of("start", start, ("auto", "rest", "motion"))
    read = dict(outputs) if isinstance(outputs, Mapping) else {x: x for x in outputs}
    if len(read) < 2:
        raise InputError(f"outputs: found {len(read)}, expected at least two; `diagnose` takes one (output_name)")
    settings = Settings(start=start, confidence=confidence, relevant=share_of("relevant", relevant)).between_rows(
        input_hold
    )
    loaded = {
        name: several(records, columns, units, further, column, variables_of(fmu, input_name, name))
        for name, column in read.items()
    }
    sources = [x.source for x in next(iter(loaded.values()))]
    own = {name: [x.record for x in found] for name, found in loaded.items()}
    found = diagnose_records(
        fmu,
        input_name,
        own,
        settings,
        progress,
        sources,
        parameters,
        suspects=[suspects] if isinstance(suspects, str) else list(suspects),
    )
    return OutputsDiagnosis(replace(found, by_itself={name: as_result(x) for name, x in found.by_itself.items()}))
