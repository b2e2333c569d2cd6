"""The diagnosis of a unit: what `bender diagnose` writes, and the rows made of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from bender_fleet.work.job import UnitResult
from bender_fleet.work.reading import Reading
from bender_plant.model import Model

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_inference.settings import Settings


@dataclass(frozen=True, slots=True)
class ForeignModel:
    """An FMU as the model: its file, input and output where they were named, parameters set, parameters suspected."""

    path: str
    input: str | None = None
    output: str | None = None
    parameters: tuple[tuple[str, float], ...] = ()
    suspects: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DiagnoseWork:
    """Diagnose a unit.

    Attributes:
        model: as given, of this project or anybody's FMU.
        reading: how the records are read.
        settings: of the diagnosis.
        report: whether the report page of each unit is drawn at once.
    """

    model: Model | ForeignModel
    reading: Reading
    settings: "Settings"
    report: bool = False

    def do(self, paths: Sequence[Path], names: Sequence[str]) -> UnitResult:
        """Return rows and files of the diagnosis; see `job.Work`."""
        with TemporaryDirectory() as folder:
            diagnosis = self.diagnosis(paths, names)
            diagnosis.write(Path(folder), report=self.report)
            files = {x.name: x.read_bytes() for x in sorted(Path(folder).iterdir())}
        return UnitResult(*rows(diagnosis.to_dict()), files)

    def diagnosis(self, paths: Sequence[Path], names: Sequence[str]) -> "Diagnosis":
        """Return the diagnosis of the records of a unit.

        Raises:
            InputError, RunError: as the diagnosis raises them.
        """
        from bender_discrepancy.foreign.diagnose import diagnose_fmu
        from bender_discrepancy.workflow import diagnose

        records = self.reading.records(paths)
        if isinstance(self.model, Model):
            return diagnose(self.model, records, self.settings, None, names)
        given = self.model
        return diagnose_fmu(
            given.path, given.input, given.output, records, self.settings, None, names, dict(given.parameters),
            given.suspects,
        )  # fmt: skip


def rows(told: Mapping[str, Any]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the row of the unit and those of its effects, from the content of `diagnosis.json`."""
    gap, following = told["gap"], told["next_experiment"]
    changed = told["recalibrated"]
    row = {
        "verdict": told["verdict"],
        "complete": told["complete"],
        "effects": [x["id"] for x in told["effects"]],
        "sentence": told["sentence"],
        "before_um": gap["before"]["rms_um"],
        "recalibrated_um": gap["recalibrated"]["rms_um"],
        "after_um": gap["after"]["rms_um"],
        "noise_floor_um": gap["noise_floor_um"],
        "after_percent": gap["after"]["nrmse_percent"],
        "gain": changed["gain"]["after"] if "gain" in changed else 1.0,
        "offset_um": changed["offset"]["after"] if "offset" in changed else 0.0,
        "next_experiment": following["why"] if following and following.get("profile") else None,
        "has_model": told["model"] is not None,
        "warnings": list(told["warnings"]),
    }
    return row, [_effect(x, told["verdict"]) for x in told["effects"]]


def _effect(told: Mapping[str, Any], verdict: str) -> dict[str, Any]:
    return {
        "effect": told["id"],
        "stage": told["stage"],
        "certain": verdict not in ("ambiguous", "likely"),
        "share_of_gap": told["share_of_gap"],
        "rivals": [x["id"] for x in told["rivals"]],
        "evidence": told["evidence"],
        "parameters": [
            {"name": name, "value": x["value"], "std": x["std"], "unit": x["unit"]}
            for name, x in told["parameters"].items()
        ],
    }
