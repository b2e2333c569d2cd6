"""Buffered runs: what the source may play, one clock for both sides, and the way down in the middle of a profile."""

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulated_bench import wait_for
from hypothesis import given
from hypothesis import strategies as st
from present import present
from scripted_source import Clock, ClockedSource, KeptJournal

from bender_cli.main import main
from bender_emulator.tip_board import TipReader, TipWriter
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_hil.guard import output as module
from bender_hil.guard.guard import Status
from bender_hil.guard.output import GuardedOutput
from bender_hil.guard.played import Played, refused
from bender_hil.guard.rules import Situation, Trip, judge
from bender_hil.guard.settings import GuardOrders, GuardSettings
from bender_hil.guard.start import GuardProcess
from bender_hil.log.journal import Journal, read_journal
from bender_hil.log.read_run import read_run
from bender_hil.runner.buffered import Buffered, BufferedLoop
from bender_hil.runner.interrupts import Interrupts
from bender_hil.runner.loop import LoopEnd
from bender_hil.runner.voltages import Voltages
from bender_hil.sensors.sensor_eyes import SensorEyes
from bender_hil.sources.amplifier import Amplifier
from bender_loop.shell.messages import ClosedError

LIMITS = GuardSettings(minimum_V=-10.0, maximum_V=40.0, slew_V_per_s=100.0, burst_s=0.05)
BENCH = """
[emulator]
supply = "{supply}"
sensor = "{sensor}"
[emulator.sensor_settings]
rate_Hz = {rate_Hz}
[guard]
minimum_V = {minimum_V}
heartbeat_s = 2.0
frame_age_s = 1.0
{more}
"""

levels = st.lists(st.floats(-60.0, 60.0), min_size=1, max_size=30)


@given(levels_V=levels, rate_Hz=st.floats(1.0, 1e4))
def test_what_may_be_played_is_what_commands_would_reach_whole(levels_V: list[float], rate_Hz: float):
    clock = Clock(look_s=0.0)
    source, journal = ClockedSource(clock), KeptJournal()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(module, "time", clock)
        output = GuardedOutput(source, LIMITS, journal, Situation())
        start_s = clock.now_s
        for place, level_V in enumerate(levels_V):
            clock.now_s = start_s + place / rate_Hz
            output.command(level_V, place)
    # a supply rounds what it is told; a source that plays does not
    is_whole = output.clamped == 0 and output.slowed == 0
    near = min((abs(abs(b - a) - 5.0) for a, b in zip([0.0, *levels_V], levels_V, strict=False)), default=1.0) < 2e-3
    assert near or (refused(levels_V, rate_Hz, LIMITS) is None) == is_whole


@pytest.mark.parametrize(
    ("levels_V", "rate_Hz"),
    [
        *((x, 100.0) for x in (None, [], "1", [1.0, None], [float("nan")], [float("inf")], [True], {"a": 1.0})),
        *(([0.0], x) for x in (0.0, -1.0, float("nan"), float("inf"), None, "1", 2e5, True)),
    ],
)
def test_what_is_no_profile_or_no_rate_ends_the_run(levels_V: object, rate_Hz: object):
    assert present(refused(levels_V, rate_Hz, LIMITS)).code == "bad_command"


def test_a_profile_that_goes_too_far_or_too_fast_is_told_with_its_place():
    far, fast = (present(refused(*told, LIMITS)) for told in (([0.0, 4.0, 41.0], 2.0), ([0.0, 4.0, 10.0], 1000.0)))
    assert (far.code, fast.code) == ("profile", "profile")
    assert "at 1 s the profile is at 41 V, allowed: -10 ... 40 V" in far.sentence
    assert "at 0.002 s the profile goes from 4 to 10 V, allowed: 100 V/s, 5 V at once" in fast.sentence


@given(rate_Hz=st.floats(0.5, 1e4), count=st.integers(1, 500), part=st.floats(0.0, 2.0))
def test_levels_begin_one_after_the_other(rate_Hz: float, count: int, part: float):
    played = Played([0.0] * count, rate_Hz, 100.0)
    now_s = 100.0 + part * count / rate_Hz
    passed = played.passed(now_s)
    assert 1 <= passed <= count
    assert played.begins_s(passed - 1) <= now_s + 1e-9
    assert passed == count or played.begins_s(passed) >= now_s - 1e-9
    assert played.passed(99.0 - 1.0 / rate_Hz) == 0


