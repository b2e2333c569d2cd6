"""`bender diagnose` as people call it: what it writes and refuses, and what an interrupt leaves to go on with."""

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
from fmpy import read_model_description
from reported_diagnosis import hypothesis, levels, record_of, told

from bender_cli.main import main
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.partial import partial_outcome, ranking
from bender_discrepancy.output_folder import all_or_no_files
from bender_discrepancy.record_search import search_records
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.journal import Journal, keeping, read_journal
from bender_inference.records.observations import observe
from bender_inference.search.result import Interrupted, SearchResult
from bender_loop.errors import InputError
from bender_loop.records.record import Record, write_record
from bender_plant.model import load_model, model_from_table

FILES = {"diagnosis.json", "model.toml", "model.fmu", "report.html"}
HEADER = "time_s,voltage_V,displacement_um\n"


def child(*words: object, cwd: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "bender_cli", "diagnose", *map(str, words)]
    return subprocess.Popen(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_a_missing_effect_is_named_and_everything_written(tmp_path: Path):
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.03}}, voltage_V=levels(12.0))
    write_record(tmp_path / "camera.csv", record)
    running = child("camera.csv", "--json", cwd=tmp_path)
    out, err = running.communicate()
    assert running.returncode == 0, err
    folder = tmp_path / "results" / "diagnose-camera"
    assert {path.name for path in folder.iterdir()} == FILES
    result = json.loads(out)
    assert result == json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    assert [effect["id"] for effect in result["effects"]] == ["source_resistance"]
    assert result["verdict"] == "named"
    assert result["effects"][0]["parameters"]["time_constant_s"]["value"] == pytest.approx(0.03, rel=0.02)
    assert result["gap"]["after"]["rms_um"] < 1.2 * result["gap"]["noise_floor_um"]
    import tomllib

    model = model_from_table(tomllib.loads((folder / "model.toml").read_text(encoding="utf-8")))
    assert model.values()["source_resistance.time_constant"] == pytest.approx(0.03, rel=0.02)
    variables = {x.name: x.causality for x in read_model_description(str(folder / result["fmu"])).modelVariables}
    assert (variables["voltage"], variables["displacement"], variables["tip_displacement"]) == (
        "input", "output", "output",
    )  # fmt: skip
    assert variables["source_resistance.time_constant"] == "parameter"


@pytest.mark.slow
def test_records_of_another_device_get_no_corrected_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    write_record(Path("other.csv"), record_of(voltage_V=levels(8.0), gain=20.0))
    assert main(["diagnose", "other.csv", "--json", "--out", "mine"]) == 0
    said = capsys.readouterr()
    assert "this looks like another device than paper" in said.err
    result = json.loads(said.out)
    assert (result["model"], result["fmu"]) == (None, None)
    assert "another device" in result["warnings"][0]
    assert {path.name for path in Path("mine").iterdir()} == {"diagnosis.json", "report.html"}


def rows(time_s: np.ndarray, voltage_V: np.ndarray, displacement_um: np.ndarray) -> str:
    table = zip(time_s.tolist(), voltage_V.tolist(), displacement_um.tolist(), strict=True)
    return HEADER + "".join(",".join(map(repr, row)) + "\n" for row in table)


def good(count: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    record = record_of(voltage_V=levels()[:count])
    return record.time_s.copy(), record.voltage_V.copy(), record.displacement_um.copy()


STILL = """\
format = 1
name = "still"
[[block]]
id = "linear_transduction"
sensitivity_um_per_V = 0.0
"""


def constant() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, np.full_like(voltage_V, 5.0), displacement_um)


def all_lost() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, voltage_V, np.full_like(displacement_um, np.nan))


def in_metres() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, voltage_V, 1e-6 * displacement_um)


def seconds_in_microseconds() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(1e6 * time_s, voltage_V, displacement_um)


def volts_in_microvolts() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, 1e6 * voltage_V, displacement_um)


def dead() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, voltage_V, np.ones_like(displacement_um))


