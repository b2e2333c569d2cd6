from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from bender_hil.guard.start import OutputUnknownError
from bender_hil.runner.voltages import Voltages
from bender_investigate.bench_port import Controller, Played
from bender_investigate.journal import JOURNAL, DecisionJournal
from bender_investigate.safety import Allowed, of_rows, rows_of
from bender_investigate.stage import BudgetSpentError, Followed, Stage, TrippedError
from bender_loop.control.pid import Gains
from bender_loop.control.references import Profile
from bender_loop.records.record import Record, read_record, write_record

ALLOWED = Allowed(0.0, 50.0, 300.0, 0.05, (-10.0, 45.0), 30.0)
RAMP = of_rows(np.concatenate([np.linspace(0.0, 30.0, 150), np.linspace(30.0, 0.0, 150)]), 30.0)


@dataclass
class Bench:
    """Plays by copying the command; dies or trips after so many rows."""

    dies_after: int | None = None
    trip: str | None = None
    interrupted: bool = False
    alarm: str | None = None
    beyond_s: float = 0.0
    levels: list[float] = field(default_factory=list)

    allowed = ALLOWED

    @property
    def loop_travel_um(self):
        return self.allowed.travel_um

    def facts(self):
        return {}

    def play(self, folder: Path, voltages: Voltages) -> Played:
        time_s, levels = rows_of(voltages, ALLOWED.rate_Hz)
        if self.dies_after is not None:
            time_s, levels = time_s[: self.dies_after], levels[: self.dies_after]
        self.levels += levels.tolist()
        if len(time_s) >= 2:
            write_record(folder / "record.csv", Record(time_s, levels, 0.5 * levels))
        if self.alarm is not None:
            raise OutputUnknownError(self.alarm)
        if self.dies_after is not None and self.trip is None and not self.interrupted:
            raise SystemExit("killed")
        record = read_record(folder / "record.csv")
        return Played(record, float(time_s[-1]), self.trip, self.interrupted)

    def follow(self, folder: Path, reference: Profile, controller: Controller, duration_s: float) -> Played:
        time_s = np.arange(60) / ALLOWED.rate_Hz
        self.levels += [1.0] * 60
        record = Record(time_s, np.ones(60), np.ones(60))
        write_record(folder / "record.csv", record)
        return Played(record, float(time_s[-1]), self.trip)

    def recovered(self, folder: Path) -> Played | None:
        if not (folder / "record.csv").exists():
            return None
        record = read_record(folder / "record.csv")
        return Played(record, float(record.time_s[-1]) + self.beyond_s)


def stage(out: Path, bench: Bench, budget_s: float = 60.0) -> Stage:
    return Stage(bench, out, DecisionJournal(out / JOURNAL), budget_s, lambda _: None)


def test_a_play_is_announced_before_and_noted_after(tmp_path):
    one = stage(tmp_path, Bench())
    (record,) = one.play("rest", RAMP, "to see")
    assert len(record) == 300
    assert [x["kind"] for x in one.journal.decisions] == ["play", "played"]
    assert (tmp_path / "01-rest" / "profile.csv").exists()
    assert one.spent_s == pytest.approx(record.time_s[-1])


def test_a_play_beyond_the_budget_touches_nothing(tmp_path):
    bench = Bench()
    one = stage(tmp_path, bench, budget_s=9.0)
    with pytest.raises(BudgetSpentError, match=r"takes 10 s, of the budget of 9 s .* 9 s are left"):
        one.play("rest", RAMP, "to see")
    assert bench.levels == []
    assert one.journal.decisions == []


def test_what_was_played_is_not_played_again(tmp_path):
    stage(tmp_path, Bench()).play("rest", RAMP, "to see")
    bench = Bench()
    again = stage(tmp_path, bench)
    (record,) = again.play("rest", RAMP, "to see")
    assert bench.levels == []
    assert len(record) == 300
    assert again.spent_s == pytest.approx(record.time_s[-1])
    again.play("second", RAMP, "more")
    assert (tmp_path / "02-second").is_dir()


