"""A diagnosis that is interrupted keeps what it has ranked, says that it is partial, and leaves nothing else."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import IO

import numpy as np
import pytest
from few import few
from reported_diagnosis import hypothesis, levels, record_of, told

from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.partial import partial_outcome, ranking
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.journal import Journal, keeping, read_journal
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search.result import Interrupted, SearchResult
from bender_discrepancy.workflow import search_records
from bender_loop.errors import InputError
from bender_loop.records.record import Record, write_record
from bender_plant.model import load_model

LAG, DEAD = {"source_resistance": {"time_constant_s": 0.05}}, {"dead_zone": {"threshold_V": 3.0}}

needs_signals = pytest.mark.skipif(sys.platform == "win32", reason="a child cannot be sent an interrupt alone there")


def two_effects(duration_s: float) -> Record:
    return record_of(effects=LAG | DEAD, voltage_V=levels(duration_s))


def started(folder: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "bender_cli", "diagnose", *words]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def read_until(stream: IO[str] | None, words: str) -> None:
    """Read lines of progress until one has these words in it."""
    said = []
    for line in stream or ():
        said.append(line)
        if words in line:
            return
    raise AssertionError(f"expected {words!r} in {said}")


@pytest.mark.slow
@needs_signals
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_what_was_ranked_is_kept(tmp_path: Path, number: signal.Signals):
    write_record(tmp_path / "two.csv", two_effects(120.0))
    # a line of progress is plain at most every two seconds; `--verbose` says every step
    running = started(tmp_path, "two.csv", "--out", "mine", "--verbose")
    read_until(running.stderr, "step 2")
    running.send_signal(number)
    out, err = running.communicate()
    assert (running.returncode, out) == (130, "")
    said = [text for text in err.splitlines() if not text.startswith(("diagnose: ", "["))]
    assert said == [
        f"bender: interrupted; what was ranked until then is in {Path('mine/diagnosis.json')}, marked partial; "
        "go on with --resume mine"
    ]
    assert {path.name for path in tmp_path.iterdir()} == {"two.csv", "mine"}
    assert {path.name for path in (tmp_path / "mine").iterdir()} == {"diagnosis.json", "unfinished.json"}
    result = json.loads((tmp_path / "mine" / "diagnosis.json").read_text(encoding="utf-8"))
    assert result["partial"] is True
    assert (result["model"], result["fmu"], result["next_experiment"]) == (None, None, None)
    assert [effect["id"] for effect in result["effects"]] == ["source_resistance"]
    assert result["ranking"][0]["effects"] == ["source_resistance"]
    assert result["gap"]["after"]["rms_um"] < 0.2 * result["gap"]["recalibrated"]["rms_um"]


@needs_signals
@pytest.mark.slow
def test_an_older_complete_result_stays_and_an_older_part_is_replaced(tmp_path: Path):
    write_record(tmp_path / "two.csv", two_effects(120.0))
    (tmp_path / "mine").mkdir()
    result = tmp_path / "mine" / "diagnosis.json"
    for before, name in (('{"verdict": "named"}', "diagnosis.partial.json"), ('{"partial": true}', "diagnosis.json")):
        result.write_text(before, encoding="utf-8")
        running = started(tmp_path, "two.csv", "--out", "mine", "--verbose")
        read_until(running.stderr, "step 2")
        running.send_signal(signal.SIGHUP)
        _, err = running.communicate()
        assert running.returncode == 130
        assert str(Path("mine") / name) in next(x for x in err.splitlines() if x.startswith("bender: "))
        assert ("diagnosis.json there is of an earlier run" in err) is (name != "diagnosis.json")
        assert json.loads((tmp_path / "mine" / name).read_text(encoding="utf-8"))["partial"] is True
        assert (result.read_text(encoding="utf-8") == before) is (name != "diagnosis.json")


@needs_signals
@pytest.mark.parametrize("number", few([signal.SIGINT, signal.SIGTERM], 0))
def test_before_anything_was_ranked_nothing_is_written(tmp_path: Path, number: signal.Signals):
    # so long that the first ranking takes many times what this test needs to see that it began
    write_record(tmp_path / "long.csv", record_of(voltage_V=np.tile(levels(60.0), 20)))
    running = started(tmp_path, "long.csv", "--out", "results/mine")
    while not list(tmp_path.glob("results/.mine.*.tmp")):
        assert running.poll() is None, running.communicate()
        time.sleep(0.05)
    running.send_signal(number)
    _, err = running.communicate()
    assert running.returncode == 130, err
    assert err.splitlines()[-1] == "bender: interrupted before anything was ranked; nothing was written"
    assert "Traceback" not in err
    assert {path.name for path in tmp_path.iterdir()} == {"long.csv"}


def stopped_at(record: Record, words: str) -> SearchResult:
    """The diagnosis that an interrupt at a line of progress leaves."""

    def stop(text: str) -> None:
        if words in text:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stopped:
        search_records(load_model("paper"), [record], progress=stop)
    assert isinstance(stopped.value, Interrupted)
    return stopped.value.search


def test_the_diagnosis_that_is_kept_is_of_the_last_complete_step():
    found = stopped_at(two_effects(40.0), "step 2").found
    assert found.best.hypothesis.effects == ("source_resistance",)


def test_an_interrupt_before_the_first_ranking_keeps_nothing():
    def stop(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stopped:
        search_records(load_model("paper"), [two_effects(10.0)], progress=stop)
    assert not isinstance(stopped.value, Interrupted)


def by_hand() -> SearchResult:
    base, records = load_model("paper"), [record_of(effects=LAG)]
    best = hypothesis(base, records, ("source_resistance", (0.04,)))
    return told(records, best, [hypothesis(base, records, ("sensor_lag", (0.04,)))])


def test_a_partial_result_has_the_keys_of_a_whole_one_and_its_numbers():
    from bender_discrepancy.conclusion.partial import _simulated

    search = by_hand()
    findings = find(search)
    partial = partial_outcome(search, ["one.csv"], searched=False)
    whole = outcome(findings, _simulated(findings), ["one.csv"])
    assert set(partial) == set(whole) | {"partial", "ranking"}
    assert [x["certain"] for x in whole["effects"]] == [True]
    assert partial["effects"] == [x | {"certain": False} for x in whole["effects"]]
    told_differently = {"sentence", "reason", "effects", "model", "fmu", "partial", "ranking"}
    assert {k: v for k, v in partial.items() if k not in told_differently} == {
        k: v for k, v in whole.items() if k not in told_differently
    }
    assert "source resistance" in partial["sentence"]
    assert json.loads(json.dumps(partial, allow_nan=False)) == partial


def test_after_a_whole_search_its_sentence_stands():
    search = by_hand()
    result = partial_outcome(search, ["one.csv"], searched=True)
    assert (result["sentence"], result["partial"]) == ("Missing from the model: source resistance.", True)
    assert result["reason"] == search.verdict.reason


def test_the_ranking_counts_from_its_best():
    ranked = ranking(by_hand())
    assert [x["effects"] for x in ranked] == [["source_resistance"], ["sensor_lag"]]
    assert ranked[0]["delta_bic"] == 0.0
    assert ranked[1]["delta_bic"] > 10.0
    assert ranked[0]["rms_um"] < ranked[1]["rms_um"]


def searched(journal: Journal, record: Record, stop_at: str = "") -> SearchResult | None:
    """Search with a journal, interrupted at a line of progress; None where that came before the first ranking."""

    def stop(text: str) -> None:
        if stop_at and stop_at in text:
            raise KeyboardInterrupt

    with keeping(journal):
        try:
            return search_records(load_model("beam"), [record], progress=stop)
        except Interrupted as stopped:
            return stopped.search
        except KeyboardInterrupt:
            return None


@pytest.mark.slow
def test_a_search_goes_on_where_it_was_interrupted(tmp_path: Path):
    record = record_of("beam", effects=LAG | DEAD, voltage_V=levels(20.0))
    whole, cut = Journal(), Journal()
    expected = searched(whole, record)
    searched(cut, record, "step 2")
    assert 0 < len(cut.entries) < len(whole.entries)
    (tmp_path / "unfinished.json").write_text(cut.to_json(), encoding="utf-8")
    resumed = read_journal(tmp_path)
    found = searched(resumed, record)
    assert resumed.reused >= len(cut.entries)
    assert expected is not None
    assert found is not None
    # all of it, to the last bit
    assert found.best.hypothesis.effects == expected.best.hypothesis.effects
    assert found.best.hypothesis.values() == expected.best.hypothesis.values()
    assert found.best.training_square == expected.best.training_square
    assert found.best.covariance is not None
    assert expected.best.covariance is not None
    assert found.best.covariance.tolist() == expected.best.covariance.tolist()
    assert resumed.entries == whole.entries
    assert resumed.work[:2] == whole.work[:2]


def test_a_journal_of_other_records_is_of_no_use(tmp_path: Path):
    journal = Journal()
    record, other = (record_of("beam", effects=DEAD, voltage_V=levels(x)) for x in (5.0, 6.0))
    problems = [problem_of(load_model("beam"), (observe(x),)) for x in (record, other, record)]
    key, another, again = (journal.key(x, Hypothesis(), "fit", 12, False) for x in problems)
    journal.entries[key] = {"values": None}
    assert (journal.recall(another), journal.recall(again)) == (None, {"values": None})
    assert journal.key(problems[0], Hypothesis(), "fit", 12, True) != key
    assert journal.key(problem_of(load_model("paper"), problems[0].observations), Hypothesis(), "fit", 12, False) != key


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"version": "0", "entries": {}, "work": []}', "[" * 100_000])
def test_a_damaged_journal_is_bad_input(tmp_path: Path, text: str):
    (tmp_path / "unfinished.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="start anew without --resume"):
        read_journal(tmp_path)


def test_without_a_journal_there_is_nothing_to_resume(tmp_path: Path):
    with pytest.raises(InputError, match="what an interrupted diagnosis left"):
        read_journal(tmp_path)
