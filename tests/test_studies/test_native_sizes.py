"""`bender benchmark native` end to end: the sizes that the page on FMUs without Python quotes."""

import json
from pathlib import Path

from native_hosts import needs_own_compiler

from bender_cli.main import main


@needs_own_compiler
def test_the_sizes_are_those_of_the_page(tmp_path: Path):
    assert main(["benchmark", "native", "--out", str(tmp_path / "o")]) == 0
    rows = json.loads((tmp_path / "o" / "native.json").read_text(encoding="utf-8"))["figures"]
    found = {x["model"]: tuple(x.values())[1:] for x in rows}
    assert {name: steps for name, (_, *steps) in found.items()} == {"paper": [3, 3], "beam": [1, 1], "bench": [10, 3]}
    assert all(500 < size < 1200 for size, *_ in found.values())
