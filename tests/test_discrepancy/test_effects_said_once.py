"""What is special about an effect stands in its own file: nothing else of the diagnosis knows it by its id."""

import ast
from collections.abc import Iterator
from pathlib import Path

import bender_discrepancy
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.effects.effect import CALIBRATION

ROOM = Path(bender_discrepancy.__file__).parent
IDS = {name for name, x in EFFECTS.items() if x.stage != CALIBRATION}


def _named(path: Path) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in IDS:
            yield node.lineno, node.value


def test_no_id_of_an_effect_stands_outside_the_catalogue() -> None:
    files = [x for x in ROOM.rglob("*.py") if "effects" not in x.relative_to(ROOM).parts]
    assert len(files) > 50
    found = [f"{x.relative_to(ROOM)}:{line}: {name}" for x in files for line, name in _named(x)]
    assert not found


def test_the_search_for_ids_sees_them() -> None:
    assert dict(_named(ROOM / "effects" / "library" / "slew_limit.py"))
