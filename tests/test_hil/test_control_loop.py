"""The loop between eyes and a guard that are scripts: no process, no clock to wait for."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.log.journal import Journal, read_journal
from bender_hil.runner.control_law import LONGEST_DT_S, Memory, decide
from bender_hil.runner.foreign_program import ForeignLoop
from bender_hil.runner.frames import FrameRing
from bender_hil.runner.loop import ControlLoop, LoopEnd, LoopSettings
from bender_hil.runner.program import ClosedLoop, OpenLoop, Program
from bender_hil.runner.tip_camera import Sight
from bender_hil.runner.voltages import Voltages, read_profile_file, sine, staircase
from bender_loop.control import pid
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Profile, Step
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.process.watched import WatchedController

IMAGE = np.zeros((4, 4), np.uint8)


@dataclass
class ScriptedEyes:
    sights: list[Sight | None]
    stalled: float = 0.0
    place: int = 0

    def zero(self, count: int) -> float:
        return 0.0

    def look(self, timeout_s: float) -> Sight | None:
        if self.place == len(self.sights):
            self.stalled = 1.0
            return None
        self.place += 1
        return self.sights[self.place - 1]

    def stalled_s(self) -> float:
        return self.stalled

    def why_nothing(self) -> str:
        return ""


@dataclass
class ScriptedGuard:
    commands: list[tuple[int, float, float, float | None]] = field(default_factory=list)
    beats: int = 0
    trips: list[str] = field(default_factory=list)
    trips_after: int = 10**9

    def command(self, sequence: int, voltage_V: float, frame_s: float, tip_um: float | None) -> None:
        self.commands.append((sequence, voltage_V, frame_s, tip_um))

    def beat(self) -> None:
        self.beats += 1

    def trip(self, code: str, sentence: str) -> None:
        self.trips.append(code)

    def has_tripped(self) -> bool:
        return len(self.commands) >= self.trips_after


def _sight(number: int, grabbed_s: float, tip_um: float | None) -> Sight:
    return Sight(number, grabbed_s, 0, tip_um, 0.9, None if tip_um is not None else "dark", IMAGE)


def _run(tmp_path: Path, eyes: ScriptedEyes, guard: ScriptedGuard, program: Program) -> LoopEnd:
    journal = Journal(tmp_path / "run.jsonl")
    try:
        loop = ControlLoop(eyes, guard, program, journal, FrameRing(), LoopSettings(1 / 30, 0.1))
        return loop.run(100.0)
    finally:
        journal.close()


def test_the_pid_block_gets_measured_time_and_nothing_else(tmp_path: Path):
    grabbed = [100.033, 100.071, 100.099, 100.171]
    tips = [0.0, 0.4, 1.1, 2.0]
    gains = Gains(0.1, 3.0, 0.005, 0.02)
    guard = ScriptedGuard()
    eyes = ScriptedEyes([_sight(k, t, tip) for k, (t, tip) in enumerate(zip(grabbed, tips, strict=True))])
    end = _run(tmp_path, eyes, guard, ClosedLoop(Step(5.0), gains, Limits(), math.inf, 10.0))
    assert end.ticks == 4
    state, expected, before = pid.PidState(), [], 100.0
    for now, tip in zip(grabbed, tips, strict=True):
        state, command = pid.step(gains, Limits(), state, 5.0, tip, now - before)
        before = now
        expected.append(command)
    assert [command[1] for command in guard.commands] == expected
    assert [command[2] for command in guard.commands] == grabbed


@pytest.mark.parametrize(("deadline_s", "is_late"), [(1e9, False), (0.0, True)])
def test_a_tick_is_late_after_its_deadline(tmp_path: Path, deadline_s: float, is_late: bool):
    journal = Journal(tmp_path / "run.jsonl")
    eyes, program = ScriptedEyes([_sight(0, 0.01, 1.0)]), OpenLoop(Voltages((0.0,), (1.0,), 10.0))
    ControlLoop(eyes, ScriptedGuard(), program, journal, FrameRing(), LoopSettings(deadline_s, 0.1)).run(0.0)
    journal.close()
    assert [x["late"] for x in read_journal(tmp_path / "run.jsonl") if x["kind"] == "tick"] == [is_late]


@dataclass
class Listener(OpenLoop):
    heard_s: list[float] = field(default_factory=list)

    def acted(self, delay_s: float) -> None:
        self.heard_s.append(delay_s)


def test_a_programme_hears_what_the_log_says_of_when_its_commands_went(tmp_path: Path):
    program = Listener(Voltages((0.0,), (1.0,), 10.0))
    _run(tmp_path, ScriptedEyes([_sight(k, 100.0 + 0.03 * (k + 1), None) for k in range(3)]), ScriptedGuard(), program)
    entries = read_journal(tmp_path / "run.jsonl")
    assert program.heard_s == [x["sent_s"] - x["grabbed_s"] for x in entries if x["kind"] == "tick"]


def test_a_lost_tip_holds_the_command(tmp_path: Path):
    guard = ScriptedGuard()
    sights: list[Sight | None] = [_sight(k, 100.0 + 0.03 * (k + 1), None if k in (2, 3) else 1.0) for k in range(6)]
    _run(tmp_path, ScriptedEyes(sights), guard, ClosedLoop(Step(5.0), Gains(0.0, 3.0), Limits(), 225.0, 10.0))
    volts = [command[1] for command in guard.commands]
    assert volts[1] == volts[2] == volts[3] < volts[4]
    assert [command[3] is None for command in guard.commands] == [False, False, True, True, False, False]


def test_a_programme_that_fails_ends_the_run_as_a_rule_does(tmp_path: Path):
    class Failing(OpenLoop):
        def decide(self, time_s: float, dt_s: float, measured_um: float | None):
            if time_s > 0.05:
                raise RunError("mine.fmu: the command is nan V")
            return super().decide(time_s, dt_s, measured_um)

    guard = ScriptedGuard()
    eyes = ScriptedEyes([_sight(k, 100.0 + (k + 1) / 30.0, 0.0) for k in range(30)])
    end = _run(tmp_path, eyes, guard, Failing(Voltages((0.0,), (1.0,), 1.0)))
    assert end.trip == ("controller_failed", "mine.fmu: the command is nan V")
    assert guard.trips == ["controller_failed"]
    assert len(guard.commands) == end.ticks == 2
    assert list(read_journal(tmp_path / "run.jsonl"))[-1]["kind"] == "ended_by_controller"


def test_silence_is_filled_with_beats_and_a_stalled_camera_ends_the_run(tmp_path: Path):
    guard = ScriptedGuard()
    end = _run(tmp_path, ScriptedEyes([None, None, _sight(0, 100.03, 0.0), None]), guard, OpenLoop(staircase()))
    assert guard.beats == 3
    assert guard.trips == ["camera_stalled"]
    assert end.trip is not None


def test_the_programme_ends_by_the_camera_s_clock(tmp_path: Path):
    guard = ScriptedGuard()
    sights: list[Sight | None] = [_sight(k, 101.0 + 0.25 * k, 0.0) for k in range(20)]
    end = _run(tmp_path, ScriptedEyes(sights), guard, OpenLoop(Voltages((0.0,), (3.0,), 1.0)))
    assert end == LoopEnd(4, None)
    assert guard.trips == []


def test_a_frame_that_is_not_newer_is_none(tmp_path: Path):
    guard = ScriptedGuard()
    sights: list[Sight | None] = [_sight(0, 99.0, 0.0), _sight(1, 100.1, 0.0), _sight(2, 100.1, 0.0)]
    assert _run(tmp_path, ScriptedEyes(sights), guard, OpenLoop(staircase())).ticks == 1


def test_the_guard_ends_the_loop(tmp_path: Path):
    guard = ScriptedGuard(trips_after=3)
    sights: list[Sight | None] = [_sight(k, 100.0 + 0.03 * (k + 1), 0.0) for k in range(9)]
    assert _run(tmp_path, ScriptedEyes(sights), guard, OpenLoop(staircase())) == LoopEnd(3, None)


def test_every_tick_is_in_the_journal(tmp_path: Path):
    sights: list[Sight | None] = [_sight(k, 100.0 + 0.05 * (k + 1), 0.1 * k) for k in range(5)]
    _run(tmp_path, ScriptedEyes(sights), ScriptedGuard(), OpenLoop(staircase()))
    ticks = [entry for entry in read_journal(tmp_path / "run.jsonl") if entry["kind"] == "tick"]
    assert [entry["measured_um"] for entry in ticks] == [0.1 * k for k in range(5)]
    assert [entry["sequence"] for entry in ticks] == list(range(5))


@given(
    st.lists(st.tuples(st.floats(-100.0, 100.0), st.floats(1e-4, 2.0)), min_size=1, max_size=30),
    st.floats(10.0, 1000.0),
)
def test_the_law_keeps_to_limits_and_slew(readings: list[tuple[float, float]], slew: float):
    memory = Memory()
    for measured, dt in readings:
        before = memory.command_V
        memory = decide(Gains(2.0, 50.0, 0.1, 0.01), Limits(), slew, memory, 10.0, measured, dt)
        assert 0.0 <= memory.command_V <= 50.0
        assert abs(memory.command_V - before) <= slew * min(dt, LONGEST_DT_S) + 1e-9


@given(
    wanted_V=st.lists(st.floats(-1e300, 1e300), min_size=1, max_size=30),
    dt_s=st.floats(1e-3, 1.0), slew_V_per_s=st.floats(1.0, 1e4), lower_V=st.floats(-50.0, 0.0),
)  # fmt: skip
def test_anybodys_controller_keeps_to_limits_and_slew_and_has_its_way_within_them(
    wanted_V: list[float], dt_s: float, slew_V_per_s: float, lower_V: float
):
    said = iter(wanted_V)
    controller = cast(WatchedController, SimpleNamespace(step=lambda *_: next(said)))
    loop = ForeignLoop(Step(1.0), controller, Limits(lower_V, 50.0), slew_V_per_s, 0.03, 1.0)
    most_V, before_V = slew_V_per_s * min(dt_s, LONGEST_DT_S), 0.0
    for wanted in wanted_V:
        found_V = loop.decide(0.0, dt_s, 2.0).voltage_V
        assert found_V == min(max(wanted, before_V - most_V, lower_V), before_V + most_V, 50.0)
        before_V = found_V
        assert loop.decide(0.0, dt_s, None).voltage_V == before_V


def test_the_staircase_is_that_of_the_paper():
    stairs = staircase()
    assert len(stairs.levels_V) == 101
    assert (stairs.levels_V[0], max(stairs.levels_V), stairs.levels_V[-1]) == (0.0, 50.0, 0.0)
    assert stairs.at(stairs.times_s[7]) == 7.0
    assert min(sine().levels_V) >= 0.0
    assert min(sine(both_polarities=True).levels_V) == pytest.approx(-10.0, abs=0.05)


@pytest.mark.parametrize(
    ("text", "kind"),
    [("time_s,voltage_V\n3,0\n4,5\n6,0\n", Voltages), ("time_s,setpoint_um\n0,0\n1,5\n", Profile)],
)
def test_profile_files(tmp_path: Path, text: str, kind: type):
    path = tmp_path / "profile.csv"
    path.write_text(text)
    profile = read_profile_file(str(path))
    assert isinstance(profile, kind)
    if isinstance(profile, Voltages):
        assert (profile.at(0.5), profile.at(1.0), profile.at(99.0), profile.duration_s) == (0.0, 5.0, 0.0, 5.0)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("time_s,voltage_V\n0,nan\n", "a finite number"),
        ("time_s,voltage_V\n1,1\n1,2\n", "line 3, column time_s"),
        ("time_s,voltage_V\n", "no rows"),
        ("time_s,force_N\n0,1\n", "setpoint_um"),
    ],
)
def test_profile_files_that_are_none(tmp_path: Path, text: str, complaint: str):
    path = tmp_path / "profile.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        read_profile_file(str(path))
