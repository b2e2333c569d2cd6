"""What the translator does not know ends with function and line, and nothing is written."""

from dataclasses import replace
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_plant.blocks import BLOCKS


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """As plain as any other kernel, but for the set."""
    known = {u0, um, u1}
    return state, u0, um, float(len(known))


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_kernel_that_cannot_be_translated(
    fmi: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(BLOCKS, "calibration", replace(BLOCKS["calibration"], step=step))
    assert main(["fmu", "build", "--native", "--fmi", fmi, "--out", "o"]) == 2
    said = capsys.readouterr().err
    line = step.__code__.co_firstlineno + 4
    assert f"test_refusals.py, line {line}, in step: found Set" in said
    assert said.count("\n") == 1
    assert not Path("o").exists()
