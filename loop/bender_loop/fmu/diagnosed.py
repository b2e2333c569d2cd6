"""What the diagnosis beside a corrected model says of it."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bender_loop.tables.quantities import MICROMETRE, VOLT

DIAGNOSIS = "diagnosis.json"


@dataclass(frozen=True, slots=True)
class RivalModel:
    """A model that the records do not rule out beside the corrected one.

    Attributes:
        effects: that it has, by their ids.
        model: its file.
        fmu: of it.
    """

    effects: tuple[str, ...]
    model: Path
    fmu: Path

    @property
    def name(self) -> str:
        """For people."""
        return " + ".join(self.effects) or "no effect"


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """What a diagnosis says of the model that it left.

    Attributes:
        rms_um: residual of the model on held-out rows; 0 where it was not measured.
        units: of command and reading, in which that and the model's V and um are.
        rivals: what the records leave open beside the model.
    """

    rms_um: float = 0.0
    units: tuple[str, str] = (VOLT, MICROMETRE)
    rivals: tuple[RivalModel, ...] = ()

    def with_fmus_of(self, fmu_of: Callable[[Path], Path]) -> "Diagnosed":
        """Return the same with FMUs that `fmu_of` makes of the files of the rivals."""
        return replace(self, rivals=tuple(replace(x, fmu=fmu_of(x.model)) for x in self.rivals))


NOTHING = Diagnosed()


def diagnosed(model: Path | str | None) -> Diagnosed:
    """Return what the diagnosis in the folder of a model or FMU says of it; nothing where it is not of this model."""
    if model is None:
        return NOTHING
    folder = Path(model).parent
    try:
        told = json.loads((folder / DIAGNOSIS).read_text(encoding="utf-8"))
        if Path(model).name not in (told["model"], told["fmu"]):
            return NOTHING
        units = str(told["input_unit"]), str(told["unit"])
        rivals = tuple(_rival(folder, x) for x in told.get("rival_models", ()))
        return Diagnosed(float(told["gap"]["after"]["rms"]), units, rivals)
    except (OSError, ValueError, LookupError, TypeError):
        return NOTHING


def _rival(folder: Path, told: dict[str, Any]) -> RivalModel:
    return RivalModel(tuple(map(str, told["effects"])), folder / told["model"], folder / told["fmu"])