@pytest.mark.parametrize(
    ("text", "options", "complaint"),
    [
        (None, [], "record.csv"),
        (constant(), [], "column voltage_V: found 5 V in every row from line 2 on"),
        (rows(*good(3)), [], "found 3 readings in 3 rows, expected at least 40"),
        (all_lost(), [], "found 0 readings in 60 rows, 60 of them lost"),
        (in_metres(), [], "--units"),
        (seconds_in_microseconds(), [], "line 3, column time_s: found a row 3.33e+04 s after the one before"),
        (volts_in_microvolts(), [], "voltage_V reaches 2e+07 V"),
        (dead(), [], "expected readings that change"),
        (rows(*good()), ["--model", "no_such"], "no_such"),
        (rows(*good()), ["record.csv"], "found the readings of record.csv again"),
        (rows(*good()), ["--model", "still.toml"], "does not move under the voltage"),
        (rows(*good()), ["--out", "record.csv"], "record.csv"),
        (rows(*good()), ["--out", "record.csv/below/it"], "record.csv"),
        (rows(*good()), ["--input-hold", "bent"], "--input-hold"),
        (rows(*good()), ["--units", "s,furlong,um"], "furlong"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    text: str | None,
    options: list[str],
    complaint: str,
):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("record.csv").write_text(text, encoding="utf-8")
    Path("still.toml").write_text(STILL, encoding="utf-8")
    before = set(tmp_path.rglob("*"))
    assert main(["diagnose", "record.csv", *options, "--quiet"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert complaint in err
    assert set(tmp_path.rglob("*")) == before


def test_a_stage_replaces_what_it_makes_and_nothing_else(tmp_path: Path):
    out = tmp_path / "a" / "b"
    with all_or_no_files(out) as stage:
        (stage / "new.txt").write_text("1")
        assert not out.exists()
    assert [path.name for path in out.iterdir()] == ["new.txt"]
    (out / "old.txt").write_text("mine")
    with all_or_no_files(out) as stage:
        (stage / "new.txt").write_text("2")
    assert {path.name: path.read_text() for path in out.iterdir()} == {"new.txt": "2", "old.txt": "mine"}


def test_a_stage_with_folders_is_saved_again_into_the_same_place(tmp_path: Path):
    """As a cell of a notebook that is run twice saves the diagnosis of several outputs."""
    out = tmp_path / "both"
    for words in ("1", "2"):
        with all_or_no_files(out) as stage:
            (stage / "tip").mkdir()
            (stage / "tip" / "report.html").write_text(words)
            (stage / "outputs.json").write_text(words)
        (out / "tip" / "mine.txt").write_text("mine")
    assert {x.name: x.read_text() for x in out.rglob("*") if x.is_file()} == {
        "outputs.json": "2", "report.html": "2", "mine.txt": "mine",
    }  # fmt: skip
    assert not [x for x in out.iterdir() if x.name.endswith(".tmp")]


def test_a_stage_that_fails_vanishes_with_what_was_made_for_it(tmp_path: Path):
    def fail() -> None:
        with all_or_no_files(tmp_path / "a" / "b" / "c") as stage:
            (stage / "half.txt").write_text("1")
            raise InputError("no")

    with pytest.raises(InputError, match="no"):
        fail()
    assert list(tmp_path.iterdir()) == []


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
        "go on with: bender diagnose two.csv --out mine --verbose --resume mine"
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
    unsettled = {"certain": False, "grade": "likely"}
    for one, other in zip(partial["effects"], whole["effects"], strict=True):
        weighed = other["weighed"] | {"passed": False}
        assert one == other | unsettled | {"weighed": weighed, "probability": one["probability"]}
    assert (partial["verdict"], partial["complete"]) == ("likely", False)
    told_differently = {"sentence", "reason", "effects", "model", "fmu", "partial", "ranking", "verdict", "complete"}
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


def test_a_search_that_goes_on_counts_the_work_of_each_search_as_if_it_had_not_been_broken_off() -> None:
    def steps(journal: Journal, counted: list[list[int]]) -> list[list[int]]:
        found = []
        for one in counted:
            journal.begin_search()
            found.append([journal.work_so_far(x) for x in one])
        return found

    whole = steps(Journal(), [[0, 100, 250], [0, 90, 200]])
    assert whole == [[0, 100, 250], [0, 90, 200]]
    # what is recalled is not simulated again
    assert steps(Journal(earlier_work=[0, 100]), [[0, 10, 160], [0, 90, 200]]) == whole
