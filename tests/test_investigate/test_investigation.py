"""The investigation: its stages in order, its journal of decisions, what it expects of gains."""

import contextlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bender_hil.command import OWN_GAINS
from bender_hil.runner.voltages import Voltages
from bender_inference.records.checks import read_model
from bender_investigate.bench_port import Played
from bender_investigate.excitation import another_excitation
from bender_investigate.investigation import LEFT_SHARE, Investigation, why_not_tuned
from bender_investigate.journal import JOURNAL, DecisionJournal, check_decisions, read_decisions
from bender_investigate.outcome import OUTCOME
from bender_investigate.safety import refusal
from bender_investigate.settings import InvestigationSettings
from bender_investigate.stage import Stage, TrippedError
from bender_loop.errors import InputError, RunError
from bender_loop.records.record import Record, read_record, write_record
from bender_proving import make_case
from bender_studies.investigations.virtual_bench import VirtualBench
from bender_tuner.results.gains_file import read_gains

NOTHING = make_case("nothing", (), 3, "camera")
SHORT = InvestigationSettings(budget_s=20.0)


def course(bench: VirtualBench, out: Path, settings: InvestigationSettings = SHORT, given=()) -> Investigation:
    return Investigation(bench, read_model("paper"), read_gains(OWN_GAINS)[0], out, settings, lambda _: None, given)


def kinds(out: Path) -> list[str]:
    return [x["kind"] for x in read_decisions(out / JOURNAL)]


def test_the_budget_is_kept_and_the_end_is_said(tmp_path):
    bench = VirtualBench(NOTHING)
    outcome = course(bench, tmp_path).run()
    assert (outcome.ended, outcome.verdict, outcome.gains) == ("budget", None, None)
    assert outcome.total_s <= 20.0
    assert kinds(tmp_path) == ["begun", "play", "played", "probed", "ended", "gains", "done"]
    told = json.loads((tmp_path / OUTCOME).read_text())
    assert "of the budget of 20 s" in told["ended"]["why"]
    assert told["gains"] == {
        "compared": None, "not_compared": "there is no verdict, the old gains stay", "use": None,
    }  # fmt: skip


def test_taken_up_again_it_plays_nothing_twice(tmp_path):
    course(VirtualBench(NOTHING), tmp_path).run()
    again = VirtualBench(NOTHING)
    course(again, tmp_path).run()
    assert again.plays == 0


def test_another_bench_or_budget_is_no_continuation(tmp_path):
    course(VirtualBench(NOTHING), tmp_path).run()
    with pytest.raises(InputError, match=r"was begun with budget_s = 20.0, found 30.0"):
        course(VirtualBench(NOTHING), tmp_path, InvestigationSettings(budget_s=30.0)).run()
    other = make_case("nothing", (), 5, "camera")
    with pytest.raises(InputError, match=r"was begun with bench .*needs the options"):
        course(VirtualBench(other), tmp_path).run()


@pytest.mark.parametrize("gain", [1.0, 4.0, 9.0])
def test_a_bench_that_goes_further_than_its_model_is_excited_less(tmp_path, gain):
    bench = VirtualBench(replace(NOTHING, gain=gain))
    course(bench, tmp_path).run()
    probed = next(x for x in read_decisions(tmp_path / JOURNAL) if x["kind"] == "probed")
    assert probed["ratio"] == pytest.approx(gain, rel=0.1)
    assert probed["noise_um"] == pytest.approx(0.06 * gain, rel=0.4)
    assert bench.beyond == []
    # and what it would play stays within the travel of this bench
    from bender_investigate import excitation

    hard = excitation.up_and_down(bench.allowed, probed["top_V"])
    (tmp_path / "hard").mkdir()
    assert bench.play(tmp_path / "hard", hard).trip is None


def refusals(tmp_path, monkeypatch, highest_V: float):
    """What becomes of a profile of 40 V, and the voltages refused, where a rival of small records runs away."""
    bench = VirtualBench(NOTHING, 1)
    seen = Record(np.arange(60) / 30.0, np.linspace(0.0, highest_V, 60), np.zeros(60))
    one = course(bench, tmp_path, given=(seen,))
    one._add("given", one.given)
    wild = read_model("paper").with_block("electrostriction", coefficient_um_per_V2=1.0)
    monkeypatch.setattr(one, "_rivals", lambda: [wild])
    journal = DecisionJournal(tmp_path / JOURNAL)
    safe = one._safe(Stage(bench, tmp_path, journal, 60.0, lambda _: None), Voltages((0.0, 1.0), (40.0, 0.0), 2.0))
    journal.close()
    assert safe is None or refusal(safe, bench.allowed, [wild]) is None
    return safe, [x["highest_V"] for x in journal.all("refused")]


