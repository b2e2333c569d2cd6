"""Cases of a parameter against an effect: the truth in closed form, and that what is hidden shows."""

import numpy as np
import pytest

from bender_proving.systems.suspected import GIVEN, NOISE_UM, SuspectedCase, suspected_case


def _plain_um(case: SuspectedCase, time_constant_s: float) -> np.ndarray:
    """A lag of 1 um/V, row by row in closed form."""
    found, keep = np.zeros(case.time_s.size), np.exp(-np.diff(case.time_s) / time_constant_s)
    for k, x in enumerate(keep, 1):
        found[k] = x * found[k - 1] + (1.0 - x) * case.voltage_V[k - 1]
    return found


def _left_um(reading_um: np.ndarray, model_um: np.ndarray) -> float:
    basis = np.column_stack((model_um, np.ones(model_um.size)))
    return float(np.std(reading_um - basis @ np.linalg.lstsq(basis, reading_um, rcond=None)[0]))


@pytest.mark.slow
def test_of_forty_cases_twenty_have_an_effect_and_twenty_five_a_parameter() -> None:
    cases = [suspected_case(k, 3) for k in range(40)]
    assert sum(bool(x.off) for x in cases) == 25
    assert sum(bool(x.effect) for x in cases) == 20
    assert sum(bool(x.off) and bool(x.effect) for x in cases) == 5
    for x in cases:
        assert all(0.05 <= abs(value / x.given[name] - 1.0) <= 0.3 for name, value in x.off.items())
    assert {x.structure for x in cases} == set(GIVEN)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_lag_that_is_off_is_that_lag_and_shows(seed: int) -> None:
    case = suspected_case(0, seed)
    (value,) = case.off.values()
    assert _left_um(case.reading_um, _plain_um(case, value)) == pytest.approx(NOISE_UM, rel=0.1)
    assert _left_um(case.reading_um, _plain_um(case, 0.2)) > 3.0 * NOISE_UM


def test_the_same_number_and_seed_give_the_same_case() -> None:
    first, again, other = suspected_case(7, 5), suspected_case(7, 5), suspected_case(7, 6)
    assert np.array_equal(first.reading_um, again.reading_um)
    assert not np.array_equal(first.reading_um, other.reading_um)
