"""How well probabilities are kept, and what judged effects teach about their weights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_studies.device_fuzz.campaign import Tried
from bender_studies.device_fuzz.campaign import judged_effects as judged_of_devices
from bender_studies.hidden_effects.probabilities import (
    JudgedEffect,
    by,
    calibration_error,
    held_to_others,
    reliability,
    weights,
)

TRUE_WEIGHTS = (-2.0, 0.5, 1.0, 0.5)


def drawn(count: int, seed: int) -> list[JudgedEffect]:
    """Effects that are there as often as a logistic curve of their cases says."""
    rng = np.random.default_rng(seed)
    cases = np.column_stack([np.ones(count), rng.uniform(0.0, [8.0, 4.0, 1.0], size=(count, 3))])
    probabilities = 1.0 / (1.0 + np.exp(-cases @ TRUE_WEIGHTS))
    there = rng.random(count) < probabilities
    rows = zip(cases, probabilities, there, strict=True)
    return [JudgedEffect(tuple(map(float, x)), float(p), bool(y)) for x, p, y in rows]


def test_weights_are_found_again():
    assert weights(drawn(20_000, 1)) == pytest.approx(TRUE_WEIGHTS, abs=0.15)


def test_more_evidence_never_speaks_against_an_effect():
    upside_down = [JudgedEffect(x.parts, x.probability, not x.is_there) for x in drawn(500, 2)]
    found = weights(upside_down)[1:]
    assert min(found) >= 0.0
    assert found[:2] == pytest.approx((0.0, 0.0), abs=1e-3)


def test_the_weights_that_drew_effects_give_back_their_probabilities():
    told = drawn(50, 3)
    assert [p for p, _ in by(told, TRUE_WEIGHTS)] == pytest.approx([x.probability for x in told])
    assert [x for _, x in by(told, TRUE_WEIGHTS)] == [x.is_there for x in told]


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), max_size=40))
def test_every_effect_is_in_one_bin_and_no_error_is_beyond_one(pairs: list[tuple[float, bool]]):
    assert sum(int(row[1]) for row in reliability(pairs)) == len(pairs)
    assert 0.0 <= calibration_error(pairs) <= 1.0


def test_what_is_off_is_weighed_by_how_many_it_holds():
    kept = [(0.5, x) for x in (True, False)] * 3
    off = [(0.9, x) for x in (True, False)]
    assert calibration_error(kept) == pytest.approx(0.0)
    assert calibration_error(off) == pytest.approx(0.4)
    assert calibration_error(kept + off) == pytest.approx(0.1)
    assert reliability(kept + off) == [["0.4 to 0.6", "6", "0.500", "0.500"], ["0.8 to 1.0", "2", "0.900", "0.500"]]


def test_half_of_the_effects_teach_and_the_others_judge():
    kept, learned = held_to_others(drawn(4000, 4), drawn(4000, 5))
    for title, _, rows in (kept, learned):
        assert float(title.rsplit(" ", 1)[1]) < 0.03
        assert all(float(mean) == pytest.approx(float(there), abs=0.1) for _, _, mean, there in rows)
    assert sum(int(row[1]) for row in kept[2]) == 8000
    assert sum(int(row[1]) for row in learned[2]) == 4000
    assert len(held_to_others(drawn(10, 6), [])) == 1


def test_rivals_and_what_is_read_off_teach_nothing():
    weighed = {"deviations": 8.0, "log_ratio": 2.0, "closed": 0.9, "passed": True}
    told = [
        {"id": "creep", "probability": 0.8, "weighed": weighed, "is_there": True},
        {"id": "sensor_lag", "probability": 0.1, "weighed": None, "is_there": False},
    ]
    (judged,) = judged_of_devices([Tried(1, ("lag",), told=told)])
    assert judged == JudgedEffect((1.0, 1.0, 8.0, 2.0, 0.9), 0.8, is_there=True)
