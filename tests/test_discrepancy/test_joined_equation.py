"""An equation without a name in the corrected model closes what no effect explains, within what it was learned from."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of, told

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import Findings, find
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.equation.joined import with_equation, written
from bender_discrepancy.equation.lead import Lead, find_lead
from bender_discrepancy.equation.lead_terms import AT_ONCE, AT_ONCE_TIMED, RATE_INDEPENDENT, RELAXING
from bender_discrepancy.fitting.hypothesis import Part
from bender_discrepancy.fitting.journal import Journal, keeping
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.fitting.own_numbers import own_form
from bender_discrepancy.report.page import report_page
from bender_discrepancy.report.summary import summary
from bender_discrepancy.search.result import SearchResult
from bender_loop.records.record import Record
from bender_plant.blocks.residual_equation import powers_of

DECAY_per_s, PUSH_um_per_V2 = 0.5, 4e-3


def relaxing_um(volts: np.ndarray) -> np.ndarray:
    """r' = -a r + b v v', solved from row to row: a jump of the voltage at once, then a decay under the held one."""
    r, before, found = 0.0, 0.0, [0.0]
    for v in volts[:-1]:
        r += 0.5 * PUSH_um_per_V2 * (v * v - before * before)
        r, before = r * np.exp(-DECAY_per_s * FRAME_S), v
        found.append(r)
    return np.array(found)


def with_hidden(volts: np.ndarray, seed: int) -> Record:
    plain = record_of(voltage_V=volts, seed=seed)
    return replace(plain, displacement_um=plain.displacement_um + relaxing_um(volts))


@pytest.fixture(scope="module")
def unexplained() -> SearchResult:
    return told([with_hidden(levels(50.0), 7)], word="unexplained")


@pytest.fixture(scope="module")
def joined(unexplained: SearchResult) -> tuple[Findings, Lead]:
    lead = find_lead(unexplained)
    found = with_equation(unexplained, lead)
    assert found is not None
    return find(found), lead


def test_the_equation_is_in_the_corrected_model_and_closes_the_gap(
    joined: tuple[Findings, Lead], tmp_path: Path
) -> None:
    findings, lead = joined
    assert findings.verdict == "unexplained"
    assert not findings.effects
    measured = measure(findings.search, findings.model, findings.calibration, tmp_path / "model.fmu")
    assert measured.after.rms_um < 1.15 * NOISE_um < 3.0 * NOISE_um < measured.recalibrated.rms_um
    result = outcome(findings, measured, ["one.csv"], None, lead)
    (entry,) = result["effects"]
    assert entry["id"] == "sparse_equation"
    assert not entry["certain"]
    numbers = dict(zip(entry["terms"], (x["value"] for x in entry["parameters"].values()), strict=True))
    assert numbers == pytest.approx({"r": -DECAY_per_s, "v v'": PUSH_um_per_V2}, rel=0.05)
    assert entry["valid"]["voltage_V"] == [0.0, float(levels(50.0).max())]
    assert result["lead"]["in_model"]
    schema = Path(__file__).parents[2] / "docs" / "reference" / "diagnosis.schema.json"
    Draft202012Validator(json.loads(schema.read_text(encoding="utf-8"))).validate(json.loads(json.dumps(result)))
    assert "in the corrected model" in " ".join(" ".join(summary(findings, measured, result, tmp_path)).split())
    assert "It is in the corrected model" in " ".join(report_page(findings, measured, result, lead).split())


def test_it_holds_on_another_record_and_knows_nothing_beyond_the_range(joined: tuple[Findings, Lead]) -> None:
    findings, _ = joined
    volts = levels(40.0, seed=11)
    other = with_hidden(volts, 9)
    reading = Simulator(Drive.of_rows(other.time_s, volts)).run(findings.model).reading_um
    assert np.sqrt(np.mean((other.displacement_um - reading) ** 2)) < 1.5 * NOISE_um
    largest = next(x.parameters for x in findings.model.blocks if x.id == "residual_equation").largest_residual_um
    far = Drive.of_rows(other.time_s, 20.0 * volts)
    plain = Simulator(far).run(findings.search.base).reading_um
    assert np.max(np.abs(Simulator(far).run(findings.model).reading_um - plain)) < 1.2 * largest


def test_noise_gets_no_equation_into_the_model(unexplained: SearchResult, joined: tuple[Findings, Lead]) -> None:
    """The same equation, offered for a record that has nothing of it."""
    plain = told([record_of(voltage_V=levels(50.0))], word="unexplained")
    assert with_equation(plain, joined[1]) is None
    assert with_equation(unexplained, Lead(None, reason="there are too few readings")) is None


def test_the_block_reads_every_term_of_the_library() -> None:
    for terms, gives in ((RELAXING, "rate"), (RATE_INDEPENDENT, "rate"), (AT_ONCE, "value"), (AT_ONCE_TIMED, "value")):
        read = [powers_of(written(x), gives) for x in terms]
        assert len(set(read)) == len(terms)
        for x, powers in zip(terms, read, strict=True):
            assert (powers.r + powers.r_magnitude, powers.v + powers.v_magnitude, powers.y + powers.y_magnitude) == (
                x.r,
                x.v + (x.magnitude == "v"),
                x.y + (x.magnitude == "y"),
            )


def test_it_is_fitted_anew_where_a_diagnosis_goes_on(unexplained: SearchResult) -> None:
    """What a journal told of the hypothesis without the equation is not told of the one with it."""
    own = own_form(unexplained.base)
    assert own is not None
    freed = replace(unexplained.best.hypothesis, own=Part(own, tuple(x.starts[0] for x in own.free)))
    with keeping(Journal()):
        plain = fit(unexplained.problem, freed)
        assert plain is not None
        search = replace(unexplained, found=replace(unexplained.found, best=plain))
        found = with_equation(search, find_lead(search))
    assert found is not None
    assert found.best.hypothesis.equation is not None
    assert found.best.training_square < 0.1 * plain.training_square