def test_a_rival_that_runs_away_at_high_voltages_leaves_a_smaller_experiment(tmp_path, monkeypatch):
    safe, refused_V = refusals(tmp_path, monkeypatch, 3.0)
    assert safe is not None
    assert 3.0 <= max(safe.levels_V) < min(refused_V)
    assert refused_V[0] == 40.0


def test_a_profile_that_is_refused_where_the_records_have_been_is_not_played(tmp_path, monkeypatch):
    safe, refused_V = refusals(tmp_path, monkeypatch, 30.0)
    assert safe is None
    assert refused_V[-1] == pytest.approx(30.0)


def test_an_interrupt_keeps_what_was_decided(tmp_path):
    class Interrupted(VirtualBench):
        def play(self, folder: Path, voltages: Voltages) -> Played:
            return replace(super().play(folder, voltages), interrupted=True)

    with pytest.raises(KeyboardInterrupt):
        course(Interrupted(NOTHING), tmp_path).run()
    assert kinds(tmp_path)[-1] == "interrupted"


class _Killed(BaseException):
    """What `kill -9` leaves of a play: no code of the investigation sees it."""


class _Mortal(VirtualBench):
    """Dies in the middle of its play number `fatal`, of which half is in the record."""

    fatal = 0

    def play(self, folder: Path, voltages: Voltages) -> Played:
        done = super().play(folder, voltages)
        if self.plays == self.fatal:
            record = read_record(folder / "record.csv")
            rows = len(record) // 2
            half = Record(record.time_s[:rows], record.voltage_V[:rows], record.displacement_um[:rows])
            write_record(folder / "record.csv", half)
            raise _Killed
        return done


def test_a_probe_that_was_cut_off_is_read_in_both_parts(tmp_path):
    bench = _Mortal(replace(NOTHING, gain=4.0))
    bench.fatal = 1
    with pytest.raises(_Killed):
        course(bench, tmp_path).run()
    course(bench, tmp_path).run()
    probed = next(x for x in read_decisions(tmp_path / JOURNAL) if x["kind"] == "probed")
    assert probed["ratio"] == pytest.approx(4.0, rel=0.1)
    assert bench.beyond == []


def test_a_probe_that_was_ended_before_its_last_hold_is_not_gone_on_with(tmp_path):
    class Stiff(_Mortal):
        def play(self, folder: Path, voltages: Voltages) -> Played:
            with contextlib.suppress(_Killed):
                super().play(folder, voltages)
            record = read_record(folder / "record.csv")
            return Played(record, float(record.time_s[-1]), "travel: the tip is far out")

    bench = Stiff(NOTHING)
    bench.fatal = 1
    with pytest.raises(TrippedError):
        course(bench, tmp_path).run()
    with pytest.raises(RunError, match=r"the probe was ended at 2.5 V, before its last hold of 10 V"):
        course(bench, tmp_path).run()
    assert bench.plays == 1


@pytest.mark.parametrize("left_s", [9.0, 16.7, 33.3, 61.0])
def test_another_excitation_fits_into_what_is_left_of_the_budget(left_s):
    allowed = VirtualBench(NOTHING).allowed
    rng = np.random.default_rng(1)
    assert another_excitation(allowed, 35.0, LEFT_SHARE * left_s, rng).duration_s <= left_s


def test_killed_while_the_outcome_is_written_nothing_is_played_again(tmp_path, monkeypatch):
    def die(*_: object) -> None:
        raise _Killed

    with monkeypatch.context() as patch:
        patch.setattr("bender_investigate.outcome.write_atomically", die)
        with pytest.raises(_Killed):
            course(VirtualBench(NOTHING), tmp_path).run()
    assert kinds(tmp_path)[-1] == "gains"
    again = VirtualBench(NOTHING)
    course(again, tmp_path).run()
    assert (again.plays, kinds(tmp_path)[-1]) == (0, "done")


@pytest.mark.slow
@pytest.mark.parametrize("word", ["diagnosing", "weighing", "tuning"])
def test_killed_while_nothing_is_played_it_comes_to_the_same_end(tmp_path, word):
    case = replace(NOTHING, gain=1.25)
    settings = InvestigationSettings(budget_s=40.0, excitation_s=12.0, pairs=2, evaluations=40)
    told: list[str] = []

    def investigated(bench: VirtualBench, tell) -> None:
        Investigation(bench, read_model("paper"), read_gains(OWN_GAINS)[0], tmp_path, settings, tell).run()

    def die(sentence: str) -> None:
        told.append(sentence)
        if sentence.startswith(word):
            raise _Killed

    first = VirtualBench(case)
    with pytest.raises(_Killed):
        investigated(first, die)
    before = sorted(x.name for x in tmp_path.glob("[0-9][0-9]-*"))
    again = VirtualBench(case)
    investigated(again, lambda _: None)
    folders = sorted(x.name for x in tmp_path.glob("[0-9][0-9]-*"))
    assert before == ["01-rest", "02-excitation"]
    assert folders[:2] == before
    assert again.plays == len(folders) - 2
    assert len({x.split("-", 1)[1] for x in folders}) == len(folders)
    assert kinds(tmp_path)[-1] == "done"


