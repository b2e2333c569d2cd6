"""The program on the how-to page runs as it stands there, on the record that ships."""

import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_program_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture):
    text = (ROOT / "docs" / "how-to" / "use-it-from-python.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    shutil.copy(ROOT / "examples" / "record.csv", tmp_path / "record.csv")
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "use-it-from-python.md", "exec"), {"__name__": "__main__"})
    assert "named ['" in capsys.readouterr().out
    written = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert {"results/diagnosis/model.fmu", "results/diagnosis/report.html", "results/tune/gains.toml"} <= written
