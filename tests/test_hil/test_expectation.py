"""Runs that nothing ended and that went wrong: the last line says so, and says nothing of runs that went well."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.log.ending import EndOfRun, conduct, last_line
from bender_hil.log.expectation import missing_frames, unexpected
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import summarise

PERIOD_S = 1.0 / 30.0
BENCH: dict[str, Any] = {
    "controller": {"response_um_per_V": 0.2, "slack_V": 10.0},
    "guard": {"maximum_V": 50.0, "minimum_V": 0.0, "travel_um": [-10.0, 45.0]},
}
PLANNED = EndOfRun(None, None, "", None)


def _log(tip_um: list[float], command_V: list[float], aim_um: float | None, kept: list[bool] | None = None) -> RunLog:
    rows = [
        {
            "kind": "tick", "sequence": k, "grabbed_s": 5.0 + PERIOD_S * k, "measured_um": tip, "setpoint_um": aim_um,
            "command_V": volts, "late": False, "skipped": 0,
        }
        for k, (tip, volts) in enumerate(zip(tip_um, command_V, strict=True)) if kept is None or kept[k]
    ]  # fmt: skip
    mode = "open_loop" if aim_um is None else "closed_loop"
    start = {"emulated": True, "period_s": PERIOD_S, "bench": BENCH, "program": {"mode": mode}}
    return RunLog(Path(), start, tuple(rows), (), ())


def _loop(
    seconds: float = 5.0, aim_um: float = 20.0, gain: float = 0.5, noise_um: float = 0.05, creep_um_per_s: float = 0.0,
    stuck_at_um: float = math.inf, log_creep: float = 0.0, seed: int = 1, limit_V: float = 50.0,
) -> RunLog:  # fmt: skip
    """An integrating loop around a gain with a lag, seen with noise."""
    rng = np.random.default_rng(seed)
    volts = plant = 0.0
    tips, commands = [], []
    for k in range(round(seconds / PERIOD_S)):
        slow = gain * volts * log_creep * math.log1p(k * PERIOD_S / 0.5)
        plant += 0.4 * (gain * volts + slow - plant)
        tip = min(plant, stuck_at_um) + creep_um_per_s * k * PERIOD_S + noise_um * rng.standard_normal()
        volts = min(limit_V, max(0.0, volts + 0.3 * (aim_um - tip)))
        tips.append(float(tip))
        commands.append(volts)
    return _log(tips, commands, aim_um)


def _line(log: RunLog) -> str:
    return last_line(conduct(summarise(log), 0, None, unexpected(log)), PLANNED)


@given(
    seed=st.integers(0, 10_000), aim_um=st.floats(3.0, 22.0), noise_um=st.floats(0.0, 0.12),
    gain=st.floats(0.5, 1.0), log_creep=st.floats(0.0, 0.1),
)  # fmt: skip
def test_a_loop_that_works_is_as_planned(seed: int, aim_um: float, noise_um: float, gain: float, log_creep: float):
    assert unexpected(_loop(seed=seed, aim_um=aim_um, noise_um=noise_um, gain=gain, log_creep=log_creep)) == []


@pytest.mark.parametrize(
    ("log", "words"),
    [
        (_loop(gain=-0.5), "against the command"),
        (_loop(gain=-0.5), "not reached"),
        (_loop(gain=0.3, limit_V=40.0), "not reached"),
        (_loop(stuck_at_um=8.0), "not reached"),
        (_loop(creep_um_per_s=1.5, seconds=8.0), "creeps away"),
    ],
)
def test_a_loop_that_fails_is_not_as_planned(log: RunLog, words: str):
    line = _line(log)
    assert line.startswith("not as planned")
    assert words in line


@pytest.mark.parametrize("seed", range(5))
def test_a_recording_follows_no_command(seed: int):
    time_s = PERIOD_S * np.arange(240)
    command_V = (20.0 - 20.0 * np.cos(2.0 * np.pi * 0.4 * time_s)).tolist()
    rng = np.random.default_rng(seed)
    recorded = 10.0 + 8.0 * np.sin(2.0 * np.pi * (0.9 + 0.1 * seed) * time_s) + 0.05 * rng.standard_normal(240)
    assert "does not follow" in _line(_log(recorded.tolist(), command_V, None))
    delayed = 0.4 * (20.0 - 20.0 * np.cos(2.0 * np.pi * 0.4 * (time_s - 0.3)))
    assert _line(_log(delayed.tolist(), command_V, None)).startswith("as planned")
    assert "against" in _line(_log((-delayed).tolist(), command_V, None))


def test_a_recording_in_a_loop_is_not_where_it_should_be():
    time_s = PERIOD_S * np.arange(150)
    recorded = 28.0 + 0.3 * np.sin(time_s)
    assert "not reached" in _line(_log(recorded.tolist(), (30.0 - time_s).tolist(), 20.0))


@given(seed=st.integers(0, 1000), share=st.floats(0.05, 0.5))
def test_missing_frames_are_counted(seed: int, share: float):
    kept = [True, *(np.random.default_rng(seed).uniform(size=298) > share).tolist(), True]
    log = _log([0.0] * 300, [0.0] * 300, None, kept)
    assert missing_frames(log) == 300 - sum(kept)
    assert f"{300 - sum(kept)} frames missing" in _line(log)


def test_a_camera_a_little_beside_its_rate_misses_nothing():
    log = _log([0.0] * 100, [0.0] * 100, None)
    slow = [{**tick, "grabbed_s": 1.2 * tick["grabbed_s"]} for tick in log.ticks]
    assert missing_frames(RunLog(Path(), log.start, tuple(slow), (), ())) == 0
    assert missing_frames(RunLog(Path(), log.start, (), (), ())) == 0


def test_a_bench_that_expects_nothing_is_told_nothing_of_the_direction():
    log = _log([0.0] * 100, list(np.linspace(0.0, 40.0, 100)), None)
    assert unexpected(log) != []
    quiet = {**log.start, "bench": {**BENCH, "controller": {"response_um_per_V": 0.0, "slack_V": 10.0}}}
    assert unexpected(RunLog(Path(), quiet, log.ticks, (), ())) == []
