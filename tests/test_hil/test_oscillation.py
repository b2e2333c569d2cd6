"""Oscillation is told from ringing, from following and from noise."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.runner.oscillation import EXCUSED, MOST, OscillationWatch, Ranges, Swings

RANGES = Ranges(55.0, 50.0)
PERIOD_S = 1.0 / 30.0


def _trip(setpoints, tips, commands=None) -> int | None:
    """Number of ticks until the watch speaks, None for never."""
    watch = OscillationWatch(RANGES)
    commands = np.zeros(len(tips)) if commands is None else commands
    for k, (aim, tip, command) in enumerate(zip(setpoints, tips, commands, strict=True)):
        if watch.add(float(aim), None if math.isnan(tip) else float(tip), float(command)) is not None:
            return k + 1
    return None


@given(st.floats(1.0, 20.0), st.lists(st.booleans(), min_size=1, max_size=40))
def test_swings_are_counted_between_turning_points(height: float, ways: list[bool]):
    swings, level, count = Swings(1.0), 0.0, 0
    for way in ways:
        level += height if way else -height
        count += swings.add(level)
    assert count == 1 + sum(one is not other for one, other in itertools.pairwise(ways))


@given(st.floats(4.0, 60.0), st.floats(3.0, 25.0), st.floats(0.0, 6.0))
def test_a_sustained_oscillation_ends_within_the_swings_that_are_allowed(frames: float, amplitude: float, phase: float):
    ticks = np.arange(round(frames * (EXCUSED + MOST)))
    tips = 20.0 + amplitude * np.sin(2.0 * math.pi * ticks / frames + phase)
    found = _trip(np.full(len(ticks), 20.0), tips)
    assert found is not None
    # a turning point lies up to a tick beside a reading, and is seen a tick after it
    assert found <= 0.5 * frames * (EXCUSED + MOST + 1) + 2


@given(st.floats(0.1, 3.0), st.floats(-40.0, 55.0), st.floats(1.0, 4.0))
def test_quarter_decay_is_ringing(period_s: float, step_um: float, dwell_periods: float):
    # steps there and back for ever, each answered with quarter decay: an overshoot of half the step, and so on
    dwell_s = dwell_periods * period_s
    times = np.arange(0.0, 12.0 * dwell_s, PERIOD_S)
    tread = np.floor(times / dwell_s)
    aims = np.where(tread % 2 == 0, step_um, 0.0)
    decay = 2.0 * math.log(2.0) / period_s
    tips = np.zeros(len(times))
    for start in range(int(tread[-1]) + 1):
        since = times - start * dwell_s
        change = step_um if start % 2 == 0 else -step_um
        answer = 1.0 - np.exp(-decay * since) * np.cos(2.0 * math.pi * since / period_s)
        tips += np.where(since >= 0.0, change * answer, 0.0)
    assert _trip(aims, tips, tips / 1.2) is None


@given(st.floats(0.05, 5.0), st.floats(1.0, 20.0), st.floats(0.5, 2.0), st.floats(0.0, 3.0))
def test_following_a_sine_is_no_oscillation(hertz: float, amplitude: float, magnified: float, lag: float):
    times = np.arange(0.0, 60.0, PERIOD_S)
    aims = 22.0 + amplitude * np.sin(2.0 * math.pi * hertz * times)
    tips = 22.0 + magnified * amplitude * np.sin(2.0 * math.pi * hertz * times - lag)
    if amplitude * 2.0 >= 2.75:
        assert _trip(aims, tips) is None


def test_an_oscillation_on_a_moving_set_point_is_found():
    times = np.arange(0.0, 20.0, PERIOD_S)
    aims = 22.0 + 10.0 * np.sin(2.0 * math.pi * 0.5 * times)
    assert _trip(aims, aims + 3.0 * np.sin(2.0 * math.pi * 6.0 * times)) is not None
    assert _trip(aims, aims + 0.5 * np.sin(2.0 * math.pi * 6.0 * times)) is None


def test_the_command_alone_is_enough():
    commands = np.where(np.arange(40) % 2 == 0, 20.0, 27.5)
    assert _trip(np.full(40, 5.0), np.full(40, 5.0), commands) == pytest.approx(EXCUSED + MOST, abs=2)


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_none(seed: int):
    rng = np.random.default_rng(seed)
    tips = 20.0 + 0.3 * rng.standard_normal(20_000)
    assert _trip(np.full(20_000, 20.0), tips, 40.0 + 0.2 * rng.standard_normal(20_000)) is None


def test_a_lost_tip_swings_nowhere():
    assert _trip(np.full(60, 20.0), np.full(60, math.nan)) is None
