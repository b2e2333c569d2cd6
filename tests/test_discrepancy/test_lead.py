"""The lead of an unexplained diagnosis, and its equation in the corrected model, against effects integrated here."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of, told

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import Findings, find
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_inference.equation import lead as lead_module
from bender_inference.equation.joined import with_equation, written
from bender_inference.equation.lead import Lead, find_lead
from bender_inference.equation.lead_terms import AT_ONCE, AT_ONCE_TIMED, RATE_INDEPENDENT, RELAXING, Term, equation
from bender_inference.fitting.hypothesis import Part
from bender_inference.fitting.journal import Journal, keeping
from bender_inference.fitting.output_error import fit
from bender_inference.fitting.own_numbers import own_form
from bender_inference.search.result import SearchResult
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.blocks.residual_equation import powers_of
from bender_plant.model import load_model

DECAY, PUSH = 0.5, 4e-3
Slope = Callable[[float, float], float]
Jump = Callable[[float, float, float], float]


def lead_from(findings):
    return find_lead(findings.search)


def integrated(time_s: np.ndarray, volts: np.ndarray, slope: Slope, jump: Jump, steps: int = 40) -> np.ndarray:
    """Solve r' = slope(r, v) by the midpoint rule under held voltages; at each change r = jump(r, before, after)."""
    r, before, found = 0.0, 0.0, [0.0]
    for k in range(time_s.size - 1):
        r, before = jump(r, before, float(volts[k])), float(volts[k])
        h = (time_s[k + 1] - time_s[k]) / steps
        for _ in range(steps):
            r += h * slope(r + 0.5 * h * slope(r, before), before)
        found.append(r)
    return np.array(found)


def pushed(time_s: np.ndarray, volts: np.ndarray) -> np.ndarray:
    """Return the solution of r' = -a r + b |v| v'."""
    return integrated(
        time_s, volts, lambda r, _: -DECAY * r, lambda r, u, v: r + 0.5 * PUSH * (v * abs(v) - u * abs(u))
    )


def slower_when_low(time_s: np.ndarray, volts: np.ndarray) -> np.ndarray:
    """Return the solution of r' = -(a + b v) r + c v': a lag whose time constant depends on the voltage."""
    return integrated(time_s, volts, lambda r, v: -(0.3 + 0.1 * v) * r, lambda r, u, v: r + 0.1 * (v - u))


def unexplained(record: Record, hidden_um: np.ndarray, **how: Any) -> Findings:
    with_it = Record(record.time_s, record.voltage_V, record.displacement_um + hidden_um)
    return find(told([with_it], word="unexplained", **how))


@pytest.fixture(scope="module")
def camera() -> Record:
    return record_of(voltage_V=levels(50.0))


@pytest.fixture(scope="module")
def relaxing(camera: Record) -> tuple[Findings, Lead]:
    findings = unexplained(camera, pushed(camera.time_s, camera.voltage_V))
    found = lead_from(findings)
    assert found is not None
    return findings, found


def coefficients(found: Lead) -> dict[str, float]:
    told_of = found.to_dict()
    assert told_of is not None, found.reason
    return {x["term"]: x["coefficient"] for x in told_of["terms"]}


def test_an_equation_outside_of_the_catalogue_is_recovered(relaxing: tuple[Findings, Lead]):
    found = coefficients(relaxing[1])
    assert found == pytest.approx({"r": -DECAY, "v dv/dt": PUSH}, rel=0.03)
    assert relaxing[1].explains > 0.99


