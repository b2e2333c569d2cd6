"""`--set NAME=VALUE`: parameters of an FMU in every command that takes one."""

import json
from pathlib import Path

import pytest
from few import few
from foreign_fmus import foreign_fmu, needs_compiler

from bender_cli.main import main

pytestmark = needs_compiler
ROWS = [(0.1 * k, 10.0 * (k // 10 % 3), 10.0 * (k // 10 % 3)) for k in range(60)]


@pytest.fixture(autouse=True)
def lag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    foreign_fmu(tmp_path / "lag.fmu")
    lines = ["time_s,voltage_V,displacement_um", *(f"{t:.1f},{u},{y}" for t, u, y in ROWS)]
    Path("record.csv").write_text("\n".join(lines) + "\n")


@pytest.mark.slow
def test_compare_takes_them():
    gains = {}
    for words in ([], ["--set", "gain=2e-6"], ["--set", "gain=2e-6", "--set", "tau=1e-4"]):
        assert main(["compare", "record.csv", "--fmu", "lag.fmu", *words, "--out", "o"]) == 0
        found = json.loads(Path("o/comparison.json").read_text(encoding="utf-8"))
        gains[len(words)] = found["recalibration"]["gain"]
        assert len(found["start_values"]) == len(words) // 2
    assert gains[0] == pytest.approx(2.0 * gains[2], rel=1e-6)
    # nearly no lag is left: twice the gain is all that is off
    assert gains[4] == pytest.approx(0.5, abs=0.06)


@pytest.mark.slow
def test_tune_takes_them_and_says_so():
    assert main(["tune", "--fmu", "lag.fmu", "--set", "gain=2e-6", "--evaluations", "20", "--out", "t"]) == 0
    told = json.loads(Path("t/tuning.json").read_text(encoding="utf-8"))
    assert told["fmu"]["start_values"] == {"gain": 2e-6}
    assert told["operating_point"]["voltage_V"] == pytest.approx(5.0, rel=1e-3)


@pytest.mark.parametrize("command", few([["compare", "record.csv"], ["tune"], ["diagnose", "record.csv"]], 0))
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--set", "gain"], "expected NAME=VALUE"),
        (["--set", "gain=nan"], "expected NAME=VALUE"),
        (["--set", "gain=1", "--set", "gain=2"], "found gain twice"),
        (["--set", "gian=1"], "found no parameter 'gian'"),
    ],
)
def test_what_cannot_be_set(
    command: list[str], words: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    assert main([*command, "--fmu", "lag.fmu", *words, "--out", "o"]) == 2
    error = [x for x in capsys.readouterr().err.splitlines() if x.startswith("bender")]
    assert len(error) == 1
    assert said in error[0]
    assert {x.suffix for x in tmp_path.iterdir()} <= {".fmu", ".csv", ".so"}
