"""Steps and last digits of sensors: how finely they are found, and records that no camera would give."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of, told
from scipy.optimize import minimize

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy import record_search
from bender_discrepancy.conclusion.coarse_readings import NEARER, ROUNDED, step_in_motion_um, support
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.record_search import search_records
from bender_discrepancy.workflow import diagnose
from bender_effects.form import Free, simple
from bender_inference.candidates import candidate_forms
from bender_inference.fitting.fit_problem import Calibration, line_through_steps, problem_of, straight_line
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, training_residual
from bender_inference.fitting.scans.chosen import scan_any
from bender_inference.records.digits import DIGITS, jitter_um, printed
from bender_inference.records.noise import least_noise_um
from bender_inference.records.observations import observe
from bender_inference.search.result import Interrupted, SearchResult
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_plant.plant import Plant
from piezo_bender import load_record

PAPER, BENCH = load_model("paper"), load_model("bench")


@pytest.mark.parametrize("step_V", [0.8977, 1.731])
def test_no_step_of_the_supply_nearby_is_better(step_V: float):
    """Commands between the levels, at every row another: the misfit falls in jumps, and a slope finds nothing."""
    volts = np.random.default_rng(4).uniform(0.0, 50.0, 1500)
    record = record_of(effects={"supply_quantisation": {"step_V": step_V}}, voltage_V=volts)
    observations = (observe(record),)
    bench = problem_of(PAPER, observations)
    form = next(x for x in candidate_forms(PAPER, observations) if x.effect == "supply_quantisation")
    start, *_ = scan_any(bench, Hypothesis(), form, NOISE_um)
    assert start.values[0] == pytest.approx(step_V, rel=1e-3)
    for share in np.linspace(-2e-3, 2e-3, 41):
        left = training_residual(bench, Hypothesis().plus(form, (start.values[0] * (1.0 + float(share)),)))
        assert left is not None
        assert float(left @ left) > 0.98 * start.square


def looped(step_um: float, seed: int = 5, rows: int = 900, row_s: float = 1.0 / 30.0) -> Record:
    """A loop whose controller follows every step of its sensor, so that neither command nor tip ever stands."""
    plant, noise = Plant(BENCH), NOISE_um * np.random.default_rng(seed).standard_normal(rows)
    state, voltage_V, integral_V, before_um = plant.initial(), 0.0, 0.0, 0.0
    volts, readings = np.zeros(rows), np.zeros(rows)
    for k in range(rows):
        if k:
            state, reading_um, _ = plant.step(state, voltage_V, (k - 1) * row_s, row_s)
            readings[k] = step_um * np.rint((reading_um + noise[k]) / step_um)
        error_um = 10.0 + 6.0 * np.sin(0.4 * k * row_s) - readings[k]
        integral_V += 3.0 * error_um * row_s
        voltage_V = integral_V + 0.8 * error_um - 0.02 * (readings[k] - before_um) / row_s
        before_um, volts[k] = readings[k], voltage_V
    return Record(row_s * np.arange(rows, dtype=np.float64), volts, readings)


@pytest.mark.slow
def test_steps_of_a_sensor_show_although_a_loop_follows_each_of_them():
    record = looped(1.25)
    assert np.mean(jitter_um(record.displacement_um, record.voltage_V) < 1.25 / 2.0) < 0.2
    told: list[str] = []
    found = find(search_records(BENCH, [record], progress=told.append))
    assert any("searching again" in x for x in told)
    assert (found.verdict, found.complete, [x.id for x in found.added]) == ("named", True, ["sensor_quantisation"])


@pytest.mark.slow
def test_records_of_one_sensor_have_one_step():
    """Each finds it in its own readings, equal but for the last digits of a sum."""
    records = [looped(1.5 / 7.0, seed) for seed in (5, 6)]
    assert step_in_motion_um(told(records, base=BENCH)) == pytest.approx(1.5 / 7.0, rel=1e-9)
    assert step_in_motion_um(told([records[0], looped(1.7 / 7.0)], base=BENCH)) == 0.0


@pytest.mark.slow
def test_an_interrupt_of_the_second_search_keeps_the_first(monkeypatch: pytest.MonkeyPatch):
    done: list[SearchResult] = []
    search = record_search._searched

    def once(*arguments: Any) -> SearchResult:
        if done:
            raise KeyboardInterrupt
        done.append(search(*arguments))
        return done[0]

    monkeypatch.setattr(record_search, "_searched", once)
    with pytest.raises(Interrupted) as stop:
        search_records(BENCH, [looped(1.25)])
    assert stop.value.search is done[0]
    assert stop.value.searched


def a_model(name: str, numbers: int, square: float) -> Fitted:
    """A hypothesis of one effect with so many numbers, which leaves so much."""
    free = tuple(Free(f"{name}_{k}", 0.0, 2.0, False, (1.0,)) for k in range(numbers))
    hypothesis = Hypothesis().plus(simple(name, *free), (1.0,) * numbers)
    return Fitted(hypothesis, Calibration(1.0, (0.0,)), (), square, square)


def beside(first: Fitted, name: str, mean_square: float, rows: int) -> Fitted:
    """A hypothesis with one effect more, which leaves so much in every row."""
    added = a_model(name, 1, 0.5 * mean_square * rows)
    return replace(added, hypothesis=first.hypothesis.plus(added.hypothesis.parts[0].form, (1.0,)))


STEP_um = 2.9


def dwelling(seed: int, rows: int = 600) -> np.ndarray:
    """What dwells at few levels is rounded the same way for long: a straight line through that is off."""
    return np.repeat(np.random.default_rng(seed).uniform(0.0, 25.0, rows // 30), 30)


def left_beyond(line: Calibration, simulated: np.ndarray, read: np.ndarray, step_um: float) -> np.ndarray:
    left = read - line.gain * simulated - line.offsets_um[0]
    return left - np.clip(left, -step_um / 2.0, step_um / 2.0)


@settings(max_examples=25)
@example(seed=88, gain=0.3, offset_um=0.0, step_um=0.1)
@given(
    seed=st.integers(0, 10_000), gain=st.floats(0.3, 3.0), offset_um=st.floats(-5.0, 5.0), step_um=st.floats(0.1, 6.0)
)
def test_a_line_that_explains_every_step_is_found(seed: int, gain: float, offset_um: float, step_um: float) -> None:
    simulated = dwelling(seed)
    read = step_um * np.round((gain * simulated + offset_um) / step_um)
    line = line_through_steps([simulated], [read], [step_um / 2.0], straight_line([simulated], [read]))
    assert np.max(np.abs(left_beyond(line, simulated, read, step_um))) < 1e-3 * step_um


@pytest.mark.parametrize("seed", range(6))
def test_no_other_line_lies_less_beyond_noisy_steps(seed: int) -> None:
    simulated, rng = dwelling(seed), np.random.default_rng(seed)
    read = STEP_um * np.round((1.1 * simulated - 0.4 + 0.2 * rng.standard_normal(simulated.size)) / STEP_um)

    def square(x: np.ndarray) -> float:
        return float(np.sum(left_beyond(Calibration(x[0], (x[1],)), simulated, read, STEP_um) ** 2))

    start = straight_line([simulated], [read])
    line = line_through_steps([simulated], [read], [STEP_um / 2.0], start)
    tight = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000}
    least = minimize(square, [1.1, -0.4], method="Nelder-Mead", options=tight).fun
    assert square(np.array([line.gain, *line.offsets_um])) <= least * (1.0 + 1e-4) + 1e-9
    if seed == 0:
        assert square(np.array([start.gain, *start.offsets_um])) > 2.0 * least


def test_records_share_the_gain_and_have_offsets_of_their_own() -> None:
    runs = [dwelling(1), dwelling(2)]
    read = [STEP_um * np.round((1.2 * y + c) / STEP_um) for y, c in zip(runs, (0.7, -1.9), strict=True)]
    line = line_through_steps(runs, read, [STEP_um / 2.0] * 2, straight_line(runs, read))
    assert line.gain == pytest.approx(1.2, abs=0.05)
    assert line.offsets_um == pytest.approx((0.7, -1.9), abs=0.5)


def readings_left(deviation: float) -> np.ndarray:
    rng = np.random.default_rng(7)
    truth = rng.uniform(0.0, 40.0, 4000)
    return np.round(truth + deviation * rng.standard_normal(truth.size)) - truth


@pytest.mark.parametrize("deviation", [0.03, 0.1, 0.2, 0.4, 1.0, 4.0])
@pytest.mark.parametrize("limit", [NEARER, ROUNDED])
def test_readings_tell_whether_the_simulation_is_nearer_than_a_limit(deviation: float, limit: float) -> None:
    left = readings_left(deviation)
    told = float(np.sum(support(STEP_um * left, STEP_um, limit)))
    assert (told > 10.0) is (deviation < limit)
    assert (told < -10.0) is (deviation > limit)
    assert told == pytest.approx(float(np.sum(support(left, 1.0, limit))), abs=1e-6)


@pytest.mark.parametrize(("deviation", "nearer"), [(0.09, True), (0.17, False)])
def test_up_to_an_eighth_of_a_step_rounding_brings_a_simulation_nearer(deviation: float, nearer: bool) -> None:
    rng = np.random.default_rng(9)
    truth = rng.uniform(0.0, 40.0, 100_000)
    read = np.round(truth + deviation * rng.standard_normal(truth.size))
    assert (np.mean((read - np.round(truth)) ** 2) < np.mean((read - truth) ** 2)) is np.bool_(nearer)


def test_where_in_its_step_a_level_dwells_does_not_decide() -> None:
    """A simulation that dwells where the reading is in the middle of its step is as near to it rounded as not."""
    left = np.repeat(np.random.default_rng(8).uniform(-0.1, 0.1, 20), 200)
    told = support(left, 1.0, ROUNDED).reshape(20, 200).sum(axis=1)
    assert np.all(told >= 0.0)
    assert told.sum() > 20.0


SAMPLE = Path(__file__).parents[2] / "examples" / "record.csv"

FACTORS = (1e3, 1e-3, 1e6, 1.0 / 60.0, 1.0 / 25_400.0)


@given(st.integers(0, 2**32 - 1), st.sampled_from(FACTORS), st.floats(-3.0, 3.0))
@examples(max_examples=30)
def test_a_conversion_there_and_back_leaves_the_same_bits(seed: int, factor: float, size: float) -> None:
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.01, 0.05, 200))
    volts, reading = rng.uniform(0.0, 50.0, 200) * 10.0**size, rng.standard_normal(200)
    reading[7] = np.nan
    own = Record(time_s, volts, reading)
    there, back = factor, 1.0 / factor
    converted = Record(time_s * there * back, volts * there * back, reading * there * back)
    one, other = printed(own), printed(converted)
    different = 0
    for name, values in one.columns().items():
        different += int(np.sum(~np.isclose(values, other.columns()[name], rtol=0.0, atol=0.0, equal_nan=True)))
        assert np.nanmax(np.abs(values - own.columns()[name])) <= 10.0 ** (1 - DIGITS) * np.nanmax(np.abs(values))
    assert np.max(np.abs(np.diff(one.time_s) - np.diff(time_s))) < 1e-8 * 0.05
    # a value within 1e-16 of the middle of two decimals, of 600
    assert different <= 1


@pytest.mark.parametrize("values", [[0.0, 0.1, 0.25], [2.5, 2.5, 2.5], [1e9, 1e9 + 1e-6, 1e9 + 2e-6], [0.0, 0.0, 0.0]])
def test_digits_that_were_written_stay_as_they_are(values: list[float]) -> None:
    record = Record(np.arange(3.0), np.array(values), np.array([1.0, np.nan, 2.0]))
    assert np.array_equal(printed(record).voltage_V, record.voltage_V)
    assert np.array_equal(printed(record).displacement_um, record.displacement_um, equal_nan=True)


@pytest.mark.parametrize("gap_s", [1e12, 1e6, 0.0])
def test_rows_beside_a_long_gap_keep_their_distances(gap_s: float) -> None:
    time_s = np.concatenate([np.arange(50.0) / 3.0, gap_s + 100.0 + np.arange(50.0) / 3.0])
    record = Record(time_s, np.ones(100), np.arange(100.0))
    assert np.diff(printed(record).time_s) == pytest.approx(np.diff(time_s), abs=1e-8)


@pytest.mark.parametrize("units", ["ms,mV,nm", "us,kV,mm", "min,uV,m"])
def test_a_record_in_other_units_is_searched_as_the_same_numbers(units: str) -> None:
    """What is searched is the same to the last bit but for ties, so the verdict and its numbers are."""
    known = {"ms": 1e3, "us": 1e6, "min": 1 / 60, "mV": 1e3, "kV": 1e-3, "uV": 1e6, "nm": 1e3, "mm": 1e-3, "m": 1e-6}
    per = [known[unit] for unit in units.split(",")]
    own = load_record(SAMPLE).record
    columns = {
        name: factor * getattr(own, name)
        for name, factor in zip(("time_s", "voltage_V", "displacement_um"), per, strict=True)
    }
    read = load_record(columns, units=units).record
    for name in columns:
        one, other = getattr(printed(own), name), getattr(printed(read), name)
        assert np.mean(~np.isclose(one, other, rtol=0.0, atol=0.0, equal_nan=True)) <= 0.002
        assert np.allclose(one, other, rtol=1e-9, atol=1e-9 * float(np.nanmax(np.abs(one))), equal_nan=True)


def exact(duration_s: float = 14.0) -> Record:
    """A record without noise of the model as given."""
    volts = levels(duration_s)
    time_s = FRAME_S * np.arange(volts.size, dtype=np.float64)
    return Record(time_s, volts, Simulator(Drive.of_rows(time_s, volts)).run(PAPER).reading_um)


@pytest.mark.slow
@pytest.mark.parametrize("decimals", [2, 3, 6])
def test_another_simulator_that_prints_its_readings_agrees(decimals: int) -> None:
    record = exact()
    record = replace(record, displacement_um=np.round(record.displacement_um, decimals))
    found = search_records(PAPER, [record])
    assert found.verdict.word == "no_gap"
    assert found.archive.noise_um >= 0.99 * 10.0**-decimals / np.sqrt(12.0)


@pytest.mark.parametrize("decimals", [1, 2, 4])
def test_readings_are_no_better_than_their_last_digit(decimals: int) -> None:
    readings = np.round(np.random.default_rng(3).uniform(-7.0, 20.0, size=500), decimals)
    assert least_noise_um(readings, steps=True) == pytest.approx(10.0**-decimals / np.sqrt(12.0))
    assert least_noise_um(1e3 * readings, steps=True) == pytest.approx(10.0 ** (3 - decimals) / np.sqrt(12.0))
    span = float(np.ptp(readings))
    assert least_noise_um(readings, steps=False) == pytest.approx(1e-6 * span)


@pytest.mark.slow
@pytest.mark.parametrize(("step_um", "noise_um", "seed"), [(0.5, 0.02, 1), (0.2, 0.005, 2), (0.5, 0.005, 3)])
def test_readings_that_all_lie_within_their_steps_are_no_fault(step_um: float, noise_um: float, seed: int) -> None:
    record = exact(12.0)
    noise = noise_um * np.random.default_rng(seed).standard_normal(len(record))
    record = replace(record, displacement_um=step_um * np.round((record.displacement_um + noise) / step_um))
    findings = find(search_records(PAPER, [record]))
    assert findings.verdict == "named"
    assert [x.id for x in findings.effects] == ["sensor_quantisation"]


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.18), (0.2, 0.25), (0.6, 1.0)])
def test_a_camera_that_saw_a_part_of_the_record_is_judged_on_that(begin: float, end: float) -> None:
    volts = levels(50.0)
    hidden = {"creep": {"gains": (0.15,), "time_constants_s": (0.8,)}}
    record = record_of(effects=hidden, voltage_V=volts)
    place = np.arange(len(record)) / len(record)
    seen = (place >= begin) & (place < end)
    record = replace(record, displacement_um=np.where(seen, record.displacement_um, np.nan))
    read = observe(record)
    assert all(int(x.sum()) >= 6 for x in (read.training, read.judging, read.reporting))
    told = diagnose(PAPER, [record]).to_dict()
    assert told["verdict"] != "no_gap"
    assert told["gap"]["after"]["rms_um"] is not None
    assert "nan" not in told["sentence"]
    if told["verdict"] == "named":
        assert [x["id"] for x in told["effects"]] == ["creep"]
        assert told["gap"]["after"]["rms_um"] < 1.5 * NOISE_um
