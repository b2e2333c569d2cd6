from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from bender_hil.runner.voltages import Voltages
from bender_investigate.bench_port import Played
from bender_investigate.journal import JOURNAL, DecisionJournal
from bender_investigate.safety import Allowed, of_rows, rows_of
from bender_investigate.stage import BudgetSpentError, Stage, TrippedError
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
        if self.dies_after is not None and self.trip is None and not self.interrupted:
            raise SystemExit("killed")
        record = read_record(folder / "record.csv")
        return Played(record, float(time_s[-1]), self.trip, self.interrupted)

    def follow(self, folder: Path, reference: Profile, gains: Gains, duration_s: float) -> Played:
        raise NotImplementedError

    def recovered(self, folder: Path) -> Played | None:
        if not (folder / "record.csv").exists():
            return None
        record = read_record(folder / "record.csv")
        return Played(record, float(record.time_s[-1]))


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


def test_a_machine_that_was_too_busy_is_no_reason_to_stop_for_good(tmp_path):
    with pytest.raises(TrippedError):
        stage(tmp_path, Bench(dies_after=100, trip="camera_stalled: no frame")).play("rest", RAMP, "to see")
    bench = Bench()
    records = stage(tmp_path, bench).play("rest", RAMP, "to see")
    assert len(records) == 2
    assert bench.levels


def test_an_interrupt_is_written_down(tmp_path):
    one = stage(tmp_path, Bench(dies_after=100, interrupted=True))
    with pytest.raises(KeyboardInterrupt):
        one.play("rest", RAMP, "to see")
    assert one.journal.decisions[-1]["kind"] == "interrupted"
