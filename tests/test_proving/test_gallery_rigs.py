"""The rigs of the gallery obey the laws that their equations imply."""

from few import few
import math

import numpy as np
import pytest

from bender_proving.gallery import RIGS, damper, duffing, servo, tanks, thermocouple, valve
from bender_proving.gallery.played import integrated, levels


@pytest.mark.parametrize("name", few(list(RIGS), 0, 3))
def test_a_record_begins_at_rest_and_is_the_same_for_the_same_seed(name: str) -> None:
    rig = RIGS[name]
    first, again, other = (rig.play(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first.time_s.size == first.drive.size == first.reading.size > 500
    assert np.all(np.diff(first.time_s) > 0.0)
    assert first.drive[0] == 0.0
    assert abs(float(first.reading[0])) < 0.05 * float(np.ptp(first.reading))
    np.testing.assert_array_equal(first.reading, again.reading)
    assert not np.array_equal(first.drive, other.drive)


def test_levels_begin_at_rest_and_are_held() -> None:
    np.testing.assert_array_equal(levels(np.array([1.0, 2.0]), 30), [0.0] * 3 + [1.0] * 30 + [2.0] * 30)


def test_a_lag_behind_a_lag_is_what_its_step_response_says() -> None:
    time_s = np.arange(200.0)
    power = np.where(time_s >= 10.0, 30.0, 0.0)
    states = integrated(thermocouple.slope, np.zeros(2), time_s, power, 5.0)
    age_s = np.maximum(time_s - 10.0, 0.0)
    slow, fast = thermocouple.OVEN_S, thermocouple.SHEATH_S
    lagged = 1.0 - (slow * np.exp(-age_s / slow) - fast * np.exp(-age_s / fast)) / (slow - fast)
    np.testing.assert_allclose(states[:, 1], 60.0 * lagged, atol=1e-5)


def test_the_oscillator_conserves_its_energy_without_damping(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(duffing, "DAMPING", 0.0)
    time_s = 0.01 * np.arange(300.0)
    x, v = integrated(duffing.slope, np.array([3.0, 0.0]), time_s, np.zeros(300), 0.05).T
    w = 2.0 * math.pi * duffing.FREQUENCY_HZ
    energy = 0.5 * v**2 + w**2 * (0.5 * x**2 + 0.25 * duffing.CUBIC_PER_MM2 * x**4)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-4)


def test_the_servo_rests_short_of_its_target_by_no_more_than_breaking_away_takes() -> None:
    time_s = servo.ROW_S * np.arange(200.0)
    states = integrated(servo.slope, np.zeros(3), time_s, np.full(200, 0.02), 0.05)
    short_m = 0.02 - states[-1, 0]
    assert 0.0 < abs(short_m) <= servo.BREAKAWAY_N / servo.STIFFNESS_N_PER_M
    assert abs(states[-1, 1]) < 1e-4


def test_the_upper_tank_is_never_above_its_rim_and_the_levels_rest_where_torricelli_says() -> None:
    time_s = np.arange(2000.0)
    start = np.array([tanks.UPPER_CM, tanks.LOWER_CM])
    resting = integrated(tanks.slope, start, time_s, np.zeros(2000), 0.5, "RK23")
    np.testing.assert_allclose(resting, np.broadcast_to(start, resting.shape), rtol=1e-4)
    flooded = integrated(tanks.slope, start, time_s, np.full(2000, 2.0), 0.5, "RK23")
    assert flooded[:, 0].max() <= tanks.FULL + 1e-3
    assert flooded[-1, 1] == pytest.approx(tanks.FULL * (tanks.INTO_LOWER / tanks.OUT_LOWER) ** 2, rel=1e-3)


def test_the_valve_lets_nothing_through_within_its_overlap() -> None:
    record = valve.play(np.random.default_rng(3))
    still = np.abs(record.drive) < 0.5 * valve.OVERLAP_V
    # levels after which the spool has settled
    settled = np.zeros(still.size, dtype=bool)
    settled[np.flatnonzero(np.append(np.diff(record.drive) != 0.0, True))] = True
    assert np.abs(record.reading[still & settled]).max() < 5.0 * valve.NOISE_LPM
    open_rows = settled & (np.abs(record.drive) > 2.0 * valve.OVERLAP_V)
    expected = valve.GAIN_LPM_PER_V * (np.abs(record.drive[open_rows]) - valve.OVERLAP_V)
    np.testing.assert_allclose(np.abs(record.reading[open_rows]), expected, atol=5.0 * valve.NOISE_LPM)


def test_the_damper_holds_what_its_slider_holds_and_passes_nothing_on_in_its_gap() -> None:
    there = np.linspace(0.0, 20.0, 2001)
    back = there[::-1][1:]
    force = damper.forces_kN(np.concatenate([there, back]))
    assert force[2000] == pytest.approx(damper.SLIDING_KN, rel=1e-3)
    unloaded = force[2001:]
    free_mm = 20.0 - back[np.abs(unloaded) < 1e-9]
    # released by what pressed the contacts, then both gaps are crossed
    pressed = (damper.SLIDING_KN / damper.STIFFNESS_KN) ** (2.0 / 3.0)
    assert free_mm[0] == pytest.approx(pressed, abs=0.02)
    assert np.ptp(free_mm) == pytest.approx(2.0 * damper.GAP_MM, abs=0.02)
    assert unloaded[-1] == pytest.approx(-damper.SLIDING_KN, rel=1e-3)
