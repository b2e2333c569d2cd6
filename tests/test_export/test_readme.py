import re
from pathlib import Path

import pytest

from bender_export.readme import refreshed

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
    assert re.fullmatch(r"\d+\.\d{3} um after 0\.5 s at 10 V\n", capsys.readouterr().out)
