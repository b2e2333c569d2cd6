"""Journals, the record made from them, the replay, the figures, NeXus, passes of a run that learns."""

import argparse
import errno
import json
import math
import os
import random
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from present import present

from bender_cli.main import main
from bender_hil.bench_file import BenchFile, read_bench
from bender_hil.calibration.sensor_scale import fit_sensor
from bender_hil.command import OWN_GAINS
from bender_hil.learning import learn_on_bench, read_at
from bender_hil.log.figures import staircase_figures, step_figures
from bender_hil.log.journal import Journal, JournalError, read_journal
from bender_hil.log.nexus import NEXUS, write_nexus
from bender_hil.log.read_run import read_run
from bender_hil.log.replay import replay_run
from bender_hil.log.results import RECORD, recover
from bender_hil.log.summary import late_ticks, summarise
from bender_hil.log.to_record import to_record
from bender_hil.recent_range import RecentRange
from bender_hil.runner.control_law import Memory, decide
from bender_hil.runner.program import ClosedLoop, OpenLoop
from bender_hil.runner.voltages import staircase
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Step, read_profile
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record, write_record
from bender_loop.shell.files import prepare_directory
from bender_tuner.results.gains_file import read_gains
from piezo_bender import load_record

GAINS, LIMITS = Gains(0.3, 4.0, 0.01, 0.02), Limits()


def write_run(
    folder: Path, ticks: list[dict[str, Any]], guard: list[dict[str, Any]], program: Any = None, **facts: Any
) -> None:
    program = program or ClosedLoop(Step(10.0), GAINS, LIMITS, 225.0, 1.0)
    journal = Journal(folder / "run.jsonl")
    journal.write("start", program=program.facts(), emulated=True, delay_s=0.002, period_s=0.033, **facts)
    for tick in ticks:
        journal.write("tick", **tick)
    journal.close()
    journal = Journal(folder / "guard.jsonl")
    for entry in guard:
        journal.write(**entry)
    journal.close()


def tick(sequence: int, grabbed_s: float, **facts: Any) -> dict[str, Any]:
    usual = {
        "frame": sequence, "time_s": grabbed_s - 5.0, "dt_s": 0.033, "measured_um": 0.1 * sequence, "setpoint_um": 10.0,
        "command_V": 1.0, "sent_s": grabbed_s + 0.003, "skipped": 0, "late": False, "lost": None, "confidence": 0.9,
    }  # fmt: skip
    return {"sequence": sequence, "grabbed_s": grabbed_s, **usual, **facts}


def applied(sequence: int, voltage_V: float, command_time_s: float, whole: bool = True) -> dict[str, Any]:
    return {
        "kind": "applied", "sequence": sequence, "voltage_V": voltage_V, "command_time_s": command_time_s,
        "whole": whole,
    }  # fmt: skip


def _record_of(folder: Path, ticks: list[dict[str, Any]], guard: list[dict[str, Any]], **facts: Any) -> Record:
    write_run(folder, ticks, guard, **facts)
    return present(to_record(read_run(folder)))


def test_what_was_written_is_read_back_and_what_is_no_number_becomes_null(tmp_path: Path):
    journal = Journal(tmp_path / "a.jsonl")
    journal.write("tick", value=0.1 + 0.2, nothing=math.nan, parts=[1.0, math.inf], table={"x": -math.inf})
    journal.sync()
    journal.close()
    (entry,) = read_journal(tmp_path / "a.jsonl")
    assert entry["value"] == 0.1 + 0.2
    assert (entry["nothing"], entry["parts"], entry["table"]) == (None, [1.0, None], {"x": None})


