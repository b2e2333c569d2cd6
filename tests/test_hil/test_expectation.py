"""Runs that went wrong and ended of themselves, oscillation, and limits that follow from readings at rest."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from present import present

from bender_export.build import ensure_plant_fmu
from bender_hil.bench_file import OF_SENSOR, BenchFile, emulated_bench, read_bench
from bender_hil.guard.settings import GuardSettings
from bender_hil.log.ending import EndOfRun, conduct, last_line
from bender_hil.log.expectation import missing_frames, unexpected_behaviour
from bender_hil.log.read_run import RunLog
from bender_hil.log.results import write_results
from bender_hil.log.summary import summarise
from bender_hil.runner import run as runner
from bender_hil.runner import steadiness
from bender_hil.runner.buffered import Buffered
from bender_hil.runner.oscillation import EXCUSED, MOST, OscillationWatch, Ranges, Swings
from bender_hil.runner.program import OpenLoop
from bender_hil.runner.steadiness import (
    SPREAD,
    Steadiness,
    UnsteadyError,
    ceiling_s,
    facts,
    limits_sentence,
    steadied,
    watched_at_rest,
)
from bender_hil.runner.tip_camera import Sight
from bender_hil.runner.voltages import Voltages

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
    found = present(_trip(np.full(len(ticks), 20.0), tips))
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


CALM = Steadiness(40, 0.04, 0.047, 0.02, 0.025)
FOLLOWING = BenchFile(follows_sensor=OF_SENSOR)


class PlannedEyes:
    """Readings at planned times; a look ends when one has come, or when its patience does."""

    def __init__(self, times_s: Sequence[float], work_s: float = 0.005) -> None:
        self.now_s, self.work_s, self.times_s = 0.0, work_s, list(times_s)

    def clock(self) -> float:
        return self.now_s

    def zero(self, count: int) -> float:
        raise AssertionError(f"the rest position is not taken yet ({count})")

    def stalled_s(self) -> float:
        return 0.0

    def why_nothing(self) -> str:
        return ""

    def look(self, timeout_s: float) -> Sight | None:
        if not self.times_s or self.times_s[0] > self.now_s + timeout_s:
            self.now_s += timeout_s
            return None
        taken_s = self.times_s.pop(0)
        self.now_s = max(self.now_s, taken_s) + self.work_s
        return Sight(1, taken_s, 0, 0.0, 1.0, None, None)


def _times(*extra: tuple[int, float]) -> list[float]:
    """Thirty readings a second, some of them late."""
    late = dict(extra)
    return [k / 30.0 + late.get(k, 0.0) for k in range(400)]


def _watched(times_s: Sequence[float], fewest: int = 15) -> tuple[Steadiness, float]:
    """What is seen at rest, and how long that takes."""
    eyes = PlannedEyes(times_s)
    return watched_at_rest(eyes, fewest, clock=eyes.clock), eyes.now_s


def test_what_the_loop_would_have_seen_is_taken_at_rest():
    seen, took_s = _watched(_times((20, 0.03)))
    assert took_s == pytest.approx(1.5, abs=0.05)
    assert seen.usual_age_s == pytest.approx(1.0 / 30.0 + 0.005, abs=1e-6)
    assert seen.largest_age_s == pytest.approx(1.0 / 30.0 + 0.035, abs=1e-6)
    assert seen.largest_silence_s <= 0.026
    # what waited while the sensor was opened says nothing
    assert _watched(_times((2, 0.2)))[0].largest_age_s < 0.05


def test_a_slow_sensor_is_watched_for_longer_and_one_that_gives_nothing_is_refused():
    seen, took_s = _watched([0.2 * k for k in range(100)])
    assert (seen.readings, took_s) == (15, pytest.approx(3.3, abs=0.3))
    with pytest.raises(UnsteadyError, match="0 readings in 10 s at rest"):
        _watched([])
    seen, took_s = _watched([], 0)
    assert seen.largest_silence_s == pytest.approx(0.02)
    assert took_s < 1.6


@given(held_up_s=st.floats(0.3, 9.0), fewest=st.sampled_from([0, 15]))
def test_a_hold_up_in_the_first_turn_is_waited_out(held_up_s: float, fewest: int):
    eyes = PlannedEyes([held_up_s + k / 30.0 for k in range(400)])
    look = eyes.look

    def held_up(timeout_s: float) -> Sight | None:
        if eyes.now_s == 0.0:
            eyes.now_s = held_up_s
            return None
        return look(timeout_s)

    eyes.look = held_up
    seen = watched_at_rest(eyes, fewest, clock=eyes.clock)
    assert seen.usual_silence_s == pytest.approx(0.0167, abs=0.01)
    assert seen.largest_silence_s <= 0.026


def test_on_a_calm_machine_the_limits_are_the_defaults():
    assert steadied(FOLLOWING, CALM).guard == GuardSettings()
    assert limits_sentence(CALM, GuardSettings()) == (
        "at rest the newest reading is up to 47 ms old (usually 40 ms), the controller silent for up to 25 ms; the "
        "guard ends the run at 110 ms and 100 ms"
    )
    assert facts(CALM, GuardSettings())["frame_age_s"] == 0.11


def test_on_a_busy_machine_they_follow_and_beyond_the_ceiling_the_run_is_refused():
    busy = replace(CALM, largest_age_s=0.08, largest_silence_s=0.05)
    guard = steadied(FOLLOWING, busy).guard
    assert (guard.frame_age_s, guard.heartbeat_s) == (pytest.approx(0.2), pytest.approx(0.14))
    with pytest.raises(
        UnsteadyError, match=r"up to 130 ms old, a run would need 400 ms, safe are 250 ms; .*Nothing was"
    ):
        steadied(FOLLOWING, replace(CALM, largest_age_s=0.13))
    with pytest.raises(UnsteadyError, match="the controller was silent for up to 90 ms, a run would need 300 ms"):
        steadied(FOLLOWING, replace(CALM, largest_silence_s=0.09))


def test_a_limit_that_the_file_sets_stays_and_is_held_against_what_is_seen(tmp_path: Path):
    path = tmp_path / "bench.toml"
    path.write_text("[emulator]\n[guard]\nframe_age_s = 0.12\n")
    bench = read_bench(path)
    assert bench.follows_sensor == ("heartbeat_s",)
    busy = replace(CALM, largest_age_s=0.119, largest_silence_s=0.05)
    guard = steadied(bench, busy).guard
    assert (guard.frame_age_s, guard.heartbeat_s) == (0.12, pytest.approx(0.14))
    with pytest.raises(UnsteadyError, match=r"121 ms old, guard.frame_age_s allows 120 ms"):
        steadied(bench, replace(CALM, largest_age_s=0.121))
    assert steadied(bench, replace(CALM, largest_age_s=0.12)).guard.frame_age_s == 0.12
    assert emulated_bench().follows_sensor == OF_SENSOR
    # settings that were made in Python are meant as they are
    assert BenchFile().follows_sensor == ()


seconds = st.floats(0.001, 2.0)


@given(seconds, seconds, seconds, seconds, st.floats(0.05, 5.0), st.floats(0.05, 60.0))
def test_no_limit_is_ever_looser_than_its_default_or_the_ceiling(usual_s, more_s, quiet_s, later_s, settle_s, down_s):
    limits = GuardSettings(settle_s=settle_s, shutdown_limit_s=down_s)
    seen = Steadiness(40, usual_s, usual_s + more_s, quiet_s, quiet_s + later_s)
    bench = BenchFile(guard=limits, follows_sensor=OF_SENSOR)
    assert ceiling_s(limits) <= min(0.5, settle_s, down_s)
    try:
        guard = steadied(bench, seen).guard
    except UnsteadyError:
        needed = (usual_s + SPREAD * more_s, quiet_s + SPREAD * later_s)
        assert any(x > max(y, ceiling_s(limits)) - 1e-9 for x, y in zip(needed, (0.11, 0.1), strict=True))
        return
    for name, default_s in (("frame_age_s", 0.11), ("heartbeat_s", 0.1)):
        assert default_s <= getattr(guard, name) <= max(default_s, ceiling_s(limits))
        assert getattr(guard, name) >= seen.largest_s(name)
    # nothing else of the guard depends on the sensor
    assert replace(guard, frame_age_s=0.11, heartbeat_s=0.1) == limits


def test_a_run_is_judged_at_rest_unless_its_file_sets_both_limits_or_the_source_plays(monkeypatch):
    monkeypatch.setattr(steadiness, "watched_at_rest", lambda *_: CALM)
    program, said = OpenLoop(Voltages((0.0,), (0.0,), 1.0)), []
    bench, at_rest = runner._steadied(FOLLOWING, program, PlannedEyes([]), said.append)
    assert (bench, at_rest) == (FOLLOWING, facts(CALM, GuardSettings()))
    assert said == [limits_sentence(CALM, GuardSettings())]
    buffered = Buffered(program.voltages, 100.0)
    for case in ((BenchFile(), program), (FOLLOWING, buffered)):
        assert runner._steadied(*case, PlannedEyes([]), said.append) == (case[0], None)
    assert len(said) == 1


@pytest.mark.parametrize("held_up", [0, 1, 2, 3])
def test_one_hold_up_of_the_machine_refuses_no_run(held_up: int, monkeypatch: pytest.MonkeyPatch):
    bad = replace(CALM, largest_age_s=0.4)
    watched = iter([*[bad] * held_up, CALM])
    monkeypatch.setattr(steadiness, "watched_at_rest", lambda *_: next(watched))
    if held_up < 3:
        assert steadiness.steadied_at_rest(FOLLOWING, PlannedEyes([])) == (FOLLOWING, CALM)
        assert not list(watched)
    else:
        with pytest.raises(UnsteadyError, match="a run would need"):
            steadiness.steadied_at_rest(FOLLOWING, PlannedEyes([]))


@pytest.mark.slow
def test_a_run_is_refused_before_there_is_a_guard_and_leaves_nothing(tmp_path: Path, monkeypatch):
    pytest.importorskip("cv2")
    monkeypatch.setattr(steadiness, "watched_at_rest", lambda *_: replace(CALM, largest_age_s=0.2))
    monkeypatch.setattr(runner, "GuardProcess", lambda _: pytest.fail("a guard was started"))
    program = OpenLoop(Voltages((0.0,), (0.0,), 1.0))
    with pytest.raises(UnsteadyError, match="readings come too irregularly"):
        runner.run(emulated_bench(), program, tmp_path / "run", fmu=ensure_plant_fmu)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_limits_are_said_first_and_stand_in_the_log(tmp_path: Path):
    path = tmp_path / "bench.toml"
    path.write_text("[emulator]\n[guard]\nframe_age_s = 1.0\n")
    said: list[str] = []
    program = OpenLoop(Voltages((0.0,), (0.0,), 0.3))
    result = runner.run(read_bench(path), program, tmp_path / "run", fmu=ensure_plant_fmu, tell=said.append)
    start = result.log.start
    assert start["at_rest"]["frame_age_s"] == start["bench"]["guard"]["frame_age_s"] == 1.0
    assert start["at_rest"]["heartbeat_s"] == start["bench"]["guard"]["heartbeat_s"] >= 0.1
    assert said[0].startswith("at rest the newest reading is up to")


BENCH: dict[str, Any] = {
    "controller": {"response_um_per_V": 0.2, "slack_V": 10.0},
    "guard": {"maximum_V": 50.0, "minimum_V": 0.0, "travel_um": [-10.0, 45.0]},
}
PLANNED = EndOfRun(None, None, "", None)


def _log(tip_um: Any, command_V: Any, aim_um: Any = None, kept: list[bool] | None = None, mode: str = "") -> RunLog:
    """A run in closed loop where there is a set-point, one for all ticks or one for each."""
    count = len(tip_um)
    aims_um = [None] * count if aim_um is None else np.broadcast_to(aim_um, count).tolist()
    columns = zip(np.asarray(tip_um).tolist(), np.asarray(command_V).tolist(), aims_um, strict=True)
    rows = [
        {
            "kind": "tick", "sequence": k, "grabbed_s": 5.0 + PERIOD_S * k, "measured_um": tip, "setpoint_um": aim,
            "command_V": volts, "late": False, "skipped": 0,
        }
        for k, (tip, volts, aim) in enumerate(columns) if kept is None or kept[k]
    ]  # fmt: skip
    mode = mode or ("open_loop" if aim_um is None else "closed_loop")
    start = {"emulated": True, "period_s": PERIOD_S, "bench": BENCH, "program": {"mode": mode}}
    return RunLog(Path(), start, tuple(rows), (), ())


def _starting(log: RunLog, **facts: Any) -> RunLog:
    return replace(log, start=log.start | facts)


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


def test_the_line_of_a_run_judges_by_it(tmp_path: Path):
    stuck = _log(np.full(900, 3.0), (10.0 + 8.0 * np.sin(0.05 * np.arange(900))), None)
    assert unexpected_behaviour(stuck)
    line = write_results(tmp_path, stuck, None, PLANNED).line
    assert line == _line(stuck)
    assert line.startswith("not as planned")
    # of a run that is too short, or whose log does not say how it answers, nothing is said
    unknown = _starting(stuck, bench={"guard": BENCH["guard"]})
    assert unexpected_behaviour(replace(stuck, ticks=stuck.ticks[:3])) == unexpected_behaviour(unknown) == []


@given(
    seed=st.integers(0, 10_000), aim_um=st.floats(3.0, 22.0), noise_um=st.floats(0.0, 0.12),
    gain=st.floats(0.5, 1.0), log_creep=st.floats(0.0, 0.1),
)  # fmt: skip
def test_a_loop_that_works_is_as_planned(**told: Any):
    assert unexpected_behaviour(_loop(**told)) == []


@pytest.mark.parametrize(
    ("log", "words"),
    [
        (_loop(gain=-0.5), "against the command"),
        (_loop(gain=-0.5), "not reached"),
        (_loop(gain=0.3, limit_V=40.0), "not reached"),
        (_loop(stuck_at_um=8.0), "not reached"),
        (_loop(creep_um_per_s=1.5, seconds=8.0), "the command drifts"),
        (_log(28.0 + 0.3 * np.sin(np.arange(150) / 30.0), 30.0 - np.arange(150) / 30.0, 20.0), "not reached"),
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
    assert "not reached" in _line(_log(tip_um, command_V, 20.0, mode=mode))


def test_the_last_tenth_of_a_run_counts_and_not_its_last_moment():
    command_V = np.minimum(np.arange(150), 40)
    tip_um = 0.5 * command_V
    for late, is_reached in ((slice(-14, -3), False), (slice(-60, -20), True)):
        beside_um = tip_um.copy()
        beside_um[late] += 3.0
        found = unexpected_behaviour(_log(beside_um, command_V, 20.0))
        assert ("not reached" not in " ".join(found)) is is_reached


@pytest.mark.parametrize(("integral", "is_remarked"), [(0.0, False), (3.0, True)])
def test_the_inverse_of_a_model_alone_reaches_no_set_point_by_itself(integral: float, is_remarked: bool):
    volts = np.minimum(np.arange(150), 40)
    gains = {"proportional_V_per_um": 0.0, "integral_V_per_um_s": integral, "derivative_V_s_per_um": 0.0}
    program = {"mode": "model_following", "gains": {**gains, "filter_time_s": 0.1}}
    assert bool(unexpected_behaviour(_starting(_log(0.4 * volts, volts, 20.0), program=program))) is is_remarked


def test_a_set_point_that_never_rests_excuses_no_tip_that_goes_the_other_way():
    command_V = 20.0 - 20.0 * np.cos(PERIOD_S * np.arange(200))
    assert "against the command" in _line(_log(-0.4 * command_V, command_V, 0.4 * command_V))


@given(damping=st.floats(0.05, 0.5), frequency_Hz=st.floats(1.0, 6.0), rise=st.integers(1, 8))
def test_a_tip_that_swings_back_does_not_move_against_the_command(damping: float, frequency_Hz: float, rise: int):
    time_s = PERIOD_S * np.arange(180)
    swing = np.exp(-damping * 2.0 * np.pi * frequency_Hz * time_s) * np.cos(2.0 * np.pi * frequency_Hz * time_s)
    command_V = np.minimum(50.0, 50.0 / rise * np.arange(180))
    tip_um = 0.46 * np.convolve(np.diff(command_V, prepend=0.0), 1.0 - swing)[:180]
    line = _line(_log(tip_um, command_V, 40.0))
    assert "not reached" in line
    assert "against" not in line


@pytest.mark.parametrize("seed", range(5))
def test_a_recording_follows_no_command(seed: int):
    time_s = PERIOD_S * np.arange(240)
    command_V = 20.0 - 20.0 * np.cos(2.0 * np.pi * 0.4 * time_s)
    rng = np.random.default_rng(seed)
    recorded = 10.0 + 8.0 * np.sin(2.0 * np.pi * (0.9 + 0.1 * seed) * time_s) + 0.05 * rng.standard_normal(240)
    assert "does not follow" in _line(_log(recorded, command_V, None))
    delayed = 0.4 * (20.0 - 20.0 * np.cos(2.0 * np.pi * 0.4 * (time_s - 0.3)))
    assert _line(_log(delayed, command_V, None)).startswith("as planned")
    assert "against" in _line(_log((-delayed), command_V, None))


@given(
    seed=st.integers(0, 1000), gain=st.floats(0.3, 1.0), delay_s=st.floats(0.0, 0.3), noise_um=st.floats(0.0, 0.12),
    frequency_Hz=st.floats(0.1, 0.6), creep=st.floats(0.0, 0.15), dead_V=st.floats(0.0, 5.0),
)  # fmt: skip
def test_an_open_loop_that_works_is_as_planned(
    seed: int, gain: float, delay_s: float, noise_um: float, frequency_Hz: float, creep: float, dead_V: float
):
    time_s = PERIOD_S * np.arange(300)
    noise = noise_um * np.random.default_rng(seed).standard_normal(300)
    for command_V in (20.0 - 20.0 * np.cos(2.0 * np.pi * frequency_Hz * time_s), np.minimum(time_s * 10.0, 40.0)):
        acting_V = np.interp(time_s - delay_s, time_s, np.maximum(command_V - dead_V, 0.0))
        slow_um = creep * gain * acting_V.max() * np.log1p(time_s / 0.5) / math.log1p(10.0 / 0.5)
        line = _line(_log((gain * acting_V + slow_um + noise), command_V, None))
        assert line.startswith("as planned")


@given(seed=st.integers(0, 1000), share=st.floats(0.2, 0.8), frequency_Hz=st.floats(0.3, 0.6))
def test_a_tip_that_sticks_at_any_moment_is_not_as_planned(seed: int, share: float, frequency_Hz: float):
    time_s = PERIOD_S * np.arange(300)
    command_V = 20.0 - 20.0 * np.cos(2.0 * np.pi * frequency_Hz * time_s)
    tip_um = 0.4 * command_V
    tip_um[round(share * 300) :] = tip_um[round(share * 300)]
    tip_um += 0.1 * np.random.default_rng(seed).standard_normal(300)
    assert _line(_log(tip_um, command_V, None)).startswith("not as planned")


def test_a_tip_that_sticks_for_a_while_is_told_with_the_time():
    time_s = PERIOD_S * np.arange(300)
    command_V = 20.0 - 20.0 * np.cos(np.pi * time_s)
    tip_um = 0.4 * command_V
    tip_um[100:160] = tip_um[100]
    line = _line(_log(tip_um, command_V, None))
    assert "did not move from 3.3 to 5.3 s, while the command went 36.2 V" in line


@pytest.mark.parametrize("rate_um_per_s", [0.6, -1.0, 1.2])
def test_a_wire_that_creeps_away_in_an_open_loop_is_told_and_creep_that_slows_down_is_not(rate_um_per_s: float):
    time_s = PERIOD_S * np.arange(600)
    command_V = 20.0 - 20.0 * np.cos(np.pi * time_s)
    wire_um = 0.4 * command_V + rate_um_per_s * time_s
    assert "it creeps, or what looks at it moves" in _line(_log(wire_um, command_V, None))
    material_um = 0.4 * command_V + 8.0 * rate_um_per_s * (1.0 - np.exp(-time_s / 4.0))
    assert _line(_log(material_um, command_V, None)).startswith("as planned")


@given(
    seed=st.integers(0, 1000), delay_s=st.floats(0.0, 0.4), share=st.floats(0.75, 1.2), frequency_Hz=st.floats(0.1, 0.5)
)
def test_a_loop_that_follows_moving_set_points_late_is_as_planned(
    seed: int, delay_s: float, share: float, frequency_Hz: float
):
    time_s = PERIOD_S * np.arange(300)
    aim_um = 10.0 - 8.0 * np.cos(2.0 * np.pi * frequency_Hz * time_s)
    tip_um = 10.0 + share * (np.interp(time_s - delay_s, time_s, aim_um) - 10.0)
    tip_um += 0.1 * np.random.default_rng(seed).standard_normal(300)
    assert _line(_log(tip_um, tip_um / 0.4, aim_um)).startswith("as planned")


@pytest.mark.parametrize("how", ["saturated", "half the gain", "beside", "the first of two"])
def test_a_loop_that_misses_moving_set_points_is_not_as_planned(how: str):
    time_s = PERIOD_S * np.arange(300)
    aim_um = 12.0 - 8.0 * np.cos(2.0 * np.pi * 0.3 * time_s)
    steps_um = np.where(time_s < 4.0, 10.0, 20.0)
    aim_um, tip_um = {
        "saturated": (aim_um, np.minimum(aim_um, 8.0)),
        "half the gain": (aim_um, 0.5 * aim_um),
        "beside": (aim_um, aim_um + 5.0),
        "the first of two": (steps_um, np.where(time_s < 4.0, 3.0, 20.0)),
    }[how]
    assert "the set-points were missed by" in _line(_log(tip_um, tip_um / 0.4, aim_um))


@given(seed=st.integers(0, 1000), share=st.floats(0.05, 0.5))
def test_missing_frames_are_counted(seed: int, share: float):
    kept = [True, *(np.random.default_rng(seed).uniform(size=298) > share), True]
    log = _log([0.0] * 300, [0.0] * 300, None, kept)
    assert missing_frames(log) == 300 - sum(kept)
    assert f"{300 - sum(kept)} readings missing" in _line(log)


def test_a_camera_a_little_beside_its_rate_misses_nothing():
    log = _log([0.0] * 100, [0.0] * 100, None)
    slow = [{**tick, "grabbed_s": 1.2 * tick["grabbed_s"]} for tick in log.ticks]
    assert missing_frames(replace(log, ticks=tuple(slow))) == missing_frames(replace(log, ticks=())) == 0


def test_a_bench_that_expects_nothing_is_told_nothing_of_the_direction():
    log = _log([0.0] * 100, np.linspace(0.0, 40.0, 100))
    assert unexpected_behaviour(log) != []
    quiet = {**BENCH, "controller": {"response_um_per_V": 0.0, "slack_V": 10.0}}
    assert unexpected_behaviour(_starting(log, bench=quiet)) == []
