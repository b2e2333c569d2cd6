"""Charts drawn by a process beside this one are those that this one would draw."""

import subprocess

import numpy as np
import pytest
from few import few

from bender_compiled.parallel_map import THREADS
from bender_discrepancy.report.chart_process import BESIDE, CHARTS, ChartProcess, charts_of
from bender_discrepancy.report.pictured_record import PicturedRecord
from bender_report.wording import shown_in

ROWS = 400


def pictured() -> PicturedRecord:
    """A record with a gap that a half of it closes."""
    rng, time_s = np.random.default_rng(4), np.arange(ROWS) / 30.0
    volts = 25.0 + 20.0 * np.sin(time_s)
    given = 0.4 * volts
    measured = given + 0.5 * np.cos(time_s) + 0.05 * rng.standard_normal(ROWS)
    return PicturedRecord(
        "record", time_s, "time (s)", volts, np.cos(time_s) > 0.0, measured, given, given, given + 0.4 * np.cos(time_s),
        np.arange(ROWS) % 100 > 60, 0.05, corrected=True,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("units", few([("V", "um"), ("bar", "rpm")], 0))
def test_the_charts_are_the_same_whoever_draws_them(units: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, "2")
    with shown_in(*units):
        alone = charts_of(pictured())
        with ChartProcess() as other:
            other.begin()
            other.begin()
            together = charts_of(pictured(), other)
    assert list(together) == list(alone) == list(CHARTS)
    assert together == alone
    loop = together["loop"]
    assert loop is not None
    assert units[0] in loop.wide
    assert ("rpm" in loop.wide) is (units[1] == "rpm")


@pytest.mark.slow
def test_what_a_process_that_ended_was_asked_for_is_drawn_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, "2")
    with ChartProcess() as other:
        other.begin()
        assert other._child is not None
        other._child.kill()
        other._child.wait()
        assert set(charts_of(pictured(), other)) == set(CHARTS)


def test_one_core_draws_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, "1")
    with ChartProcess() as other:
        other.begin()
        assert not other.ask(pictured(), BESIDE)
        assert other.drawn() == {}


def test_where_no_process_can_be_begun_this_one_draws_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, "2")

    def none_left(*_: object, **__: object) -> None:
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", none_left)
    with ChartProcess() as other:
        other.begin()
        assert set(charts_of(pictured(), other)) == set(CHARTS)
