"""`bender benchmark diagnose`: its figures from its runs, its table and its data."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_loop.errors import RunError
from bender_loop.records.record import read_record
from bender_studies.benchmarks import diagnose
from bender_studies.benchmarks.diagnose import exponent, figures
from bender_studies.benchmarks.diagnose_runs import Run, timed, write_beginning, write_long_record


def made(rows: int, seconds: float) -> Run:
    return Run("a", rows, seconds, seconds, None, "named", ("creep",))


def test_the_exponent_is_that_of_the_power() -> None:
    for power in (0.5, 1.0, 2.0):
        assert exponent(made(1000, 3.0), made(10_000, 3.0 * 10.0**power)) == pytest.approx(power)


def test_every_target_is_held_against_its_own_runs() -> None:
    runs = {
        "cold": [made(5100, 14.0)],
        "warm": [made(5100, 3.0), made(5100, 90.0), made(5100, 5.0)],
        "pair": [made(5100, 14.0)],
        "triple": [made(5100, 41.0)],
        "five": [made(5100, 119.0)],
        "vibrometer": [made(32_000, 59.0)],
        "growth": [made(10_000, 1.0), made(100_000, 10.0), made(1_000_000, 300.0)],
    }
    found = figures(runs)
    assert [x.found for x in found[:7]] == [14.0, 5.0, 14.0, 41.0, 119.0, 59.0, 300.0]
    assert [x.met for x in found] == [True, False, True, False, True, True, False, True, False]


def test_a_long_record_has_the_rows_that_were_asked_for_and_its_beginning_is_its_beginning(tmp_path: Path) -> None:
    hidden = ("single", ("source_resistance",))
    whole = write_long_record(tmp_path / "whole.csv", *hidden, 1, "camera", 6000)
    part = write_beginning(tmp_path / "part.csv", whole, 100)
    long, short = read_record(whole), read_record(part)
    assert (len(long), len(short)) == (6000, 100)
    assert (long.displacement_um[:100] == short.displacement_um).all()
    assert long.voltage_V[5500:].std() > 0.0


@pytest.mark.slow
def test_a_diagnosis_that_fails_is_told(tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("time_s,voltage_V,displacement_um\n0,0,0\n", encoding="utf-8")
    with pytest.raises(RunError, match="expected at least 2"):
        timed(tmp_path / "bad.csv", tmp_path / "cache")


def test_the_table_and_the_data_say_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def few(*_: object) -> Iterator[tuple[str, Run]]:
        yield "cold", made(5100, 50.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(diagnose, "_measured", few)
    assert main(["benchmark", "diagnose", "--out", str(tmp_path / "out")]) == 130
    assert "NO" in capsys.readouterr().out
    data = json.loads((tmp_path / "out" / "diagnose.json").read_text(encoding="utf-8"))
    assert [(x["found"], x["met"]) for x in data["figures"]] == [(50.0, False)]
    assert data["runs"]["cold"][0]["effects"] == ["creep"]


@pytest.mark.parametrize("words", [["--parts", "all"], ["--longest", "10"], ["--seed", "-1"]])
def test_bad_words_are_bad_input(tmp_path: Path, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["benchmark", "diagnose", *words, "--out", str(tmp_path / "out")]) == 2
    assert words[0] in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