def test_a_run_is_never_written_over(tmp_path: Path):
    Journal(tmp_path / "a.jsonl").close()
    with pytest.raises(InputError, match="already holds a run"):
        Journal(tmp_path / "a.jsonl")


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL")
def test_a_kill_loses_nothing_that_was_written(tmp_path: Path):
    code = (
        "import os, signal, sys; from pathlib import Path; from bender_hil.log.journal import Journal\n"
        "journal = Journal(Path(sys.argv[1]))\n"
        "for k in range(600): journal.write('tick', k=k)\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.jsonl")], check=False)
    assert done.returncode == -signal.SIGKILL
    assert [entry["k"] for entry in read_journal(tmp_path / "a.jsonl")] == list(range(600))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('{"n": 0, "kind": "a"}\n{"n": 2, "kind": "a"}\n', "found entry 2, expected 1"),
        ("nonsense\n", "line 1"),
        ("[]\n", "line 1"),
    ],
)
def test_a_journal_with_holes_is_refused(tmp_path: Path, text: str, complaint: str):
    (tmp_path / "a.jsonl").write_text(text)
    with pytest.raises(InputError, match=complaint):
        list(read_journal(tmp_path / "a.jsonl"))


def test_a_last_line_that_was_cut_short_is_left_out(tmp_path: Path):
    (tmp_path / "a.jsonl").write_text('{"n": 0, "kind": "a"}\n{"n": 1, "ki')
    assert len(list(read_journal(tmp_path / "a.jsonl"))) == 1


def test_the_record_has_the_time_of_the_light_and_the_time_of_the_wire(tmp_path: Path):
    ticks = [tick(0, 5.0), tick(1, 5.033, measured_um=None, lost="dark"), tick(2, 5.067), tick(3, 5.1)]
    guard = [
        applied(0, 1.5, 5.006),
        {"kind": "measured", "sequence": 0, "supply_voltage_V": 1.49, "current_A": None},
        applied(1, 2.5, 5.04),
        applied(2, 9.0, 5.12),
    ]
    record = _record_of(tmp_path, ticks, guard)
    # the tick that the guard never took is no row; a command after the next frame is entered at that frame or last
    assert record.time_s == pytest.approx([0.0, 0.033, 0.067])
    assert record.voltage_V.tolist() == [1.5, 2.5, 9.0]
    assert record.command_time_s == pytest.approx([0.008, 0.042, 0.122])
    assert np.isnan(record.displacement_um).tolist() == [False, True, False]
    assert record.supply_voltage_V is not None
    assert record.supply_voltage_V[0] == 1.49
    assert record.current_A is None


@pytest.mark.parametrize(("exposure_s", "written"), [(0.015, 0.015), (None, 0.0), (0.2, 0.0)])
def test_the_exposure_of_the_bench_file_is_in_the_record(tmp_path: Path, exposure_s: float | None, written: float):
    ticks, guard = [tick(0, 5.0), tick(1, 5.033)], [applied(0, 1.0, 5.006), applied(1, 2.0, 5.04)]
    record = _record_of(tmp_path, ticks, guard, exposure_s=exposure_s)
    assert record.exposure == written


def test_a_command_later_than_the_next_frame_is_entered_at_that_frame(tmp_path: Path):
    record = _record_of(tmp_path, [tick(0, 5.0), tick(1, 5.033)], [applied(0, 1.0, 5.06), applied(1, 2.0, 5.065)])
    assert record.command_time_s is not None
    assert record.command_time_s[0] == record.time_s[1]


def test_a_command_in_parts_is_entered_where_its_mean_voltage_is_right(tmp_path: Path):
    guard = [applied(0, 2.0, 5.006), applied(1, 14.5, 5.04), applied(1, 17.0, 5.052, whole=False)]
    record = _record_of(tmp_path, [tick(0, 5.0), tick(1, 5.033)], guard)
    assert record.command_time_s is not None
    assert record.voltage_V.tolist() == [2.0, 17.0]
    # 12.5 of 15 V at once, the rest 12 ms later; the record's own zero is 2 ms before the first frame
    assert record.command_time_s[1] == pytest.approx(0.042 + 0.012 * 2.5 / 15.0)


def test_a_run_without_commands_has_no_record(tmp_path: Path):
    write_run(tmp_path, [tick(0, 5.0), tick(1, 5.033)], [])
    assert to_record(read_run(tmp_path)) is None


