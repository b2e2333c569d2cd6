import numpy as np
import pytest

from bender_identify.records.excitation import check_answered, check_moved, cycle_scatter_um, describe
from bender_identify.records.voltage_path import even_times
from bender_loop.errors import InputError

TIME = even_times(0.01, 2000)
NOISE = np.random.default_rng(2).standard_normal(2000)


def test_a_voltage_that_stands_still_is_refused() -> None:
    volts = np.full(2000, 5.0)
    with pytest.raises(InputError, match=r"a\.csv: voltage_V is 5 V in all 2000 rows, so it excites nothing"):
        check_moved("a.csv", volts, NOISE)


def test_a_reading_that_stands_still_is_refused() -> None:
    volts = np.sin(TIME)
    with pytest.raises(InputError, match="displacement_um stays at 3 µm"):
        check_moved("a.csv", volts, np.full(2000, 3.0))


def test_a_reading_that_is_only_noise_is_refused() -> None:
    volts = np.sin(TIME)
    with pytest.raises(InputError, match=r"explains .* % of displacement_um"):
        check_answered("a.csv", volts, NOISE)


@pytest.mark.parametrize("lag", [0, 30])
def test_a_reading_that_follows_passes_in_noise_as_large_as_itself(lag: int) -> None:
    volts = np.sin(TIME)
    check_answered("a.csv", volts, np.roll(volts, lag) + NOISE)


@pytest.mark.parametrize("shape", ["sine", "triangle", "square"])
def test_one_cycle_over_and_over_is_seen(shape: str) -> None:
    phase = TIME / 1.6
    shapes = {
        "sine": np.sin(2 * np.pi * phase),
        "triangle": 2 * np.abs(2 * (phase % 1) - 1) - 1,
        "square": np.where(phase % 1 < 0.5, 1.0, -1.0),
    }
    volts = np.asarray(shapes[shape], dtype=np.float64)
    found = describe(TIME, volts, volts)
    assert found.single
    assert found.period_s == pytest.approx(1.6, rel=0.02)


def test_two_tones_and_a_growing_tone_are_not_one_cycle() -> None:
    for volts in (np.sin(2 * TIME) + np.sin(5.3 * TIME), np.sin(3 * TIME) * TIME, TIME):
        assert not describe(TIME, volts, volts).single


def test_noise_and_scatter_are_measured() -> None:
    cycle = np.sin(2 * np.pi * TIME / 2.0)
    noisy = cycle + 0.1 * NOISE
    assert describe(TIME, cycle, noisy).noise_um == pytest.approx(0.1, rel=0.15)
    assert cycle_scatter_um(TIME, noisy, 2.0) == pytest.approx(0.1, rel=0.15)
    assert cycle_scatter_um(TIME[:300], noisy[:300], 2.0) is None
