"""Detectors beside the watch: false alarms as rare for all, delays on the same runs."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bender_studies.watching import side_by_side
from bender_studies.watching.devices import Change
from bender_studies.watching.others import METHODS, Run, first_beyond, judged_run, largest
from bender_studies.watching.side_by_side import Counted, counted, delay, table, threshold_of
from bender_watch.sequential.detector import JUDGED, Detector, Noise, make_tests

ROWS, EVERY = 1500, 4000.0
WHITE = Noise(np.zeros((1, 0)), np.array([0.5]))


def run(seed: int, level: float = 0.0, since: int = ROWS) -> Run:
    """Return a run of white noise whose level is another one from a row on, so many deviations away."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.standard_normal(ROWS // 20), 20)
    tests = make_tests(("level", "steps"), np.zeros(2), np.ones(2), np.zeros(2, bool), EVERY)
    baseline: Any = SimpleNamespace(noise=WHITE, tests=tests)
    residual = 0.5 * (rng.standard_normal(ROWS) + level * (np.arange(ROWS) >= since))
    return judged_run(baseline, residual, 0.5 * np.column_stack([np.ones(ROWS), steps]), np.ones(ROWS))


CALM, FRESH = [run(k) for k in range(120)], [run(1000 + k) for k in range(120)]


@pytest.mark.parametrize("name", METHODS)
def test_each_method_is_set_to_the_wanted_rate_and_keeps_it_on_other_runs(name: str) -> None:
    calm, fresh = ([largest(METHODS[name], x) for x in runs] for runs in (CALM, FRESH))
    threshold = threshold_of(calm, EVERY)
    alarms, rows = counted(calm, threshold)
    assert rows / EVERY - 4.0 < alarms <= rows / EVERY
    again = Counted.of(*counted(fresh, threshold))
    # of about 40 on either side: more than three deviations apart has a chance of some in a thousand
    assert abs(again.alarms - alarms) < 3.0 * np.sqrt(again.alarms + alarms)
    assert again.low < again.rows / again.alarms < again.high


def test_the_statistic_of_the_watch_passes_1_where_it_alarms() -> None:
    own = run(5, 1.0, 700)
    found = Detector(WHITE, own.baseline.tests).judge(
        own.residual_um, own.signatures_um, np.full(ROWS, JUDGED, dtype=np.int64), own.spread
    )
    statistic = largest(METHODS["watch"], own)
    assert found.exceedance is not None
    assert first_beyond(statistic, 1.0) == found.exceedance.row
    assert first_beyond(statistic, 1e6) is None


def test_after_a_false_alarm_a_method_begins_anew() -> None:
    method = METHODS["moving window"]
    own = run(6, 2.0, 700)
    own.innovations[100:160] += 3.0
    own.residual_um[100:160] += 1.5
    assert first_beyond(largest(method, own), 8.0) == pytest.approx(130, abs=30)
    found = delay(method, own, 700, 8.0)
    assert found is not None
    assert 20 <= found <= 50
    assert delay(method, run(7), 700, 8.0) is None


def test_a_cut_of_adwin_says_at_which_delta_it_is_one() -> None:
    """By the formula of the paper as river has it, on a window of two levels."""
    own = run(8, 1.0, 900)
    n, old = 1472, 896
    x = own.innovations[:n]
    statistic = float(METHODS["ADWIN"](own)[n - 1])
    late = math.log(2.0 * math.log(n)) + statistic
    narrow = 1.0 / (old - 4) + 1.0 / (n - old - 4)
    cut = math.sqrt(2.0 * narrow * float(np.var(x)) * late) + 2.0 / 3.0 * late * narrow
    # the buckets lie where they lie: the cut of 896 rows is one of them, and the best one is no worse
    assert abs(float(np.mean(x[:old]) - np.mean(x[old:]))) == pytest.approx(cut, rel=0.2)


def test_the_table_has_a_row_for_each_method(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = {name: METHODS[name] for name in ("watch", "ADWIN")}
    monkeypatch.setattr(side_by_side, "METHODS", quick)
    own = run(8, 2.0, 700)
    change = Change("creep", 3.0, "step", SimpleNamespace(), 700, np.zeros(0), np.zeros(0))  # pyright: ignore[reportArgumentType]
    found = side_by_side.side_by_side(CALM[:40], FRESH[:40], [(change, own)], EVERY)
    columns, rows = table(found, [3.0, 10.0])
    assert [x[0] for x in rows] == list(quick)
    assert rows[0][columns.index("3 × noise: found")] == "1 of 1"
    assert rows[0][columns.index("10 × noise: found")] == "0 of 0"
    assert all(len(x) == len(columns) for x in rows)