@pytest.mark.slow
def test_a_hidden_lag_is_named_and_better_gains_are_proven_whatever_is_killed(tmp_path):
    case = next(
        x for x in (make_case("single", ("source_resistance",), k, "camera") for k in range(40)) if
        0.1 < x.effects[0].magnitude < 0.5
    )  # fmt: skip
    settings = InvestigationSettings(budget_s=160.0, excitation_s=40.0, pairs=3, evaluations=60)
    bench = _Mortal(case, 1)
    bench.fatal = 2
    with pytest.raises(_Killed):
        course(bench, tmp_path, settings).run()
    assert kinds(tmp_path)[-1] == "play"
    bench.fatal = 0
    outcome = course(bench, tmp_path, settings).run()
    assert (outcome.verdict, outcome.effects) == ("named", ("source_resistance",))
    assert bench.beyond == []
    assert outcome.comparison is not None
    assert outcome.comparison.judgement == "better"
    assert (tmp_path / "tuned" / "gains.toml").exists()
    assert outcome.gains == "tuned/gains.toml"
    parts = sorted(x.name for x in tmp_path.glob("0[23]-*"))
    assert parts == ["02-excitation", "03-excitation-rest"]
    lengths = [len(read_record(tmp_path / x / "record.csv")) for x in parts]
    assert sum(lengths) == pytest.approx(43.0 * 30.0, rel=0.1)
    np.testing.assert_array_less(0.0, np.array(outcome.comparison.old))


@pytest.mark.parametrize("cut", [1, 7, 30])
def test_a_line_that_a_crash_cut_short_is_taken_away(tmp_path, cut):
    path = tmp_path / JOURNAL
    journal = DecisionJournal(path)
    journal.write("play", "µm because", folder="01-rest")
    kept = path.read_bytes()
    journal.write("played", "as planned")
    journal.close()
    path.write_bytes(path.read_bytes()[: len(kept) + cut])
    again = DecisionJournal(path)
    assert [(x["n"], x["kind"], x["folder"]) for x in again.decisions] == [(0, "play", "01-rest")]
    assert path.read_bytes() == kept
    again.write("resumed", "goes on")
    again.close()
    assert [(x["n"], x["kind"]) for x in read_decisions(path)] == [(0, "play"), (1, "resumed")]


def test_a_damaged_line_in_the_middle_is_bad_input(tmp_path):
    path = tmp_path / JOURNAL
    lines = [json.dumps({"n": 0, "kind": "play", "why": ""}), "{]", json.dumps({"n": 2, "kind": "play", "why": ""})]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"line 2: found .* expected decision 1"):
        DecisionJournal(path)


def test_a_directory_without_a_journal_is_no_investigation(tmp_path):
    with pytest.raises(InputError, match="expected the directory of an investigation"):
        read_decisions(tmp_path / JOURNAL)


@pytest.mark.parametrize("content", [b"", b"\0" * 400, b"\n" * 3, b"\0" * 30 + b"\n"])
def test_nobody_goes_on_over_a_journal_that_was_lost(tmp_path: Path, content: bytes):
    (tmp_path / JOURNAL).write_bytes(content)
    (tmp_path / "play-01").mkdir()
    with pytest.raises(InputError, match=r"journal\.jsonl"):
        check_decisions(tmp_path / JOURNAL)


def test_an_investigation_that_was_ended_before_its_first_decision_is_gone_on_with(tmp_path: Path):
    for content in (b"", b'{"n": 0, "kin'):
        (tmp_path / JOURNAL).write_bytes(content)
        check_decisions(tmp_path / JOURNAL)


@pytest.mark.parametrize(
    ("verdict", "advice"),
    [
        ("likely", "`bender tune --model results/film/diagnosis-2/model.toml` tunes on it"),
        ("ambiguous", "`bender tune --model results/film/diagnosis-2/model.toml` tunes on it"),
        ("unexplained", "results/film/diagnosis-2/report.html says where"),
    ],
)
def test_an_open_verdict_says_what_can_be_done_with_it(verdict, advice):
    said = why_not_tuned(verdict, Path("results/film/diagnosis-2"))
    assert said.startswith(f"a verdict of {verdict} gives no model to tune on, the old gains stay; ")
    assert advice in said