class PlayingScript(ClockedSource):
    """Plays what it is told, and measures what it plays."""

    has_buffer = True
    beside_V = 0.0
    began: Played | None = None

    def play(self, levels_V: list[float], rate_Hz: float) -> float:
        self.began = Played(levels_V, rate_Hz, self.now_s())
        return self.began.start_s

    def measured_V(self) -> float | None:
        super().measured_V()
        if self.began is None:
            return 0.0
        return self.began.levels_V[max(0, self.began.passed(self.now_s()) - 1)] + self.beside_V


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def _watched(clock: Clock, beside_V: float) -> tuple[Trip | None, GuardedOutput, KeptJournal, Played]:
    source, journal, situation = PlayingScript(clock, answer_s=0.0005), KeptJournal(), Situation()
    source.beside_V = beside_V
    output = GuardedOutput(source, LIMITS, journal, situation)
    profile_V = (20.0 * np.sin(np.arange(400) * 0.004) ** 2).tolist()
    assert isinstance(output.play(profile_V, 1000.0), float)
    trip = None
    for _ in range(40):
        clock.sleep(0.01)
        output.continue_slew()
        output.patrol(lambda: False)
        trip = trip or judge(LIMITS, situation)
    assert source.began is not None
    return trip, output, journal, source.began


def test_what_is_played_is_written_down_level_by_level_and_held_against_the_band(clock: Clock):
    trip, output, journal, played = _watched(clock, 0.0)
    assert trip is None
    applied = [entry for entry in journal.entries if entry["kind"] == "applied"]
    assert [entry["voltage_V"] for entry in applied] == list(played.levels_V)
    assert [entry["command_time_s"] for entry in applied] == [played.begins_s(k) for k in range(400)]
    # a way down begins where the output is
    assert output.voltage_V == played.levels_V[-1]


@pytest.mark.parametrize("beside_V", [-1.6, 30.0])
def test_an_output_beside_what_is_played_ends_the_run(clock: Clock, beside_V: float):
    trip, *_ = _watched(clock, beside_V)
    assert present(trip).code == "band"


def test_nothing_is_played_twice_over_a_voltage_or_without_a_buffer(clock: Clock):
    output = GuardedOutput(PlayingScript(clock), LIMITS, KeptJournal(), Situation())
    output.play([0.0, 1.0], 100.0)
    again = output.play([0.0], 100.0)
    assert isinstance(again, Trip)
    over = GuardedOutput(PlayingScript(clock), LIMITS, KeptJournal(), Situation())
    over.command(3.0, 0)
    assert isinstance(over.play([0.0], 100.0), Trip)
    plain = GuardedOutput(ClockedSource(clock), LIMITS, KeptJournal(), Situation()).play([0.0], 100.0)
    assert isinstance(plain, Trip)
    assert "buffer" in plain.sentence


class ScriptedRecording:
    """Gives samples block by block, and nothing any more after the last one."""

    def __init__(self, blocks: list[list[float]]) -> None:
        self.blocks = list(blocks)

    def read(self, timeout_s: float) -> list[float]:
        time.sleep(0.0 if self.blocks else timeout_s)
        return self.blocks.pop(0) if self.blocks else []


class ScriptedEyes(SensorEyes):
    """Hands over a sensor whose volts are worth 10 µm each, from a rest position of 0.5 V."""

    def __init__(self, blocks: list[list[float]]) -> None:
        self.asked: list[tuple[float, int]] = []
        self._blocks = blocks

    def let_go(self) -> tuple[Any, Callable[[float], float]]:
        return self, lambda value: 10.0 * (value - 0.5)

    def record(self, rate_Hz: float, count: int) -> ScriptedRecording:
        self.asked.append((rate_Hz, count))
        return ScriptedRecording(self._blocks)


@dataclass
class ScriptedGuard:
    start_s: float | None = 50.0
    played: list[Any] = field(default_factory=list)
    trips: list[str] = field(default_factory=list)
    beats: int = 0

    def play(self, levels_V: list[float], rate_Hz: float) -> float | None:
        self.played.append((levels_V, rate_Hz))
        return self.start_s

    def beat(self) -> None:
        self.beats += 1

    def trip(self, code: str, sentence: str) -> None:
        self.trips.append(code)

    def has_tripped(self) -> bool:
        return False


PROFILE = Buffered(Voltages((0.0, 0.02, 0.05), (1.0, 3.0, 2.0), 0.08), 100.0)


def _look_on(
    tmp_path: Path, blocks: list[list[float]], guard: ScriptedGuard, interrupts: Interrupts | None = None
) -> tuple[LoopEnd, list[dict[str, Any]], ScriptedEyes]:
    eyes, journal = ScriptedEyes(blocks), Journal(tmp_path / "run.jsonl")
    loop = BufferedLoop(eyes, guard, PROFILE, journal, (-2.0, 8.0), 0.1, interrupts or Interrupts())
    end = loop.run(0.0)
    journal.close()
    return end, list(read_journal(tmp_path / "run.jsonl")), eyes


