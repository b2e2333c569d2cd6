"""`bender benchmark native` end to end: what it writes, and that both ways to a tuning agree."""

import json
from pathlib import Path

import pytest
from native_hosts import needs_own_compiler

from bender_cli.main import main


@needs_own_compiler
@pytest.mark.slow
def test_the_table_has_all_models_and_the_tunings_agree(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["benchmark", "native", "--repeats", "1", "--out", str(tmp_path / "o")]) == 0
    assert "What an FMU without Python costs" in capsys.readouterr().out
    figures = json.loads((tmp_path / "o" / "native.json").read_text(encoding="utf-8"))["figures"]
    names = [x["what"] for x in figures]
    assert all(f"{model}: 1 ms of the native FMU in a host in C" in names for model in ("paper", "beam", "bench"))
    assert all(x["best"] > 0.0 for x in figures)


def test_no_repeats_are_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    assert main(["benchmark", "native", "--repeats", "0"]) == 2
    assert "--repeats" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