def test_what_it_explains_is_that_of_its_free_run_on_rows_that_no_fit_saw(
    camera: Record, relaxing: tuple[Findings, Lead]
):
    findings, found = relaxing
    told_of = coefficients(found)
    # solved here, by other means, with gain and offset readjusted on the rows of the fit
    run = integrated(
        camera.time_s,
        camera.voltage_V,
        lambda r, _: told_of["r"] * r,
        lambda r, u, v: r + 0.5 * told_of["v dv/dt"] * (v * v - u * u),
    )
    x, left = findings.search.problem.observations[0], findings.search.best.residuals[0]
    reading = Simulator(x.drive).run(load_model("paper")).reading_um
    beside = np.column_stack([reading, np.ones_like(reading)])
    solution = np.linalg.lstsq(beside[x.training], (left - run)[x.training], rcond=None)[0]
    rest = (left - run - beside @ solution)[x.judging]
    above = float(np.mean(left[x.judging] ** 2)) - NOISE_um**2
    expected = 1.0 - max(float(np.mean(rest**2)) - NOISE_um**2, 0.0) / above
    assert found.explains == pytest.approx(expected, abs=2e-3)
    assert np.allclose(found.drawn[0].gives_um, run + beside @ solution, atol=0.02)


@pytest.mark.slow
def test_lost_and_outlying_readings_change_little(camera: Record):
    readings = pushed(camera.time_s, camera.voltage_V)
    rng = np.random.default_rng(3)
    readings[rng.random(readings.size) < 0.05] = np.nan
    findings = unexplained(camera, readings)
    search = findings.search
    fewer = search.problem.observing([search.problem.observations[0].without(rng.random(readings.size) < 0.02)])
    fewer_found = replace(search.found, archive=replace(search.archive, problem=fewer))
    found = lead_from(replace(findings, search=replace(search, found=fewer_found)))
    assert found is not None
    assert coefficients(found) == pytest.approx({"r": -DECAY, "v dv/dt": PUSH}, rel=0.04)
    assert found.rows < readings.size


@pytest.mark.slow
def test_products_with_what_is_left_are_recovered(camera: Record):
    found = lead_from(unexplained(camera, slower_when_low(camera.time_s, camera.voltage_V)))
    assert found is not None
    assert coefficients(found) == pytest.approx({"r": -0.3, "r v": -0.1, "dv/dt": 0.1}, rel=0.1)


