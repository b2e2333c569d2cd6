"""A diagnosis: the one frozen object that the command, the benchmark, the demonstration and the notebook share."""

import html
import json
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_discrepancy.conclusion.contenders import OPEN_VERDICTS
from bender_discrepancy.conclusion.diagnosis_json import FMU, MODEL, in_own_units, is_written, outcome
from bender_discrepancy.conclusion.findings import OF_THE_READING, Findings, RecalibratedNumber, ReportedEffect
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.conclusion.sentences import title_of
from bender_discrepancy.conclusion.smallest_visible import Smallest
from bender_discrepancy.output_folder import all_or_no_files
from bender_discrepancy.pickling import pickle_with_closures
from bender_discrepancy.report.effect_sections import driven_V
from bender_discrepancy.report.loop_and_creep import figures_of
from bender_discrepancy.rivals import RIVAL_FILES, RivalModel, rival_models
from bender_effects.catalogue import EFFECTS
from bender_effects.rigs import is_piezo_bender
from bender_export.documentation import origin_page
from bender_export.origin import REPORT as REPORT_IN_FMU
from bender_export.origin import with_documents
from bender_inference.equation.lead import Lead
from bender_inference.experiment.proposal import PROFILE, Proposal
from bender_inference.records.stand_in import StandIn
from bender_inference.witnesses.missing_columns import MissingColumn, missing_columns
from bender_loop.shell.files import result_text
from bender_loop.tables.quantities import USUAL, Quantities
from bender_plant.model import Model
from bender_report.wording import shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

    from bender_discrepancy.report.chart_process import ChartProcess

