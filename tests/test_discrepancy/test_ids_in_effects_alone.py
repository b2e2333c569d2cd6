"""What is special about an effect stands in its own file: the rest of the package knows none by its id."""

import ast
from pathlib import Path

import bender_discrepancy
from bender_discrepancy.effects.catalogue import EFFECTS

PACKAGE = Path(bender_discrepancy.__file__).parent
KNOWN = {
    "conclusion/coarse_readings.py",
    "conclusion/corrected_model.py",
    "conclusion/findings.py",
    "conclusion/notes.py",
    "conclusion/sentences.py",
    "conclusion/smallest_visible.py",
    "fitting/level_cell.py",
    "report/effect_sections.py",
    "report/loop_figures.py",
    "report/told_in_figures.py",
    "witnesses/terminals.py",
    "witnesses/testimony.py",
}
"""Files that still do."""


def with_ids(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {
        x.value
        for x in ast.walk(tree)
        if isinstance(x, ast.Constant) and isinstance(x.value, str) and x.value in EFFECTS
    }


def test_no_other_file_knows_an_effect_by_its_id() -> None:
    paths = [x for x in PACKAGE.rglob("*.py") if x.relative_to(PACKAGE).parts[0] != "effects"]
    assert len(paths) > 50
    assert {x.relative_to(PACKAGE).as_posix() for x in paths if with_ids(x)} <= KNOWN
