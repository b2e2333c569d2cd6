"""What is special about an effect stands in its own file: the rest of the package knows none by its id."""

import ast
from pathlib import Path

import bender_discrepancy
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.effects.effect import CALIBRATION

PACKAGE = Path(bender_discrepancy.__file__).parent
IDS = {name for name, x in EFFECTS.items() if x.stage != CALIBRATION}
OF_A_MODEL = {
    "fitting/own_numbers.py",
    "foreign/container_stages.py",
    "foreign/relaxation_model.py",
    "foreign/slow_copy.py",
    "workflow.py",
}
"""They take models apart that may have such blocks of their own, and import these."""


def with_ids(path: Path) -> set[str]:
    """Return the ids that stand in a file, as words or as the blocks that it imports."""
    found: set[str] = set()
    for x in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(x, ast.Constant) and isinstance(x.value, str):
            found.add(x.value)
        elif isinstance(x, ast.ImportFrom) and (x.module or "").startswith("bender_plant.blocks"):
            found |= {(x.module or "").rpartition(".")[2], *(y.name for y in x.names)}
    return found & IDS


def test_no_other_file_knows_an_effect_by_its_id() -> None:
    paths = [x for x in PACKAGE.rglob("*.py") if x.relative_to(PACKAGE).parts[0] != "effects"]
    assert len(paths) > 50
    assert {x.relative_to(PACKAGE).as_posix() for x in paths if with_ids(x)} == OF_A_MODEL