REPORT, DIAGNOSIS = "report.html", "diagnosis.json"
FILES = (REPORT, DIAGNOSIS, MODEL, FMU, PROFILE, "model.ssp", "model.ssv", *RIVAL_FILES)
"""All that a diagnosis may write."""


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What is missing from a model, on what evidence, and the corrected model.

    Attributes:
        findings: what the records show, from which the properties below are read.
        gap: measured minus simulated at its three stages, the last one measured by driving the corrected FMU.
        next_experiment: what would separate the rivals of an ambiguous verdict; None for any other.
        lead: a sparse equation for an unexplained remainder, or why there is none; None where none was sought.
        names: of the records, or their files.
        fmu: the corrected plant, the content of an FMU; written unless `gap.is_worse` or `findings.is_another_device`.
        smallest_visible: by effect, the smallest size that the records would have shown.
        stand_in: what stood in for an FMU that was given as the model; None for a model of this project.
        quantities: units of what is commanded and read; where they are not V and um, numbers here are in them.
        beside: further files of the corrected plant by name: of an FMU, its system (SSP) and its parameters (SSV).
    """

    findings: Findings
    gap: Measured
    next_experiment: Proposal | None
    lead: Lead | None
    names: tuple[str, ...]
    fmu: bytes = field(repr=False)
    smallest_visible: Mapping[str, Smallest] = field(default_factory=dict, repr=False)
    stand_in: StandIn | None = None
    beside: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    quantities: Quantities = USUAL

    @property
    def verdict(self) -> str:
        """The final verdict: named, likely, no_gap, recalibrated, ambiguous or unexplained."""
        return self.findings.verdict

    @property
    def is_complete(self) -> bool:
        """Whether nothing above the noise stays unexplained."""
        return self.findings.complete

    @property
    def reason(self) -> str:
        """Why the verdict stands."""
        return self._outcome["reason"]

    @property
    def sentence(self) -> str:
        """The verdict in a sentence."""
        return self._outcome["sentence"]

    @property
    def effects(self) -> tuple[ReportedEffect, ...]:
        """Effects with their numbers and intervals, in the order of adding; rivals of an ambiguous verdict last."""
        return self.findings.effects

    @property
    def added(self) -> tuple[ReportedEffect, ...]:
        """The effects that are in the corrected model."""
        return self.findings.added

    @property
    def recalibrated(self) -> tuple[RecalibratedNumber, ...]:
        """What changed of gain and offset of the reading."""
        return self.findings.recalibrated

    @property
    def model(self) -> Model:
        """The corrected model."""
        return self.findings.model

    @cached_property
    def rival_models(self) -> tuple[RivalModel, ...]:
        """What the device may be instead of the corrected model; none around an FMU that was given as the model."""
        if self.stand_in is not None or not is_written(self.findings, self.gap):
            return ()
        return rival_models(self.findings)

    @cached_property
    def _outcome(self) -> dict[str, Any]:
        with shown_in(*self.quantities[:2]):
            told = outcome(
                self.findings, self.gap, self.names, self.next_experiment, self.lead, self._missing_columns()
            )
            volts, model = driven_V(self.findings), self.findings.model
            # behind the effects an equation without a name may stand
            for entry, x in zip(told["effects"], self.findings.effects, strict=False):
                entry["in_figures"] = figures_of(x.id, x.form, x.numbers, volts, model)
            told["rival_models"] = [x.to_dict() for x in self.rival_models]
            told["smallest_visible"] = {name: x.to_dict() for name, x in self.smallest_visible.items()}
            if self.stand_in is not None:
                warnings = [*self.stand_in.sentences(), *told["warnings"]]
                told |= {"warnings": warnings, "foreign_model": self.stand_in.to_dict()}
                suspected = self.stand_in.suspected
                open_ = suspected.ambiguity([title_of(x.id) for x in self.added]) if suspected else ""
                told["sentence"] = open_ or told["sentence"]
            return in_own_units(told, self.quantities)

    def _missing_columns(self) -> tuple[MissingColumn, ...]:
        search = self.findings.search
        if self.verdict not in OPEN_VERDICTS or search.settings.untimed or self.quantities[:2] != USUAL[:2]:
            return ()
        open_effects = [frozenset(x.hypothesis.effects) for x in self.findings.leaders]
        if search.grades.commuting:
            open_effects = [frozenset({x.id}) for x in search.grades.effects if EFFECTS[x.id].same_on_other_side]
        return missing_columns(open_effects, search.records, is_film=is_piezo_bender(search.base))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `diagnosis.json` but for its provenance; every number in it is finite or None."""
        return json.loads(json.dumps(self._outcome, allow_nan=False))

    def to_json(self) -> str:
        """Return `diagnosis.json`."""
        return result_text(self._outcome)

    def to_frame(self) -> "DataFrame":
        """Return the numbers of the effects and all that changed of the model itself, one row each (needs pandas).

        Columns: effect ("recalibrated" for the model's own numbers, also where they changed by less than the records
        leave open), stage, in_model, parameter, value, before, std,
        low_95, high_95, unit, share_of_gap, grade, probability. What is not known, or does not apply, is NaN or empty.
        """
        import pandas as pd

        added = {x.id for x in self.added}
        rows: list[dict[str, Any]] = []
        for x in self._outcome["effects"]:
            about = {"effect": x["id"], "stage": x["stage"], "in_model": x["id"] in added}
            sure = {"share_of_gap": x["share_of_gap"], "grade": x["grade"], "probability": x["probability"]}
            for name, p in x["parameters"].items() or [("", {})]:
                rows.append(about | {"parameter": name} | _cells(p) | sure)
        unit = self._outcome["unit"]
        for x in self.findings.changed:
            about = {"effect": "recalibrated", "stage": "", "in_model": True, "parameter": x.name}
            told = {
                "value": x.after,
                "before": x.before,
                "std": x.std if x.interval_95 else None,
                "interval_95": x.interval_95,
            }
            is_length = x.name in OF_THE_READING and x.unit == "um"
            rows.append(about | _cells(told | {"unit": unit if is_length else x.unit}))
        numbers = ["value", "before", "std", "low_95", "high_95", "share_of_gap", "probability"]
        columns = pd.Index([*_WHAT, *numbers[:5], "unit", "share_of_gap", "grade", "probability"])
        return pd.DataFrame(rows, columns=columns).astype(dict.fromkeys(numbers, float)).fillna({"grade": ""})

    def report(self, chart_process: "ChartProcess | None" = None) -> str:
        """Return the report, one HTML page that needs nothing beside it; a chart process draws some of its charts."""
        from bender_discrepancy.report.page import report_page

        with shown_in(*self.quantities[:2]):
            return report_page(self.findings, self.gap, self._outcome, self.lead, chart_process)

    def summary(self, out: Path) -> Sequence[str]:
        """Return the lines for a terminal, of a diagnosis that was saved in a directory."""
        from bender_discrepancy.report.summary import summary

        with shown_in(*self.quantities[:2]):
            return list(summary(self.findings, self.gap, self._outcome, out))

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the record with the largest gap, measured, recalibrated and corrected; return the axes drawn into."""
        from bender_discrepancy.report.record_plot import draw_record

        with shown_in(*self.quantities[:2]):
            return draw_record(self.findings, self.gap, self.names, axes)

    def save(self, folder: Path | str) -> Path:
        """Write diagnosis.json, model.toml, model.fmu, report.html and a proposed profile.csv, all of them or none.

        Models that the records leave open beside the corrected one are written as rival-N.toml and rival-N.fmu.

        A corrected model is left out that is worse than the recalibrated one on held-out readings, or where
        the records look like those of another device.

        Returns:
            The directory.

        Raises:
            InputError: the directory cannot be written.
        """
        out = Path(folder)
        with all_or_no_files(out) as stage:
            self.write(stage)
        return out

    def write(self, folder: Path, report: bool = True, chart_process: "ChartProcess | None" = None) -> None:
        """Write the files of `save` into a directory that is there, one after the other."""
        import tomli_w

        from bender_loop.shell.files import write_atomically

        page, told = self.report(chart_process) if report else "", dict(self._outcome)
        if page:
            write_atomically(folder / REPORT, page)
        if is_written(self.findings, self.gap):
            write_atomically(folder / FMU, with_documents(self.fmu, self._documents(page)))
            for name, data in self.beside.items():
                write_atomically(folder / name, data)
            write_atomically(folder / MODEL, tomli_w.dumps(self.findings.model.to_table()))
            for rival in self.rival_models:
                model, fmu = rival.files
                write_atomically(folder / model, tomli_w.dumps(rival.model.to_table()))
                write_atomically(folder / fmu, rival.fmu())
        if self.next_experiment is not None and self.next_experiment.tells_apart:
            write_atomically(folder / PROFILE, self.next_experiment.to_csv(self.quantities.command))
        told["sha256"] = {x: sha256((folder / x).read_bytes()).hexdigest() for x in (told["model"], told["fmu"]) if x}
        write_atomically(folder / DIAGNOSIS, result_text(told))

    def _documents(self, page: str) -> dict[str, bytes]:
        """Return what goes into the corrected FMU beside its code: the report, and where the correction comes from."""
        if not page:
            return {}
        found = {REPORT_IN_FMU: page.encode()}
        model = self.findings.model
        if self.stand_in is not None and model.origin is not None:
            text = f"{self.sentence} The original stands in it as it was, with the correction around it."
            found["documentation/index.html"] = origin_page("Corrected FMU", text, model)
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (type(self), pickle_with_closures({x.name: getattr(self, x.name) for x in fields(self)}))

    def __repr__(self) -> str:
        from bender_report.wording import figure, unit_text

        before, after = self.gap.recalibrated.rms_um, self.gap.after.rms_um
        added = {x.id for x in self.added}
        found = ", ".join(f"{x.id} ({x.probability:.2f})" for x in self.added) or "no effects"
        rivals = ", ".join(dict.fromkeys(x.id for x in self.effects if x.id not in added))
        found += f"; rivals {rivals}" if rivals else ""
        unit = unit_text(self.quantities.reading)
        return f"<Diagnosis {self.verdict}: {found}; gap {figure(before)} to {figure(after)} {unit} rms>"

    def _repr_html_(self) -> str:
        from bender_report.wording import quantity

        gap = self.gap
        stages = {
            "as given": gap.before.rms_um,
            "recalibrated": gap.recalibrated.rms_um,
            "corrected": gap.after.rms_um,
            "noise floor": gap.floor_um,
        }
        cells = "".join(
            f"<tr><td>{k}</td><td>{quantity(v, self.quantities.reading)}</td></tr>" for k, v in stages.items()
        )
        effects = "".join(
            f"<li><b>{html.escape(x['id'])}</b>: {html.escape(x['evidence'])}</li>" for x in self._outcome["effects"]
        )
        return (
            f"<p><b>{html.escape(self.verdict)}</b>: {html.escape(self.sentence)}</p>"
            f"<table><caption>gap, rms on held-out readings</caption>{cells}</table><ul>{effects}</ul>"
        )


_WHAT = ("effect", "stage", "in_model", "parameter")


def _cells(parameter: Mapping[str, Any]) -> dict[str, Any]:
    """Return a number as a row of a table has it."""
    low, high = parameter.get("interval_95") or (None, None)
    plain = {key: parameter.get(key) for key in ("value", "before", "std")}
    return {**plain, "low_95": low, "high_95": high, "unit": parameter.get("unit", "")}


def _unpickled(kind: type[Diagnosis], data: bytes) -> Diagnosis:
    return kind(**pickle.loads(data))
