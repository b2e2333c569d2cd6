"""`bender benchmark diagnose`: its figures from its runs, its table and its data."""

from pathlib import Path

import pytest

from bender_loop.records.record import read_record
from bender_studies.benchmarks.diagnose import exponent, figures
from bender_studies.benchmarks.diagnose_runs import Run, write_beginning, write_long_record


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
