"""What the diagnosis beside a corrected model says of it."""

import json
from dataclasses import dataclass
from pathlib import Path

from bender_loop.tables.quantities import MICROMETRE, VOLT

DIAGNOSIS = "diagnosis.json"


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """What a diagnosis says of the model that it left.

    Attributes:
        rms_um: residual of the model on held-out rows; 0 where it was not measured.
        units: of command and reading, in which that and the model's V and um are.
    """

    rms_um: float = 0.0
    units: tuple[str, str] = (VOLT, MICROMETRE)


NOTHING = Diagnosed()


def diagnosed(model: Path | str | None) -> Diagnosed:
    """Return what the diagnosis in the folder of a model or FMU says of it; nothing where it is not of this model."""
    if model is None:
        return NOTHING
    try:
        told = json.loads((Path(model).parent / DIAGNOSIS).read_text(encoding="utf-8"))
        if Path(model).name not in (told["model"], told["fmu"]):
            return NOTHING
        return Diagnosed(float(told["gap"]["after"]["rms"]), (str(told["input_unit"]), str(told["unit"])))
    except (OSError, ValueError, LookupError, TypeError):
        return NOTHING