def test_a_command_on_the_wire_too_late_or_overtaken_is_late(tmp_path: Path):
    ticks = [tick(k, 5.0 + 0.033 * k) for k in range(5)]
    guard = [applied(0, 1.0, 5.03), applied(1, 1.0, 5.07), applied(3, 1.0, 5.1)]
    write_run(tmp_path, ticks, guard)
    # 1 took 37 ms, 2 was overtaken by 3; 4 came after the end
    log = read_run(tmp_path)
    assert (summarise(log).late, summarise(log).late_ticks) == (2, (1, 2))
    assert late_ticks(log) == (1, 2)


def test_summary_counts(tmp_path: Path):
    ticks = [tick(0, 5.0, skipped=7), tick(1, 5.033, skipped=2, late=True), tick(2, 5.066, measured_um=None)]
    guard = [
        applied(0, 1.0, 5.004), applied(1, 1.5, 5.039, whole=True), applied(1, 2.0, 5.05, whole=False),
        {"kind": "ramp", "from_V": 2.0},
        {"kind": "end", "clamped": 3, "slowed": 1, "off_s": None, "harmless_s": None},
    ]  # fmt: skip
    write_run(tmp_path, ticks, guard)
    summary = summarise(read_run(tmp_path))
    assert (summary.ticks, summary.skipped, summary.late, summary.lost) == (3, 2, 1, 1)
    assert (summary.clamped, summary.slowed, summary.off_after_ms) == (3, 1, None)
    assert summary.frame_to_command_ms[2] == pytest.approx(6.0)


@given(st.lists(st.tuples(st.floats(-5.0, 30.0), st.floats(1e-3, 0.5), st.booleans()), min_size=2, max_size=40))
def test_replay_gives_the_same_bits(
    tmp_path_factory: pytest.TempPathFactory, readings: list[tuple[float, float, bool]]
):
    folder = tmp_path_factory.mktemp("run")
    program = ClosedLoop(Step(10.0, time_s=0.3), GAINS, LIMITS, 225.0, 1.0)
    ticks, now = [], 5.0
    for k, (reading, dt, seen) in enumerate(readings):
        now += dt
        measured = reading if seen else None
        decision = program.decide(now - 5.0, dt, measured)
        ticks.append(
            tick(k, now, dt_s=dt, measured_um=measured, setpoint_um=decision.setpoint_um, command_V=decision.voltage_V)
        )
    write_run(folder, ticks, [], program)
    replayed = replay_run(folder)
    assert (replayed.ticks, replayed.different) == (len(readings), 0)


def test_replay_finds_a_bit_that_differs(tmp_path: Path):
    first = decide(GAINS, LIMITS, 225.0, Memory(), 10.0, 0.0, 0.033)
    second = decide(GAINS, LIMITS, 225.0, first, 10.0, 0.1, 0.033)
    ticks = [tick(0, 5.0, command_V=first.command_V), tick(1, 5.033, command_V=math.nextafter(second.command_V, 99.0))]
    write_run(tmp_path, ticks, [])
    replayed = replay_run(tmp_path)
    assert (replayed.different, replayed.first) == (1, 1)
    assert 0.0 < replayed.largest_V < 1e-12


def test_replay_of_voltages(tmp_path: Path):
    program = OpenLoop(staircase(top_V=5.0, dwell_s=0.1))
    ticks = [tick(k, 5.0 + 0.04 * k, time_s=0.04 * k, command_V=program.voltages.at(0.04 * k)) for k in range(20)]
    write_run(tmp_path, ticks, [], program)
    assert replay_run(tmp_path).different == 0


def test_replay_of_what_is_no_run(tmp_path: Path):
    with pytest.raises(InputError, match="expected the directory of a run"):
        replay_run(tmp_path)
    (tmp_path / "run.jsonl").write_text(json.dumps({"n": 0, "kind": "start"}) + "\n")
    with pytest.raises(InputError, match="does not say what the run did"):
        replay_run(tmp_path)