@pytest.mark.slow
def test_what_follows_at_once_is_an_equation_without_time(camera: Record):
    acting = np.concatenate([[0.0], camera.voltage_V[:-1]])
    found = lead_from(unexplained(camera, 1e-5 * acting**3))
    assert found is not None
    assert found.text.startswith("r = ")
    assert coefficients(found) == pytest.approx({"v^3": 1e-5}, rel=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_gives_no_lead(seed: int):
    found = lead_from(find(told([record_of(voltage_V=levels(30.0), seed=seed)], word="unexplained")))
    assert found is not None
    assert found.to_dict() is None
    assert "noise" in found.reason


@pytest.mark.slow
def test_a_shape_that_follows_nothing_gives_no_lead(camera: Record):
    events = np.cumsum(np.random.default_rng(1).random(camera.time_s.size) < 0.01) % 2
    found = lead_from(unexplained(camera, events - 0.5))
    assert found is not None
    assert found.to_dict() is None
    assert "no equation" in found.reason


def test_a_model_that_runs_away_gives_no_lead(relaxing: tuple[Findings, Lead], monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> None:
        raise ArithmeticError("it ran away")

    monkeypatch.setattr(lead_module, "tracks", fail)
    found = lead_from(relaxing[0])
    assert found is not None
    assert (found.to_dict(), found.reason) == (None, "the model cannot be simulated in its own sub-steps (it ran away)")


def test_a_fault_of_ours_is_not_told_as_a_finding(relaxing: tuple[Findings, Lead], monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> None:
        raise KeyError("a fault")

    monkeypatch.setattr(lead_module, "tracks", fail)
    with pytest.raises(KeyError, match="a fault"):
        lead_from(relaxing[0])


def test_untimed_records_get_nothing_that_runs_with_time(camera: Record):
    volts = np.concatenate([np.arange(0.0, 50.0), np.arange(50.0, 0.0, -1.0)] * 6)
    record = record_of(voltage_V=volts)
    hidden = integrated(FRAME_S * np.arange(volts.size), volts, lambda *_: 0.0, lambda r, u, v: r + 0.01 * abs(v - u))
    found = lead_from(unexplained(record, hidden, settings=Settings(untimed=True)))
    assert found is not None
    assert found.equation is not None, found.reason
    assert all(x.rate for x in found.equation.terms) or not found.equation.per_second


@pytest.mark.slow
def test_two_records_share_one_equation(camera: Record):
    other = record_of(voltage_V=levels(30.0, seed=5), seed=8, offset_um=2.0)
    records = [
        Record(x.time_s, x.voltage_V, x.displacement_um + pushed(x.time_s, x.voltage_V)) for x in (camera, other)
    ]
    found = lead_from(find(told(records, word="unexplained")))
    assert found is not None
    assert coefficients(found) == pytest.approx({"r": -DECAY, "v dv/dt": PUSH}, rel=0.03)
    assert [x.left_um.size for x in found.drawn] == [len(x) for x in records]


def test_long_records_are_thinned(camera: Record, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(lead_module, "MOST_ROWS", 500)
    found = lead_from(unexplained(camera, pushed(camera.time_s, camera.voltage_V)))
    assert found is not None
    assert found.rows <= 500
    assert coefficients(found) == pytest.approx({"r": -DECAY, "v dv/dt": PUSH}, rel=0.2)


@given(st.sampled_from((*RELAXING, *RATE_INDEPENDENT, *AT_ONCE)), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_units_of_coefficients_are_those_of_their_terms(term: Term, metre: float, volt: float):
    """In other units of length and voltage a coefficient changes as its unit says."""
    values = {"um": metre, "V": volt, "s": 1.0}
    size = float(term.of_tip_and_voltage(np.array([volt]), np.array([metre]))[0]) * metre**term.r
    size *= {"": 1.0, "v": volt, "y": metre}[term.rate.strip("|")]
    unit = 1.0
    above, _, below = term.unit(per_second=True).partition("/")
    for text, sign in ((above, 1), (below.strip("()"), -1)):
        for word in text.split():
            name, power = re.fullmatch(r"(um|V|s|1)(\d?)", word).groups()  # type: ignore[union-attr]
            unit *= values.get(name, 1.0) ** (sign * int(power or 1))
    assert unit * size == pytest.approx(metre, rel=1e-9)


def test_equations_are_read_with_their_signs():
    terms = (Term(r=1), Term(v=1, rate="v"), Term())
    assert equation(terms, (-0.5, 4e-3, -1.0), True) == "dr/dt = −0.5 r + 0.004 v dv/dt − 1"
    assert equation((Term(v=2),), (1e-5,), False) == "r = 1 × 10⁻⁵ v²"
    assert len({x.name for x in (*RELAXING, *RATE_INDEPENDENT)}) == len(RELAXING) + len(RATE_INDEPENDENT)


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
def relaxed() -> SearchResult:
    return told([with_hidden(levels(50.0), 7)], word="unexplained")


@pytest.fixture(scope="module")
def joined(relaxed: SearchResult) -> tuple[Findings, Lead]:
    lead = find_lead(relaxed)
    found = with_equation(relaxed, lead)
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


def test_noise_gets_no_equation_into_the_model(relaxed: SearchResult, joined: tuple[Findings, Lead]) -> None:
    """The same equation, offered for a record that has nothing of it."""
    plain = told([record_of(voltage_V=levels(50.0))], word="unexplained")
    assert with_equation(plain, joined[1]) is None
    assert with_equation(relaxed, Lead(None, reason="there are too few readings")) is None


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


@pytest.mark.slow
def test_it_is_fitted_anew_where_a_diagnosis_goes_on(relaxed: SearchResult) -> None:
    """What a journal told of the hypothesis without the equation is not told of the one with it."""
    own = own_form(relaxed.base)
    assert own is not None
    freed = replace(relaxed.best.hypothesis, own=Part(own, tuple(x.starts[0] for x in own.free)))
    with keeping(Journal()):
        plain = fit(relaxed.problem, freed)
        assert plain is not None
        search = replace(relaxed, found=replace(relaxed.found, best=plain))
        found = with_equation(search, find_lead(search))
    assert found is not None
    assert found.best.hypothesis.equation is not None
    assert found.best.training_square < 0.1 * plain.training_square
