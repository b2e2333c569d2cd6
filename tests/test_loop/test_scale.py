"""Answers that are tenfold, a thousandfold or a millionfold off are asked about."""

import json
import math
from pathlib import Path

import pytest
from few import few_rows
from foreign_fmus import foreign_fmu, needs_compiler
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_loop.records.scale import TENFOLD, scale_question


@given(st.floats(min_value=1.0 / TENFOLD, max_value=TENFOLD, exclude_min=True, exclude_max=True))
def test_what_is_of_the_same_size_is_not_asked_about(times: float) -> None:
    assert scale_question(times) is None
    assert scale_question(-times) is None


@given(st.floats(min_value=TENFOLD, max_value=1e12), st.booleans())
def test_more_and_less_are_asked_about_alike(times: float, more: bool) -> None:
    asked = scale_question(times if more else 1.0 / times)
    assert asked is not None
    assert ("more" if more else "less") in asked
    assert "--units" in asked


def test_nothing_is_asked_about_no_number() -> None:
    assert [scale_question(x) for x in (0.0, math.nan, math.inf)] == [None, None, None]
    assert "mm for µm" in str(scale_question(1e3))
    assert "m for µm" in str(scale_question(1e-6))


@needs_compiler
@pytest.mark.parametrize(
    ("gain", "said"), few_rows([(1e-9, "1e+03 times more"), (1.0, "1e+06 times less"), (1e-6, None)], 0)
)
def test_compare_asks(
    gain: float, said: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    foreign_fmu(Path("lag.fmu"), gain=gain)
    rows = [(0.1 * k, float(k % 7), float((k - 1) % 7) if k else 0.0) for k in range(80)]
    text = "\n".join(["time_s,voltage_V,displacement_um", *(",".join(map(repr, x)) for x in rows)])
    Path("record.csv").write_text(text + "\n", encoding="utf-8")
    assert main(["compare", "record.csv", "--fmu", "lag.fmu", "--set", "tau=0.01", "--out", "o"]) == 0
    printed = capsys.readouterr().out
    found = json.loads(Path("o/comparison.json").read_text(encoding="utf-8"))["question"]
    assert (found is None) == (said is None)
    if said:
        assert said in printed
        assert said in found


@pytest.mark.slow
@needs_compiler
def test_tune_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    foreign_fmu(Path("small.fmu"), gain=1e-9)
    assert main(["tune", "--fmu", "small.fmu", "--setpoint", "20", "--out", "o"]) == 2
    assert "400 times more than expected: is a unit another" in capsys.readouterr().err
