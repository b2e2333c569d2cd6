"""Records at the ends of what numbers can be: a verdict, or one sentence, and never a fault."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from reported_diagnosis import FRAME_S, levels, record_of, told
from scipy.signal import lfilter

from bender_cli.main import main
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.record_search import search_records
from bender_discrepancy.rivals import rival_models
from bender_discrepancy.workflow import diagnose, refuse_gain
from bender_identify.first_model.course import experiments_of
from bender_identify.first_model.learned import learn
from bender_identify.first_model.structures import Structure
from bender_inference.candidates import candidate_forms
from bender_inference.records.observations import observe
from bender_inference.search.judgement.rules import MOST_GAIN, Rules
from bender_inference.search.search import parsimonious
from bender_inference.settings import Settings
from bender_loop.errors import InputError
from bender_loop.records.record import Record, write_record
from bender_loop.tables.quantities import USUAL
from bender_plant.model import Model, load_model

ROWS = 300
TIME_s = FRAME_S * np.arange(ROWS, dtype=np.float64)
QUIET = ("no_gap", "recalibrated")


def steps(seed: int = 3) -> np.ndarray:
    return np.repeat(np.random.default_rng(seed).uniform(0.0, 50.0, ROWS // 10), 10)


def lagging(seed: int = 3) -> np.ndarray:
    """Return readings of a lag of two rows, without noise."""
    return np.asarray(lfilter([0.0, 0.08], [1.0, -0.6], steps(seed)))


def noise(size: float, seed: int = 4) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(ROWS)


def own_model(record: Record) -> Model:
    return learn(experiments_of([record], ["record"], "auto"), "own", USUAL)[1]


def ends(folder: Path, record: Record, words: list[str], capsys: pytest.CaptureFixture[str]) -> int:
    """Return the status of a command on a record: 0, or 2 with one sentence."""
    write_record(folder / "record.csv", record)
    status = main([*words, str(folder / "record.csv"), "--quiet"])
    said = capsys.readouterr().err.splitlines()
    assert not [x for x in said if not x.startswith("bender")]
    assert status == 0 or (status == 2 and len(said) == 1), said
    return status


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gain", "offset"), [(3e5, 0.0), (-3e7, -5e8), (1.0, 3e7), (1e-3, 9e8)], ids=["gain", "both", "far", "faint"]
)
def test_any_gain_and_offset_of_the_file_go_through_the_model_of_the_record_itself(
    gain: float, offset: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = Record(TIME_s, steps(), gain * (lagging() + noise(0.05)) + offset)
    model = str(tmp_path / "own.toml")
    assert ends(tmp_path, record, ["model", "fit", "--out", model], capsys) == 0
    assert ends(tmp_path, record, ["diagnose", "--model", model, "--out", str(tmp_path / "out")], capsys) == 0
    assert (tmp_path / "out" / "report.html").is_file()


@pytest.mark.parametrize("size", [1e-310, 1e-322])
@pytest.mark.parametrize("words", [["model", "fit"], ["diagnose"], ["diagnose", "--model", "own.toml"]])
def test_readings_that_are_nearly_nought_are_refused(
    size: float,
    words: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.toml").write_text(tomli_w.dumps(Structure().model([], 0.2 * size).to_table()))
    record = Record(TIME_s, steps(), size * (lagging() + noise(0.05)))
    assert ends(tmp_path, record, [*words, "--out", "m.toml"], capsys) == 2
    assert {x.name for x in tmp_path.iterdir()} == {"record.csv", "own.toml"}


@pytest.mark.parametrize("before_um", [0.0, 5.0])
def test_effects_have_a_size_where_the_readings_stand_still_on_the_rows_that_count(before_um: float) -> None:
    rows = np.arange(ROWS)
    seen = observe(Record(TIME_s, steps(), np.where(rows < 3, before_um, 0.0)))
    seen = replace(seen, usable=seen.usable & (rows >= 3))
    moving = candidate_forms(load_model("beam"), [observe(Record(TIME_s, steps(), lagging()))])
    assert [x.name for x in candidate_forms(load_model("beam"), [seen])] == [x.name for x in moving]


def only_once(row: int, value: float) -> np.ndarray:
    reading = np.zeros(ROWS)
    reading[row] = value
    return reading


@pytest.mark.slow
@pytest.mark.parametrize(
    "reading",
    [np.where(np.arange(ROWS) < 30, lagging(), 0.0), only_once(3, 12.0)],
    ids=["in rows before the first that counts", "in an outlier"],
)
def test_readings_that_move_only_where_no_row_counts_end_in_a_verdict_or_a_sentence(
    reading: np.ndarray, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    record = Record(TIME_s, steps(), reading)
    status = ends(tmp_path, record, ["diagnose", "--model", "auto", "--out", str(out)], capsys)
    assert (out / "diagnosis.json").is_file() is (status == 0)


def test_where_nothing_is_within_its_range_what_has_no_effect_stands() -> None:
    quiet = record_of("beam", voltage_V=levels(8.0))
    record = Record(quiet.time_s, quiet.voltage_V, 10.0 * MOST_GAIN * quiet.displacement_um)
    found = told([record], base=load_model("beam"))
    assert not any(Rules().is_in_range(found.archive, x) for x in found.archive.fits)
    assert not parsimonious(found.archive, Rules()).hypothesis.parts
    with pytest.raises(InputError, match="times those of the model beam, expected at most 10000"):
        refuse_gain(found)
    refuse_gain(told([quiet], base=load_model("beam")))


def test_a_rival_with_a_gain_that_no_model_holds_is_none() -> None:
    quiet = record_of("beam", voltage_V=levels(8.0))
    found = find(told([quiet], base=load_model("beam")))
    calibration = replace(found.search.best.calibration, gain=2.0 * MOST_GAIN)
    best = replace(found.search.best, calibration=calibration)
    search = replace(found.search, found=replace(found.search.found, best=best))
    assert rival_models(replace(found, search=search)) == ()


@pytest.mark.slow
def test_a_reading_that_is_its_command_lacks_nothing() -> None:
    command = np.random.default_rng(5).uniform(0.0, 50.0, ROWS)
    record = Record(TIME_s, command, command + noise(1e-6))
    found = diagnose(own_model(record), [record], Settings().between_rows("auto"))
    assert found.findings.verdict in QUIET
    assert found.findings.effects == ()


@pytest.mark.slow
def test_of_levels_that_are_read_in_their_own_row_no_effect_is_certain() -> None:
    record = Record(TIME_s, steps(), steps() + noise(1e-6))
    found = diagnose(own_model(record), [record], Settings().between_rows("auto"))
    assert found.findings.verdict not in ("named", "likely")
    assert not [x.id for x in found.findings.effects if x.grade in ("certain", "likely")]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_coarse_readings_with_a_gap_in_the_record_are_no_leakage(seed: int) -> None:
    read = 0.5 * np.round((lagging(seed) + noise(0.002, seed)) / 0.5)
    kept = (np.arange(ROWS) < 121) | (np.arange(ROWS) >= 129)
    record = Record(TIME_s[kept], steps(seed)[kept], read[kept])
    found = diagnose(own_model(record), [record], Settings().between_rows("auto"))
    assert "charge_leakage" not in [x.id for x in found.findings.effects]


@pytest.mark.slow
def test_four_effects_at_once_end_in_a_verdict() -> None:
    hidden = {
        "source_resistance": {"time_constant_s": 0.08},
        "electrostriction": {"coefficient_um_per_V2": 0.001},
        "creep": {"gains": (0.15,), "time_constants_s": (3.0,)},
        "periodic_disturbance": {"sine_um": 1.0, "cosine_um": 0.0, "frequency_Hz": 1.3},
    }
    found = search_records(load_model("beam"), [record_of("beam", hidden, levels(20.0))])
    assert found.verdict.word not in QUIET
    assert max(len(x.hypothesis.parts) for x in found.archive.fits) >= len(hidden)
    certain = [x.id for x in found.grades.effects if x.grade == "certain"]
    assert set(certain) <= set(hidden)