@given(st.floats(0.1, 2.0), st.floats(-3.0, 3.0))
def test_staircase_figures_of_a_line(slope: float, offset: float):
    voltages = staircase(top_V=20.0, dwell_s=0.3)
    time_s = np.arange(0.0, voltages.duration_s, 1.0 / 30.0)
    voltage_V = np.array([voltages.at(t) for t in time_s])
    acting_V = np.concatenate([[0.0], voltage_V[:-1]])
    figures = present(staircase_figures(Record(time_s, voltage_V, slope * acting_V + offset)))
    for line in (figures.up, figures.down):
        assert line.sensitivity_um_per_V == pytest.approx(slope)
        assert line.r_squared == pytest.approx(1.0)
    assert figures.loop_width_um == pytest.approx(0.0, abs=1e-9)


def test_other_runs_have_no_such_figures():
    time_s = np.arange(30) / 30.0
    sine = Record(time_s, 10.0 + np.sin(time_s), np.cos(time_s), setpoint_um=np.sin(time_s))
    assert staircase_figures(sine) is None
    assert step_figures(sine) is None
    step = present(
        step_figures(Record(time_s, 0.0 * time_s, 5.0 * (1 - np.exp(-9.0 * time_s)), setpoint_um=0.0 * time_s + 5.0))
    )
    assert step.settling_time_s == pytest.approx(math.log(50.0) / 9.0, abs=1.0 / 30.0)


