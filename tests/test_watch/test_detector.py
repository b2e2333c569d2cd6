"""The tests side by side: quiet while nothing changes, quick when something does, the same however rows arrive."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_watch.sequential.detector import GAP, JUDGED, NOT_JUDGED, Detector, Noise, make_tests

WHITE = Noise(np.zeros((1, 0)), np.array([0.5]))
COLOURED = Noise(np.array([[0.0], [0.8]]), np.array([0.5 / 0.6, 0.5]))


def detector(rows: float = 1e5, noise: Noise = WHITE, signatures: int = 2) -> Detector:
    names = tuple(f"effect_{k}" for k in range(signatures))
    ones = np.ones(signatures)
    return Detector(noise, make_tests(names, 0.0 * ones, ones, np.zeros(signatures, bool), rows))


def drawn(rows: int, seed: int, phi: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Noise of deviation 0.5 per innovation, and a level beside a signature of steps."""
    rng = np.random.default_rng(seed)
    noise = 0.5 * rng.standard_normal(rows)
    for k in range(1, rows):
        noise[k] += phi * noise[k - 1]
    steps = np.repeat(rng.standard_normal(rows // 20 + 1), 20)[:rows]
    return noise, np.column_stack([np.full(rows, 0.5), 0.5 * steps])


def judged(own: Detector, residual: np.ndarray, signatures: np.ndarray, kind: int = JUDGED):
    kinds = np.full(residual.size, kind, dtype=np.int64)
    return own.judge(residual, signatures, kinds, np.ones(residual.size))


@pytest.mark.parametrize(("noise", "phi"), [(WHITE, 0.0), (COLOURED, 0.8)])
def test_false_alarms_are_no_more_than_was_said(noise: Noise, phi: float) -> None:
    own, alarms, rows = detector(2000.0, noise), 0, 100_000
    residual, signatures = drawn(rows, 5, phi)
    begin = 0
    while (found := own.judge(residual, signatures, np.zeros(rows, np.int64), np.ones(rows), begin)).exceedance:
        alarms, begin = alarms + 1, found.exceedance.row + 1
        own.reset()
    # 50 on the average at the rate that was said; more than 67 has a chance of 1 %
    assert 5 <= alarms <= 67


def test_rows_in_which_a_signature_has_died_away_raise_nothing() -> None:
    """Sums over all rows forget what is too small beside them: such rows seemed to be known better than they are."""
    own, rng = detector(1e6, signatures=1), np.random.default_rng(11)
    signatures = np.tile(5.0 * np.exp(-np.arange(1000) / 60.0), 100)[:, None]
    for _ in range(8):
        assert judged(own, 0.5 * rng.standard_normal(len(signatures)), signatures).exceedance is None


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.integers(1, 399), max_size=5))
def test_stretches_of_any_length_say_the_same(seed: int, cuts: list[int]) -> None:
    residual, signatures = drawn(400, seed, 0.8)
    residual[200:] += 1.0
    residual[90:95] = np.nan
    whole = judged(detector(noise=COLOURED), residual, signatures)
    own, parts = detector(noise=COLOURED), []
    for a, b in zip([0, *sorted(set(cuts))], [*sorted(set(cuts)), 400], strict=True):
        found = judged(own, residual[a:b], signatures[a:b])
        parts.append(found.innovations)
        if found.exceedance:
            assert whole.exceedance is not None
            assert a + found.exceedance.row == whole.exceedance.row
            return
    assert whole.exceedance is None
    assert np.array_equal(np.concatenate(parts), whole.innovations, equal_nan=True)


def test_what_was_remembered_goes_on() -> None:
    residual, signatures = drawn(300, 8, 0.8)
    one, other = detector(noise=COLOURED), detector(noise=COLOURED)
    judged(one, residual[:200], signatures[:200])
    other.restore(one.state())
    mine, theirs = (judged(x, residual[200:], signatures[200:]) for x in (one, other))
    assert np.array_equal(mine.tops, theirs.tops)


def test_the_state_of_other_tests_is_refused() -> None:
    with pytest.raises(ValueError, match="other tests"):
        detector(signatures=3).restore(detector().state())


@pytest.mark.parametrize("amplitude", [2.0, 4.0, -4.0])
def test_a_change_is_found_near_the_bound_of_any_test(amplitude: float) -> None:
    residual, signatures = drawn(4000, 3)
    residual[2000:] += amplitude * signatures[2000:, 1]
    found = judged(detector(), residual, signatures).exceedance
    assert found is not None
    # Wald: ln(rows between false alarms) over the information that a row has
    information = np.cumsum(0.5 * (amplitude * signatures[2000:, 1] / 0.5) ** 2)
    bound = int(np.searchsorted(information, np.log(1e5)))
    assert 0 <= found.row - 2000 <= 3 * bound + 10


def test_outlying_readings_are_no_alarm_and_a_constant_sensor_is() -> None:
    residual, signatures = drawn(3000, 4)
    residual[::100] += 40.0
    residual[1501], residual[1502] = 40.0, 40.0
    assert judged(detector(1e6), residual, signatures).exceedance is None
    residual[2000:] = 0.0
    found = judged(detector(1e6), residual, signatures).exceedance
    assert found is not None
    assert found.test == "quieter"
    assert 2000 < found.row < 2100


def test_rows_that_are_not_judged_raise_nothing() -> None:
    residual, signatures = drawn(500, 6)
    found = judged(detector(), residual + 5.0, signatures, NOT_JUDGED)
    assert found.exceedance is None
    assert found.rows == 0


def test_behind_a_gap_the_first_row_is_judged_without_a_past() -> None:
    own = detector(noise=COLOURED)
    residual, signatures = np.array([1.0, 1.0]), np.zeros((2, 2))
    found = own.judge(residual, signatures, np.array([JUDGED, JUDGED + GAP]), np.ones(2))
    assert found.innovations == pytest.approx([1.0 * 0.6 / 0.5] * 2)
