import math

import numpy as np
import pytest

from bender_investigate.proof import Task, compare_costs, cost_of, cost_um_s2, order
from bender_loop.records.record import Record

TASK = Task(10.0, 4.0, 2.0)


def test_old_and_new_take_turns_at_going_first():
    assert order(3) == [(0, "old"), (0, "new"), (1, "new"), (1, "old"), (2, "old"), (2, "new")]


def test_the_cost_of_a_constant_error_is_known():
    time_s = np.arange(0.0, TASK.duration_s, 0.001)
    tip_um = TASK.reference.sample(time_s) - 0.5
    # twice the integral of t |0.5| over two seconds
    assert cost_um_s2(time_s, tip_um, TASK) == pytest.approx(2 * 0.5 * 2.0**2 / 2, rel=1e-2)


def test_what_the_noise_explains_costs_nothing():
    task = Task(10.0, 4.0, 2.0, noise_um=0.2)
    time_s = np.arange(0.0, task.duration_s, 1.0 / 30.0)
    aim_um = task.reference.sample(time_s)
    assert cost_um_s2(time_s, aim_um - 0.59, task) == 0.0
    assert cost_um_s2(time_s, aim_um - 1.6, task) == pytest.approx(2 * 1.0 * 2.0**2 / 2, rel=0.05)


def test_lost_frames_cost_nothing_and_a_cut_run_is_endless():
    time_s = np.arange(0.0, TASK.duration_s, 1.0 / 30.0)
    tip_um = TASK.reference.sample(time_s) - 0.5
    whole = cost_um_s2(time_s, tip_um, TASK)
    tip_um[40] = np.nan
    assert cost_um_s2(time_s, tip_um, TASK) == pytest.approx(whole, rel=0.01)
    assert math.isinf(cost_um_s2(time_s[:20], tip_um[:20], TASK))


def test_the_clock_of_a_play_begins_where_its_set_point_moves():
    time_s = np.arange(0.0, TASK.duration_s + 1.0, 1.0 / 30.0)
    aim = np.where(time_s < 0.7, 0.0, TASK.reference.sample(time_s - 0.5))
    record = Record(time_s, np.zeros_like(time_s), aim - 0.1, setpoint_um=aim)
    assert cost_of(record, TASK) == pytest.approx(2 * 0.1 * 2.0**2 / 2, rel=0.05)


def test_better_needs_the_whole_interval():
    rng = np.random.default_rng(1)
    old = 10.0 + rng.normal(0.0, 0.1, 6)
    assert compare_costs(old, 0.7 * old).judgement == "better"
    assert compare_costs(0.7 * old, old).judgement == "worse"
    assert compare_costs(old, old + rng.normal(0.0, 0.1, 6)).judgement == "no difference"
    assert compare_costs(old, 0.99 * old).judgement == "no difference"
    assert compare_costs(old[:1], 0.5 * old[:1]).judgement == "not known"


def test_equal_gains_are_hardly_ever_called_better():
    rng = np.random.default_rng(2)
    judged = [compare_costs(rng.normal(10, 1, 5), rng.normal(10, 1, 5)).judgement for _ in range(2000)]
    # 2.5 % beyond the interval on that side, less for the difference that has to matter
    assert judged.count("better") / len(judged) < 0.03


def test_the_interval_is_students():
    old, new = np.array([10.0, 11.0, 10.5, 10.2]), np.array([9.0, 9.5, 9.9, 9.1])
    found = compare_costs(old, new)
    saved = (old - new) / old.mean()
    half = 3.182446305284263 * saved.std(ddof=1) / 2.0
    assert (found.low, found.high) == pytest.approx((saved.mean() - half, saved.mean() + half))


@pytest.mark.parametrize(
    ("old", "new", "judgement"),
    [
        ((math.inf, math.inf), (3.0, 3.1), "better"),
        ((math.inf, 4.0), (3.0, 3.1), "not known"),
        ((4.0, 4.1), (math.inf,), "worse"),
        ((math.inf, math.inf), (math.inf,), "not known"),
    ],
)
def test_plays_that_had_to_be_ended_speak_first(old, new, judgement):
    found = compare_costs(old, new)
    assert found.judgement == judgement
    assert "had to be ended" in found.sentence
    assert ("are better" in found.sentence) == (judgement == "better")
