"""Runs that nothing ended and that went wrong: the last line says so, and says nothing of runs that went well."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.log.ending import EndOfRun, conduct, last_line
from bender_hil.log.expectation import missing_frames, unexpected_behaviour
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import summarise

PERIOD_S = 1.0 / 30.0
BENCH: dict[str, Any] = {
    "controller": {"response_um_per_V": 0.2, "slack_V": 10.0},
    "guard": {"maximum_V": 50.0, "minimum_V": 0.0, "travel_um": [-10.0, 45.0]},
}
PLANNED = EndOfRun(None, None, "", None)


def _log(
    tip_um: list[float], command_V: list[float], aim_um: float | None, kept: list[bool] | None = None, mode: str = ""
) -> RunLog:
    rows = [
        {
            "kind": "tick", "sequence": k, "grabbed_s": 5.0 + PERIOD_S * k, "measured_um": tip, "setpoint_um": aim_um,
            "command_V": volts, "late": False, "skipped": 0,
        }
        for k, (tip, volts) in enumerate(zip(tip_um, command_V, strict=True)) if kept is None or kept[k]
    ]  # fmt: skip
    mode = mode or ("open_loop" if aim_um is None else "closed_loop")
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
    return last_line(conduct(summarise(log), 0, None, unexpected_behaviour(log)), PLANNED)


@given(
    seed=st.integers(0, 10_000), aim_um=st.floats(3.0, 22.0), noise_um=st.floats(0.0, 0.12),
    gain=st.floats(0.5, 1.0), log_creep=st.floats(0.0, 0.1),
)  # fmt: skip
def test_a_loop_that_works_is_as_planned(seed: int, aim_um: float, noise_um: float, gain: float, log_creep: float):
    assert (
        unexpected_behaviour(_loop(seed=seed, aim_um=aim_um, noise_um=noise_um, gain=gain, log_creep=log_creep)) == []
    )


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


@pytest.mark.parametrize("mode", ["closed_loop", "model_following", "controller_fmu"])
def test_whatever_the_controller_a_set_point_is_to_be_reached(mode: str):
    time_s = PERIOD_S * np.arange(150)
    tip_um = np.minimum(30.0 * time_s, 8.0)
    command_V = np.minimum(60.0 * time_s, 50.0)
    assert "not reached" in _line(_log(tip_um.tolist(), command_V.tolist(), 20.0, mode=mode))


def test_the_last_tenth_of_a_run_counts_and_not_its_last_moment():
    command_V = np.minimum(np.arange(150), 40)
    tip_um = 0.5 * command_V
    for late, is_reached in ((slice(-14, -3), False), (slice(-60, -20), True)):
        beside_um = tip_um.copy()
        beside_um[late] += 3.0
        found = unexpected_behaviour(_log(beside_um.tolist(), command_V.tolist(), 20.0))
        assert ("not reached" not in " ".join(found)) is is_reached


def test_the_inverse_of_a_model_alone_reaches_no_set_point_by_itself():
    log = _log([0.4 * min(k, 40) for k in range(150)], [min(k, 40) for k in range(150)], 20.0, mode="model_following")
    gains = {"proportional_V_per_um": 0.0, "integral_V_per_um_s": 0.0, "derivative_V_s_per_um": 0.0}
    for integral, is_remarked in ((0.0, False), (3.0, True)):
        told = {**log.start["program"], "gains": {**gains, "integral_V_per_um_s": integral, "filter_time_s": 0.1}}
        assert (
            bool(unexpected_behaviour(RunLog(Path(), {**log.start, "program": told}, log.ticks, (), ()))) is is_remarked
        )


def test_a_set_point_that_never_rests_excuses_no_tip_that_goes_the_other_way():
    time_s = PERIOD_S * np.arange(200)
    command_V = 20.0 - 20.0 * np.cos(time_s)
    log = _log((-0.4 * command_V).tolist(), command_V.tolist(), None, mode="closed_loop")
    moving = [{**tick, "setpoint_um": 0.4 * volts} for tick, volts in zip(log.ticks, command_V, strict=True)]
    assert "against the command" in _line(RunLog(Path(), log.start, tuple(moving), (), ()))


@given(damping=st.floats(0.05, 0.5), frequency_Hz=st.floats(1.0, 6.0), rise=st.integers(1, 8))
def test_a_tip_that_swings_back_does_not_move_against_the_command(damping: float, frequency_Hz: float, rise: int):
    time_s = PERIOD_S * np.arange(180)
    swing = np.exp(-damping * 2.0 * np.pi * frequency_Hz * time_s) * np.cos(2.0 * np.pi * frequency_Hz * time_s)
    command_V = np.minimum(50.0, 50.0 / rise * np.arange(180))
    tip_um = 0.46 * np.convolve(np.diff(command_V, prepend=0.0), 1.0 - swing)[:180]
    line = _line(_log(tip_um.tolist(), command_V.tolist(), 40.0))
    assert "not reached" in line
    assert "against" not in line


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
    assert unexpected_behaviour(log) != []
    quiet = {**log.start, "bench": {**BENCH, "controller": {"response_um_per_V": 0.0, "slack_V": 10.0}}}
    assert unexpected_behaviour(RunLog(Path(), quiet, log.ticks, (), ())) == []