def test_every_sample_stands_at_the_edge_at_which_its_level_begins(tmp_path: Path):
    guard = ScriptedGuard()
    end, entries, eyes = _look_on(tmp_path, [[0.5, 0.6], [], [0.7, math.nan, 0.5], [0.5] * 9], guard)
    levels_V = [1.0, 1.0, 3.0, 3.0, 3.0, 2.0, 2.0, 2.0]
    assert (end.ticks, end.trip, guard.trips) == (8, None, [])
    assert guard.played == [(levels_V, 100.0)]
    assert eyes.asked == [(100.0, 8)]
    # a controller that waits for samples is alive all the same
    assert guard.beats == 4
    assert [entry["command_V"] for entry in entries] == levels_V
    assert [entry["grabbed_s"] for entry in entries] == pytest.approx([50.0 + 0.01 * k for k in range(8)])
    assert [entry["time_s"] for entry in entries] == pytest.approx([0.01 * k for k in range(8)])
    assert {entry["dt_s"] for entry in entries} == {0.01}
    tips_um = [entry["measured_um"] for entry in entries]
    assert tips_um[3] is None
    assert entries[3]["lost"] is not None
    assert tips_um[:3] == pytest.approx([0.0, 1.0, 2.0])
    assert [PROFILE.decide(entry["time_s"], 0.01, None).voltage_V for entry in entries] == levels_V


@pytest.mark.parametrize(("value", "ticks"), [(1.31, 2), (0.29, 2), (1.3, 8), (0.3, 8)])
def test_a_tip_beyond_its_limits_ends_what_is_played(tmp_path: Path, value: float, ticks: int):
    guard = ScriptedGuard()
    end, *_ = _look_on(tmp_path, [[0.5, value], [0.5] * 6], guard)
    assert end.ticks == ticks
    assert guard.trips == ([] if ticks == 8 else ["travel"])


def test_samples_that_come_no_more_and_a_signal_end_it(tmp_path: Path):
    guard, start_s = ScriptedGuard(), time.perf_counter()
    end, *_ = _look_on(tmp_path, [[0.5] * 3], guard)
    assert (end.ticks, guard.trips) == (3, ["camera_stalled"])
    assert 0.1 <= time.perf_counter() - start_s < 2.0
    guard, interrupts = ScriptedGuard(), Interrupts()
    interrupts.signal = "SIGINT"
    (tmp_path / "again").mkdir()
    end, *_ = _look_on(tmp_path / "again", [[0.5] * 8], guard, interrupts)
    assert (end.ticks, guard.trips) == (0, ["interrupted"])


def test_what_the_guard_refuses_is_not_recorded(tmp_path: Path):
    end, entries, _ = _look_on(tmp_path, [[0.5] * 8], ScriptedGuard(start_s=None))
    assert (end.ticks, entries) == (0, [])


def test_the_board_remembers_where_the_tip_was(tmp_path: Path):
    with TipWriter(tmp_path / "board") as writer, TipReader(tmp_path / "board") as reader:
        assert reader.clock()[1] == 0.0
        for step in range(5000):
            writer.publish(1e-3 * step, float(step), 0.0)
        writer.start_clock(4.0, 500.0)
        assert reader.clock() == (4.0, 500.0)
        at_s = np.array([3.9994, 4.0, 4.0004, 4.5, 4.999, 9.0])
        assert reader.past_um(at_s + 1e-9).tolist() == [3999.0, 4000.0, 4000.0, 4500.0, 4999.0, 4999.0]


@pytest.fixture(scope="module")
def daq(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedBench]:
    from bender_export.build import ensure_plant_fmu

    settings = EmulationSettings(supply="daq", sensor="daq", sensor_settings={"rate_Hz": 500.0})
    with EmulatedBench(settings, ensure_plant_fmu("bench"), 30.0, amplifier=Amplifier(4.0)) as bench:
        yield bench


def _orders(bench: EmulatedBench, folder: Path) -> GuardOrders:
    limits = GuardSettings(
        minimum_V=-30.0, maximum_V=40.0, shutdown_limit_s=1.5, discharge_limit_s=1.0, heartbeat_s=1.0, frame_age_s=1.0
    )
    source = EmulationSettings(supply="daq", sensor="daq", sensor_settings={"rate_Hz": 500.0}).source(bench.resource)
    return GuardOrders(source, str(folder / "guard.jsonl"), limits, amplifier=Amplifier(4.0))


