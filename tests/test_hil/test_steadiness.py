"""Limits that follow from how steadily readings come at rest."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_export.build import ensure_plant_fmu
from bender_hil.bench_file import OF_SENSOR, BenchFile, emulated_bench, read_bench
from bender_hil.guard.settings import GuardSettings
from bender_hil.runner import run as runner
from bender_hil.runner import steadiness
from bender_hil.runner.buffered import Buffered
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


def test_what_the_loop_would_have_seen_is_taken_at_rest():
    eyes = PlannedEyes(_times((20, 0.03)))
    seen = watched_at_rest(eyes, clock=eyes.clock)
    assert eyes.now_s == pytest.approx(1.5, abs=0.05)
    assert seen.usual_age_s == pytest.approx(1.0 / 30.0 + 0.005, abs=1e-6)
    assert seen.largest_age_s == pytest.approx(1.0 / 30.0 + 0.035, abs=1e-6)
    assert seen.largest_silence_s <= 0.026
    # what waited while the sensor was opened says nothing
    eyes = PlannedEyes(_times((2, 0.2)))
    assert watched_at_rest(eyes, clock=eyes.clock).largest_age_s < 0.05


def test_a_slow_sensor_is_watched_for_longer_and_one_that_gives_nothing_is_refused():
    eyes = PlannedEyes([0.2 * k for k in range(100)])
    assert watched_at_rest(eyes, clock=eyes.clock).readings == 15
    assert eyes.now_s == pytest.approx(3.3, abs=0.3)
    eyes = PlannedEyes([])
    with pytest.raises(UnsteadyError, match="0 readings in 10 s at rest"):
        watched_at_rest(eyes, clock=eyes.clock)
    eyes = PlannedEyes([])
    assert watched_at_rest(eyes, 0, clock=eyes.clock).largest_silence_s == pytest.approx(0.02)
    assert eyes.now_s < 1.6


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