def test_a_line_that_a_full_disk_cuts_short_is_taken_back_and_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    journal = Journal(tmp_path / "a.jsonl")
    journal.write("whole")
    plain, room = os.write, [10, 0]

    def write(file: int, data: bytes) -> int:
        if not room[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        count = plain(file, data[: room[0]])
        room[0] -= count
        return count

    monkeypatch.setattr(os, "write", write)
    for _ in range(3):
        with pytest.raises(JournalError, match="No space left"):
            journal.write("lost")
    assert (tmp_path / "a.jsonl").read_text().endswith("}\n")
    monkeypatch.setattr(os, "write", lambda file, data: plain(file, data[:7]))
    journal.write("again")
    journal.close()
    entries = list(read_journal(tmp_path / "a.jsonl"))
    assert [entry["kind"] for entry in entries] == ["whole", "again"]
    assert entries[1]["missing_before"] == 3


@pytest.mark.skipif(os.name == "nt", reason="open files cannot be removed")
def test_a_journal_that_was_removed_is_not_written_into_nothing(tmp_path: Path):
    journal = Journal(tmp_path / "a.jsonl")
    journal.write("whole")
    (tmp_path / "a.jsonl").unlink()
    with pytest.raises(JournalError, match="removed"):
        journal.write("lost")
    journal.close()


def test_a_run_that_was_killed_is_recovered_from_its_journals(tmp_path: Path):
    ticks = [tick(k, 5.0 + 0.033 * k, measured_um=0.5 * k) for k in range(12)]
    write_run(tmp_path, ticks, [applied(k, 0.1 * k, 5.006 + 0.033 * k) for k in range(12)])
    with (tmp_path / "run.jsonl").open("a") as file:
        file.write('{"n": 13, "kind": "ti')
    expected = present(to_record(read_run(tmp_path)))
    results = recover(tmp_path)
    assert read_record(tmp_path / "record.csv").displacement_um.tolist() == expected.displacement_um.tolist()
    assert "record.csv" in results.written
    assert results.line.startswith("the guard's journal has no end")
    with pytest.raises(InputError, match="nothing to recover"):
        recover(tmp_path)


def test_nothing_is_recovered_from_nothing(tmp_path: Path):
    with pytest.raises(InputError, match="expected the directory of a run"):
        recover(tmp_path)
    write_run(tmp_path, [tick(0, 5.0)], [])
    with pytest.raises(InputError, match="fewer than two ticks"):
        recover(tmp_path)
    assert not (tmp_path / "record.csv").exists()


h5py = pytest.importorskip("h5py")

RNG = np.random.default_rng(2)
TIME_S = np.cumsum(RNG.uniform(0.02, 0.04, 50))
MOVED_UM = np.where(RNG.random(50) < 0.1, np.nan, 20.0 * RNG.random(50))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The journals and the record of a run, as the runner writes them."""
    calibration = fit_sensor([0.0, 4.0], [0.0, 100.0], "V", reference_um=0.5)
    fields = {name: getattr(calibration, name) for name in calibration.__dataclass_fields__}
    start = {
        "n": 0, "t": 0.0, "kind": "start", "date": "2026-11-27T12:00:00+00:00", "emulated": True,
        "calibration": fields, "metadata": {"operator": "me", "specimen": "bender 3", "room": "12"},
        "versions": {"piezo-bender": "0.2.0"},
        "sensor": {"kind": "multimeter", "identity": {"manufacturer": "Keysight", "model": "34465A"}, "cannot": []},
    }  # fmt: skip
    rest = {"n": 1, "t": 1.0, "kind": "rest", "noise_um": 0.03}
    (tmp_path / "run.jsonl").write_text(f"{json.dumps(start)}\n{json.dumps(rest)}\n")
    opened = {"n": 0, "t": 0.0, "kind": "opened", "manufacturer": "Siglent", "model": "SDG1032X", "serial": "7"}
    (tmp_path / "guard.jsonl").write_text(f"{json.dumps(opened)}\n")
    write_record(
        tmp_path / "record.csv", Record(TIME_S, 50.0 * RNG.random(50), MOVED_UM, setpoint_um=np.full(50, 12.0))
    )
    return tmp_path


def test_the_record_comes_back_bit_for_bit(run: Path):
    path = write_nexus(run)
    assert path == run / NEXUS
    with h5py.File(path) as file:
        back = {name: np.array(values) for name, values in file["entry/data"].items() if not name.endswith("_errors")}
    told = read_record(run / "record.csv").columns()
    assert told.keys() == back.keys()
    for name, values in told.items():
        assert np.asarray(values).tobytes() == back[name].tobytes(), name


def test_every_command_reads_it_as_a_record(run: Path):
    loaded = load_record(write_nexus(run))
    assert np.array_equal(loaded.record.displacement_um, MOVED_UM, equal_nan=True)


def test_a_viewer_finds_the_signal_its_axis_its_units_and_its_errors(run: Path):
    with h5py.File(write_nexus(run)) as file:
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        assert (entry.attrs["NX_class"], data.attrs["NX_class"]) == ("NXentry", "NXdata")
        signal, axis = data[data.attrs["signal"]], data[data.attrs["axes"][0]]
        assert signal.shape == axis.shape == data[f"{data.attrs['signal']}_errors"].shape
        assert (signal.attrs["units"], axis.attrs["units"]) == ("um", "s")
        # 0.5 um at each end of 100 um is 0.707 % of the scale; the noise at rest beside it
        errors = np.array(data["displacement_um_errors"])
        expected = np.hypot(0.5 * np.sqrt(2.0) / 100.0 * MOVED_UM, 0.03)
        np.testing.assert_allclose(errors, expected, rtol=1e-9)
        assert entry["user/name"][()] == b"me"
        assert entry["sample/name"][()] == b"bender 3"
        assert entry["metadata/room"][()] == b"12"
        assert entry["instrument/source/model"][()] == b"SDG1032X"
        assert json.loads(entry["provenance/data"][()])["date"].startswith("2026-11-27")


def test_a_file_is_not_written_over_and_a_folder_without_a_run_is_told(run: Path, tmp_path: Path, capsys):
    assert main(["hil", "nexus", str(run)]) == 0
    assert main(["hil", "nexus", str(run)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert main(["hil", "nexus", str(run), "--out", str(tmp_path / "other.h5")]) == 0


@pytest.mark.slow
def test_the_gains_of_the_package_can_be_tuned_again(tmp_path: Path):
    first = OWN_GAINS.read_text(encoding="utf-8").splitlines()[0]
    program, *words = shlex.split(first.removeprefix("#"))
    assert program == "bender"
    assert main([*words, "--out", str(tmp_path)]) == 0
    gains, limits, period_s = read_gains(OWN_GAINS)
    again, same_limits, same_period_s = read_gains(tmp_path / "gains.toml")
    assert (limits, period_s) == (same_limits, same_period_s)
    for name in gains.__dataclass_fields__:
        assert getattr(again, name) == pytest.approx(getattr(gains, name), rel=1e-3)


def test_the_level_that_held_at_the_beginning_counts_until_the_next_one_is_as_old_as_the_span():
    recent = RecentRange(1.0)
    assert recent.since_s(0.0) == math.inf
    recent.add(-math.inf, 0.0)
    recent.add(2.0, 7.0)
    assert recent.range(2.999) == (0.0, 7.0)
    assert recent.since_s(2.999) == -math.inf
    assert recent.range(3.0) == (7.0, 7.0)
    assert recent.since_s(3.0) == 2.0


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_range_of_all_levels_that_held_within_the_span(seed: int):
    rng = random.Random(seed)
    recent, levels, now_s = RecentRange(0.5), [], 0.0
    for _ in range(300):
        now_s += rng.choice([0.0, 0.001, 0.03, 0.4, 0.7])
        recent.add(now_s, float(rng.randrange(6)))
        levels.append((now_s, recent._levels[-1][1]))
        now_s += rng.choice([0.0, 0.2])
        ends_s = [*(at_s for at_s, _ in levels[1:]), math.inf]
        held = [level for (_, level), end_s in zip(levels, ends_s, strict=True) if end_s > now_s - 0.5]
        assert recent.range(now_s) == (min(held), max(held))


RATE_HZ, SCAN_S = 30.0, 5.0


def scan(time_s: np.ndarray) -> np.ndarray:
    return 8.0 * np.abs((time_s + 0.5) % 1.0 - 0.5)


@pytest.fixture
def bench(tmp_path: Path) -> BenchFile:
    (tmp_path / "bench.toml").write_text('[emulator]\nmodel = "bench"\n')
    return read_bench(tmp_path / "bench.toml")


def learned(tmp_path: Path, bench: BenchFile) -> list[tuple[np.ndarray, np.ndarray]]:
    """Learn a scan whose file rounds its times; each pass: frames at odd times, and what the tip did, which is what
    was asked of it.
    """
    time_s = np.arange(round(SCAN_S * RATE_HZ)) / RATE_HZ
    lines = [f"{t:.7g},{x!r}\n" for t, x in zip(time_s, scan(time_s).tolist(), strict=True)]
    (tmp_path / "scan.csv").write_text("time_s,setpoint_um\n" + "".join(lines))
    played, rng = [], np.random.default_rng(5)

    def run_pass(arguments: argparse.Namespace) -> int:
        target = read_profile(Path(arguments.profile))
        frames_s = time_s + rng.uniform(0.0, 0.2 / RATE_HZ, time_s.size)
        tip_um = target.sample(frames_s)
        write_record(prepare_directory(arguments.out) / RECORD, Record(frames_s - frames_s[0], 0.0 * frames_s, tip_um))
        played.append((frames_s, tip_um))
        return 0

    words = {"learn": 2, "profile": tmp_path / "scan.csv", "out": tmp_path / "passes"}
    assert learn_on_bench(argparse.Namespace(**words), bench, run_pass) == 0
    return played


def test_a_target_runs_straight_through_the_set_points_whenever_frames_come(tmp_path: Path, bench: BenchFile):
    frames_s, tip_um = learned(tmp_path, bench)[0]
    # 8 µm/s; a target held from frame to frame is off by 0.27 µm, one in eight parts by 0.03
    assert np.abs(tip_um - scan(frames_s)).max() < 0.06


def test_the_set_points_that_count_are_those_of_the_file(tmp_path: Path, bench: BenchFile):
    learned(tmp_path, bench)
    lines = np.loadtxt(tmp_path / "passes" / "learned.csv", delimiter=",", skiprows=1)
    at_samples = lines[::8]
    assert at_samples[:, 2] == pytest.approx(scan(at_samples[:, 0]), abs=1e-5)


def test_a_corner_between_two_frames_is_no_error():
    grid_s = np.arange(150) / RATE_HZ
    frames_s = grid_s + np.random.default_rng(7).uniform(0.0, 0.2 / RATE_HZ, grid_s.size)
    record = Record(frames_s, np.zeros(150), scan(frames_s))
    # on straight lines between the frames the readings miss up to 0.08 µm where the scan turns
    assert read_at(record, grid_s, scan(grid_s))[1:-1] == pytest.approx(scan(grid_s)[1:-1], abs=1e-9)
