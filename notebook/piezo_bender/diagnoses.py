"""Diagnosis: which effect a model lacks."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from bender_discrepancy.conclusion.diagnosis_json import MODEL
from bender_discrepancy.diagnosis import Diagnosis as DiagnosisOfRecords
from bender_discrepancy.foreign.diagnose import diagnose_fmu as diagnose_records_of_fmu
from bender_discrepancy.workflow import diagnose as diagnose_records
from bender_inference.settings import Beginning, Settings
from bender_inference.structures import AUTO
from bender_loop.errors import InputError
from bender_loop.records.variables import variables_of
from piezo_bender.models import AnyModel, PlantModel, load_model
from piezo_bender.records import several
from piezo_bender.shared import Progress, name_arguments_in_errors, one_of, require_number, share_of, silent

if TYPE_CHECKING:
    from piezo_bender.records import Source


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(DiagnosisOfRecords):
    """What is missing from a model, on what evidence, and the corrected model as `load_model` gives one."""

    @property
    def model(self) -> PlantModel:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The corrected model, for `tune`, `compare`, `build_fmu` and `simulate`."""
        return PlantModel(self.findings.model)


def as_result(found: DiagnosisOfRecords) -> Diagnosis:
    """Return a diagnosis as the result of a notebook."""
    return Diagnosis(**{x.name: getattr(found, x.name) for x in fields(found)})


@contextmanager
def as_saved(model: AnyModel | None) -> Iterator[AnyModel | None]:
    """Give the file of a diagnosis' model, with what its records leave open beside it; any other model as it is."""
    if not isinstance(model, Diagnosis) or model.stand_in is not None:
        yield model
        return
    with TemporaryDirectory() as folder:
        model.write(Path(folder), report=False)
        file = Path(folder) / MODEL
        yield file if file.exists() else model


@name_arguments_in_errors
def diagnose(
    records: "Source | list[Any] | tuple[Any, ...]",
    model: AnyModel | None = None,
    *,
    fmu: str | Path | None = None,
    input_name: str | None = None,
    output_name: str | None = None,
    parameters: Mapping[str, float] | None = None,
    suspects: Sequence[str] = (),
    input_hold: str = "auto",
    untimed: bool = False,
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    highest_V: float | None = None,
    start: Beginning = "auto",
    confidence: float = 0.99,
    relevant: float | str = 0.005,
    further: Mapping[str, str] | None = None,
    reading: str | None = None,
    with_record_effects: bool = False,
    same_zero: bool = False,
    progress: Progress = silent,
) -> Diagnosis:
    """Find the disagreement between a model and records of one bench, name what is missing, correct the model.

    Args:
        records: one record or several, each a path, a DataFrame, a mapping of arrays, or from `load_record`.
        model: a built-in name, a model file, or from `load_model`; "paper" unless given; "auto" for a device without
            one: linear structures compete with the effects.
        fmu: a co-simulation FMU instead of a model; it runs in a process of its own.
        input_name: the variable of the FMU that takes the voltage, where it has several.
        output_name: the variable that is read.
        parameters: of the FMU, by name, in its own units.
        suspects: parameters of the FMU that may be off, as "NAME" or "NAME=LOW:HIGH"; they compete with effects.
        input_hold: "hold" (a supply), "linear" (a function generator) or "smooth": the voltage between two rows;
            "auto" for held, unless the records fit another far better.
        untimed: time is only an order.
        columns: other names of the columns of files and tables.
        units: of these columns.
        highest_V: that the next experiment may ask for; None for no more than the records reached.
        start: how the records begin: from "rest", in "motion", or "auto", as the readings say.
        confidence: one minus the error rate of what is said.
        relevant: share of the stroke; 0.005 or "0.5%"; a residual that is smaller makes no verdict by itself.
        further: inputs of the FMU beside the command, and the columns that they follow.
        reading: the column of the output's readings, where it is not the displacement.
        with_record_effects: the corrected model also has what belongs to the records: drift, ageing, hum.
        same_zero: the sensor was not zeroed between the records: one offset holds for all of them.
        progress: is told what is being done.

    Raises:
        InputError: the model or a record will not do.
        RunError: the corrected FMU could not be driven.
        KeyboardInterrupt: by the user.
    """
    one_of("input_hold", input_hold, ("auto", "hold", "linear", "smooth"))
    one_of("start", start, ("auto", "rest", "motion"))
    require_number("confidence", confidence)
    if highest_V is not None:
        require_number("highest_V", highest_V, "voltage")
    only_of_an_fmu = {
        "suspects": suspects,
        "parameters": parameters,
        "input_name": input_name,
        "output_name": output_name,
    }
    for name, given in only_of_an_fmu.items():
        if given and fmu is None:
            raise InputError(f"{name}: found without fmu, expected with it")
    settings = Settings(
        untimed=untimed,
        highest_V=highest_V,
        start=start,
        confidence=confidence,
        with_record_effects=with_record_effects,
        relevant=share_of("relevant", relevant),
        same_zero=same_zero,
    ).between_rows(input_hold)
    if fmu is not None and model is not None:
        raise InputError("--fmu and --model both name a model; give only one")
    base = None if isinstance(model, str) and model == AUTO else load_model("paper" if model is None else model).model
    if further and fmu is None:
        raise InputError("--further-input: found without --fmu, expected with it: a model has one input")
    named = {} if fmu is None else variables_of(fmu, input_name, output_name)
    loaded = several(records, columns, units, further, reading, named)
    sources = [x.source for x in loaded]
    if fmu is not None:
        own = [x.record for x in loaded]
        names = (input_name, output_name)
        return as_result(diagnose_records_of_fmu(fmu, *names, own, settings, progress, sources, parameters, suspects))
    return as_result(diagnose_records(base, [x.record for x in loaded], settings, progress, sources))