def _kill(guard: GuardProcess) -> None:
    guard.process.kill()


def _silence(_: GuardProcess) -> None:
    """The controller says nothing any more."""


def _stop(guard: GuardProcess) -> None:
    os.kill(guard.process.pid, signal.SIGTERM)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(("event", "code"), [(_kill, "guard_gone"), (_silence, "heartbeat"), (_stop, "signal")])
def test_a_profile_that_plays_is_ended_in_its_middle(
    daq: EmulatedBench, tmp_path: Path, event: Callable[[GuardProcess], None], code: str
):
    daq.supply.make_ready()
    guard = GuardProcess(_orders(daq, tmp_path))
    profile_V = [20.0 * min(1.0, place / 200.0) for place in range(20_000)]
    assert guard.play(profile_V, 500.0) is not None
    wait_for(lambda: abs(daq.supply.truth()["output_V"]) >= 15.0)
    event(guard)
    try:
        while not guard.has_tripped():
            time.sleep(0.01)
    except ClosedError:
        pass
    ended = guard.wait()
    assert (ended.status, ended.code) == (Status.TRIPPED, code)
    assert abs(daq.supply.truth()["output_V"]) < 0.5


@pytest.mark.slow
def test_an_output_that_cannot_be_brought_to_0_V_while_it_plays_is_an_alarm(daq: EmulatedBench, tmp_path: Path):
    daq.supply.make_ready()
    guard = GuardProcess(_orders(daq, tmp_path))
    assert guard.play([20.0 * min(1.0, place / 200.0) for place in range(20_000)], 500.0) is not None
    wait_for(lambda: abs(daq.supply.truth()["output_V"]) >= 15.0)
    daq.supply.fault("deaf")
    guard.stop()
    assert guard.wait().status is Status.UNCONFIRMED
    daq.supply.power_on()


@pytest.mark.slow
def test_a_profile_is_played_and_recorded_by_one_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """On a busy machine too: half of the time another thread holds this process up."""
    monkeypatch.chdir(tmp_path)
    more = "[amplifier]\ngain = 20"
    Path("bench.toml").write_text(BENCH.format(supply="daq", sensor="daq", rate_Hz=1000, minimum_V=-50, more=more))
    steps = np.arange(8)
    rows = [f"{0.5 * step},{10.0 * (step % 2)}" for step in steps]
    Path("profile.csv").write_text("\n".join(["time_s,voltage_V", *rows]))
    is_over = threading.Event()

    def disturb() -> None:
        while not is_over.is_set():
            sum(range(200_000))
            time.sleep(0.01)

    thread = threading.Thread(target=disturb)
    thread.start()
    try:
        assert main(["hil", "--bench", "bench.toml", "--profile", "profile.csv", "--buffered", "--out", "run"]) == 0
    finally:
        is_over.set()
        thread.join()
    assert main(["hil", "replay", "run"]) == 0
    assert len(read_run(Path("run")).ticks) == 4000
    record = np.genfromtxt("run/record.csv", delimiter=",", names=True)
    assert np.ptp(np.diff(record["time_s"])) < 1e-9
    assert np.max(np.abs(record["command_time_s"] - record["time_s"])) < 1e-9
    tip_um, noise_um = record["displacement_um"], 0.01
    for row in (500 * steps[1:]).tolist():
        before_um = float(np.mean(tip_um[row - 50 : row]))
        # a reading is taken at the very edge at which its level begins, and knows nothing of it yet
        assert abs(tip_um[row] - before_um) < 6.0 * noise_um
        assert abs(tip_um[row + 15] - before_um) > 20.0 * noise_um


@pytest.mark.parametrize(
    ("supply", "sensor", "words", "said"),
    [
        ("9115", "microscope", ["--profile", "sine"], "a camera does not record"),
        ("9115", "text", ["--profile", "sine"], "does not record by the clock"),
        ("daq", "daq", ["--setpoint", "5"], "name one with --profile"),
    ],
)
def test_what_cannot_be_buffered_is_bad_input(
    supply: str,
    sensor: str,
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch,
    capfd: pytest.CaptureFixture[str],
):
    monkeypatch.chdir(tmp_path)
    text = BENCH.format(supply=supply, sensor=sensor, rate_Hz=30, minimum_V=0, more="")
    if sensor == "microscope":
        text = text.replace("[emulator.sensor_settings]\nrate_Hz = 30\n", "")
    Path("bench.toml").write_text(text)
    assert main(["hil", "--bench", "bench.toml", *words, "--buffered", "--out", "run"]) == 2
    assert said in capfd.readouterr().err
    assert not Path("run").exists()
