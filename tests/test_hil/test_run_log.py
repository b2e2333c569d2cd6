"""Journals, the record made from them, the replay, the figures."""

import errno
import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.log.figures import staircase_figures, step_figures
from bender_hil.log.journal import Journal, JournalError, read_journal
from bender_hil.log.read_run import read_run
from bender_hil.log.replay import replay_run
from bender_hil.log.results import recover
from bender_hil.log.summary import summarise
from bender_hil.log.to_record import to_record
from bender_hil.runner.control_law import Memory, decide
from bender_hil.runner.program import ClosedLoop, OpenLoop
from bender_hil.runner.voltages import staircase
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Step
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record

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
    write_run(tmp_path, ticks, guard)
    record = to_record(read_run(tmp_path))
    assert record is not None
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
    write_run(tmp_path, ticks, guard, exposure_s=exposure_s)
    record = to_record(read_run(tmp_path))
    assert record is not None
    assert record.exposure == written


def test_a_command_later_than_the_next_frame_is_entered_at_that_frame(tmp_path: Path):
    write_run(tmp_path, [tick(0, 5.0), tick(1, 5.033)], [applied(0, 1.0, 5.06), applied(1, 2.0, 5.065)])
    record = to_record(read_run(tmp_path))
    assert record is not None
    assert record.command_time_s is not None
    assert record.command_time_s[0] == record.time_s[1]


def test_a_command_in_parts_is_entered_where_its_mean_voltage_is_right(tmp_path: Path):
    guard = [applied(0, 2.0, 5.006), applied(1, 14.5, 5.04), applied(1, 17.0, 5.052, whole=False)]
    write_run(tmp_path, [tick(0, 5.0), tick(1, 5.033)], guard)
    record = to_record(read_run(tmp_path))
    assert record is not None
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
    assert summarise(read_run(tmp_path)).late == 2


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
    figures = staircase_figures(Record(time_s, voltage_V, slope * acting_V + offset))
    assert figures is not None
    for line in (figures.up, figures.down):
        assert line.sensitivity_um_per_V == pytest.approx(slope)
        assert line.r_squared == pytest.approx(1.0)
    assert figures.loop_width_um == pytest.approx(0.0, abs=1e-9)


def test_other_runs_have_no_such_figures():
    time_s = np.arange(30) / 30.0
    sine = Record(time_s, 10.0 + np.sin(time_s), np.cos(time_s), setpoint_um=np.sin(time_s))
    assert staircase_figures(sine) is None
    assert step_figures(sine) is None
    step = step_figures(Record(time_s, 0.0 * time_s, 5.0 * (1 - np.exp(-9.0 * time_s)), setpoint_um=0.0 * time_s + 5.0))
    assert step is not None
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
    expected = to_record(read_run(tmp_path))
    results = recover(tmp_path)
    assert expected is not None
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