@pytest.mark.parametrize("rows", [90, 200, 270])
def test_of_a_play_that_was_killed_only_the_rest_is_played(tmp_path, rows):
    with pytest.raises(SystemExit):
        stage(tmp_path, Bench(dies_after=rows)).play("rest", RAMP, "to see")
    bench = Bench()
    again = stage(tmp_path, bench)
    records = again.play("rest", RAMP, "to see")
    _, whole = rows_of(RAMP, ALLOWED.rate_Hz)
    rest = whole[rows:]
    if len(rest) < 60:
        assert bench.levels == []
        assert [len(x) for x in records] == [rows]
        return
    assert bench.levels[-len(rest) :] == rest.tolist()
    lead = bench.levels[: -len(rest)]
    assert np.max(np.abs(np.diff([0.0, *lead, rest[0]]))) <= ALLOWED.change_V
    assert [len(x) for x in records] == [rows, len(bench.levels)]
    third = Bench()
    same = stage(tmp_path, third).play("rest", RAMP, "to see")
    assert third.levels == []
    assert [len(x) for x in same] == [len(x) for x in records]


def test_a_play_that_was_killed_at_once_is_played_whole(tmp_path):
    with pytest.raises(SystemExit):
        stage(tmp_path, Bench(dies_after=1)).play("rest", RAMP, "to see")
    bench = Bench()
    (record,) = stage(tmp_path, bench).play("rest", RAMP, "to see")
    assert len(record) >= 300


def test_a_trip_ends_it_and_is_not_gone_on_with(tmp_path):
    with pytest.raises(TrippedError, match=r"01-rest: the guard ended the run: travel: far; look at the bench"):
        stage(tmp_path, Bench(dies_after=100, trip="travel: far")).play("rest", RAMP, "to see")
    bench = Bench()
    records = stage(tmp_path, bench).play("rest", RAMP, "to see")
    assert bench.levels == []
    assert [len(x) for x in records] == [100]


@pytest.mark.parametrize("trip", ["camera_stalled: no frame", "guard_gone: another one made safe"])
def test_a_mishap_of_the_machine_is_no_reason_to_stop_for_good(tmp_path, trip):
    with pytest.raises(TrippedError):
        stage(tmp_path, Bench(dies_after=100, trip=trip)).play("rest", RAMP, "to see")
    bench = Bench()
    records = stage(tmp_path, bench).play("rest", RAMP, "to see")
    assert len(records) == 2
    assert bench.levels


def test_an_alarm_is_written_down_and_the_rest_is_played_when_somebody_says_so(tmp_path):
    first = stage(tmp_path, Bench(dies_after=100, alarm="OUTPUT STATE UNKNOWN"))
    with pytest.raises(OutputUnknownError):
        first.play("rest", RAMP, "to see")
    assert [(x["kind"], x["why"]) for x in first.journal.decisions][-1] == ("alarm", "OUTPUT STATE UNKNOWN")
    bench = Bench()
    assert len(stage(tmp_path, bench).play("rest", RAMP, "to see")) == 2
    _, whole = rows_of(RAMP, ALLOWED.rate_Hz)
    assert bench.levels[-200:] == whole[100:].tolist()


def test_a_row_that_may_have_been_played_is_not_played_again(tmp_path):
    with pytest.raises(SystemExit):
        stage(tmp_path, Bench(dies_after=100)).play("rest", RAMP, "to see")
    bench = Bench(beyond_s=2.0 / ALLOWED.rate_Hz)
    stage(tmp_path, bench).play("rest", RAMP, "to see")
    _, whole = rows_of(RAMP, ALLOWED.rate_Hz)
    assert bench.levels[-198:] == whole[102:].tolist()
    assert bench.levels[-199] < whole[101]


def _follow(one: Stage) -> Followed:
    return one.follow("new-1", Profile((0.0,), (5.0,)), Controller(Gains(1.0, 1.0, 0.0)), 2.0, "to see")


def test_a_lost_process_is_not_held_against_the_gains(tmp_path):
    with pytest.raises(TrippedError, match="guard_gone"):
        _follow(stage(tmp_path, Bench(trip="guard_gone: another one made safe")))
    bench = Bench()
    assert _follow(stage(tmp_path, bench)) == (None, None)
    assert bench.levels == []


def test_a_tip_beyond_its_travel_is_held_against_the_gains(tmp_path):
    assert _follow(stage(tmp_path, Bench(trip="travel: far"))).trip == "travel: far"
    bench = Bench()
    assert _follow(stage(tmp_path, bench)).trip == "travel: far"
    assert bench.levels == []
