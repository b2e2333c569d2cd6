import re
from pathlib import Path

import pytest

from bender_export.build import build_closed_loop
from bender_export.readme import refreshed
from bender_plant.model import load_model

README = Path(__file__).parents[2] / "fmu" / "README.md"


def test_the_tables_are_current() -> None:
    text = README.read_text(encoding="utf-8")
    assert refreshed(text) == text, "run python -m bender_export.readme"


def test_the_example_runs(
    plant_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "fmu").mkdir()
    (tmp_path / "fmu" / "PiezoBender.fmu").write_bytes(plant_fmu.read_bytes())
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    exec(example, {})
    assert re.fullmatch(r"\d+\.\d{3} µm after 0\.5 s at 10 V\n", capsys.readouterr().out)


def test_the_loop_of_the_how_to_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = README.parents[1] / "docs" / "how-to" / "fmu-in-other-tools.md"
    (example,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    build_closed_loop(load_model("paper"), tmp_path / "fmu" / "ClosedLoop.ssp")
    monkeypatch.chdir(tmp_path)
    exec(example, {})
    assert re.fullmatch(r"1[3-6]\.\d{3} µm\n", capsys.readouterr().out)
