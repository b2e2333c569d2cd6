"""Devices of other people and records that show them badly: what is named, recalibrated or refused."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from few import few
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import levels, record_of
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear
from scipy.signal import TransferFunction, lsim

from bender_discrepancy.conclusion.contenders import alternatives
from bender_discrepancy.record_search import search_records
from bender_discrepancy.workflow import diagnose
from bender_effects.catalogue import forms
from bender_effects.effect import FULL_VOLTAGE_V, FULL_STROKE_um, Sizes, powers_of_unit, scaling
from bender_inference.candidates import affordable, candidate_forms
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit
from bender_inference.fitting.starts import solved_with_signs
from bender_inference.fitting.visible_modes import without_unseen_modes
from bender_inference.records.checks import read_model, refuse_unusable
from bender_inference.records.observations import observe
from bender_inference.settings import Settings
from bender_inference.structures import competing_structures
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record
from bender_loop.tables.quantities import Quantities
from bender_plant.blocks import BLOCKS, bending_modes, linear_transduction
from bender_plant.model import BlockSettings, Model, load_model
from bender_plant.parameter import meanings


def with_a_long_hold() -> np.ndarray:
    return np.concatenate([levels(40.0), np.full(600, 40.0), np.zeros(300)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "parameters"),
    [
        ("creep", {"gains": (0.1,), "time_constants_s": (5.0,)}),
        ("charge_leakage", {"fraction": 0.15, "time_constant_s": 5.0}),
    ],
)
def test_on_a_linear_model_growth_is_creep_and_sag_is_leakage(hidden: str, parameters: dict[str, Any]):
    record = record_of("beam", {hidden: parameters}, with_a_long_hold())
    found = search_records(load_model("beam"), [record])
    assert found.verdict.word == "named"
    assert found.best.hypothesis.effects == (hidden,)


@pytest.mark.parametrize("damping_ratio", [0.3, 1.2])
def test_linear_structures_of_a_record_are_at_most_one_of_each_kind_and_a_gain(damping_ratio: float) -> None:
    rng = np.random.default_rng(4)
    time_s = 0.05 * np.arange(400.0)
    command = rng.uniform(0.0, 20.0, 40).repeat(10)
    device = TransferFunction([2.0], [0.02, 2.0 * damping_ratio * 0.02**0.5, 1.0])
    read = lsim(device, command, time_s)[1] + 0.05 * rng.standard_normal(400)
    found = [x.model for x in competing_structures([Record(time_s, command, read)], Settings())]
    modes = [any(name.startswith("bending_modes") for name in x.values()) for x in found]
    lags = [x.values().get("plant_lag.time_constant", 0.0) > 0.0 for x in found]
    kinds = list(zip(lags, modes, strict=True))
    assert len(set(kinds)) == len(kinds)
    assert (False, False) in kinds
    assert (damping_ratio < 1.0, damping_ratio > 1.0) in [(m, k) for k, m in kinds]


def seen_at(rate_Hz: float) -> Record:
    """A step after half of the rows, through the ringing of all modes of the beam at a vibrometer's rates."""
    slow = record_of("beam", voltage_V=np.repeat([0.0, 30.0, 10.0, 40.0], 200))
    return Record(slow.time_s * 30.0 / rate_Hz, slow.voltage_V, slow.displacement_um)


def modes_of(record: Record) -> int:
    model = without_unseen_modes(load_model("beam"), [observe(record)])
    return next(x.parameters.count for x in model.blocks if x.id == "bending_modes")


def test_a_camera_sees_one_mode_a_vibrometer_more():
    assert modes_of(seen_at(30.0)) == 1
    assert modes_of(seen_at(20_000.0)) > 1


def test_a_model_of_one_mode_stays_as_it_is():
    model = load_model("paper")
    assert without_unseen_modes(model, [observe(record_of())]) is model


@pytest.mark.slow
def test_records_too_long_for_the_model_are_refused_with_what_to_do():
    """A row a minute for days: every effect would stay untried, and nothing could be said about any."""
    slow = record_of()
    hours = Record(slow.time_s * 7200.0, slow.voltage_V, slow.displacement_um)
    with pytest.raises(InputError, match=r"sub-steps of 0\.0043 s as the model paper needs.*--untimed"):
        search_records(load_model("paper"), [hours])


@examples(max_examples=30)
@given(st.integers(0, 10_000), st.lists(st.booleans(), min_size=1, max_size=5))
def test_weights_that_must_not_be_negative_are_the_best_of_those(seed: int, signs: list[bool]):
    rng = np.random.default_rng(seed)
    positive = np.array([False, *signs])
    columns = [rng.standard_normal(40) for _ in positive]
    measured = 3.0 * columns[0] + sum(rng.normal() * x for x in columns[1:]) + rng.standard_normal(40)
    weights, square = solved_with_signs(columns, measured, positive)
    sign = np.sign(columns[0] @ measured)
    assert np.all(sign * weights[positive] >= 0.0)
    low = np.where(positive & (sign > 0.0), 0.0, -np.inf)
    high = np.where(positive & (sign < 0.0), 0.0, np.inf)
    best = lsq_linear(np.stack(columns, axis=1), measured, (low, high), tol=1e-12)
    assert square == pytest.approx(2.0 * best.cost, rel=1e-6)
    assert square == pytest.approx(float(np.sum((measured - np.stack(columns, axis=1) @ weights) ** 2)), rel=1e-9)


@pytest.mark.parametrize("factor", [(1e4, 1.0), (1.0, 1e-4), (1e3, 1e5)])
def test_what_has_a_size_is_sought_in_proportion_to_the_rig(factor: tuple[float, float]) -> None:
    usual = Sizes(FULL_VOLTAGE_V, FULL_STROKE_um, 100.0, 50.0, piezo_bender=False, highest_Hz=50.0)
    large = replace(usual, span_V=factor[0] * usual.span_V, stroke_um=factor[1] * usual.stroke_um)
    seen = 0
    for first, second in zip(forms(usual), forms(large), strict=True):
        for one, other in zip(first.free, second.free, strict=True):
            unit = _unit(first.effect, one.name)
            if unit is None or powers_of_unit(unit) == (0, 0):
                continue
            times = scaling(unit, large.span_V, large.stroke_um)
            np.testing.assert_allclose(other.starts, times * np.array(one.starts), rtol=1e-9)
            if not one.solved:
                bounds = other.low, other.high
                assert bounds == pytest.approx((times * one.low, times * one.high)), (first.name, one.name)
            seen += 1
    assert seen > 15


def _unit(effect: str, name: str) -> str | None:
    """Return the unit of a parameter of a block; None for a number that the form makes up for itself."""
    found = meanings(BLOCKS[effect].parameters).get(name.partition("[")[0])
    return None if found is None else found.unit


FIGURE_8 = Path(__file__).parents[3] / "shared" / "data" / "paper_fig8.csv"


@pytest.mark.slow
@pytest.mark.skipif(not FIGURE_8.exists(), reason="the record of figure 8 is not part of the repository")
def test_figure_8_is_hysteresis() -> None:
    found = diagnose(load_model("beam"), [read_record(FIGURE_8)], Settings(untimed=True))
    result = found.to_dict()
    first = result["effects"][0]
    assert sum(x["share_of_gap"] for x in result["effects"] if "rival_of" not in x) == pytest.approx(
        result["gap"]["closed"], abs=1e-3
    )
    assert first["id"] == "rate_independent_hysteresis"
    assert first["grade"] in ("certain", "likely")
    assert found.gap.after.rms_um <= 0.375


FREQUENCY_HZ, ZETA, CUBIC, REST_um, NOISE_um = 2.0, 0.05, 2e-4, 6.0, 0.02
STEP_S, ROWS = 0.04, 1500


def record(
    preload_um: float = 0.0,
    cubic: float = CUBIC,
    quintic: float = 0.0,
    frequency_Hz: float = FREQUENCY_HZ,
    seed: int = 4,
) -> Record:
    """Levels of chance of either sign, and what x'' + 2 zeta omega x' + omega^2 (F(x) - u) = 0 answers."""
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(-20.0, 20.0, ROWS), rng.integers(5, 60, ROWS))[:ROWS]
    volts[0] = 0.0
    omega = 2.0 * np.pi * frequency_Hz

    def rate(_: float, x: np.ndarray, u: float) -> list[float]:
        force = cubic * ((x[0] + preload_um) ** 3 - preload_um**3 - 3.0 * preload_um**2 * x[0]) + quintic * x[0] ** 5
        return [x[1], omega * omega * (u - x[0] - force) - 2.0 * ZETA * omega * x[1]]

    state, shown = np.zeros(2), [0.0]
    for u in volts[:-1].tolist():
        state = solve_ivp(rate, (0.0, STEP_S), state, args=(u,), rtol=1e-9, atol=1e-9).y[:, -1]
        shown.append(float(state[0]))
    reading = np.array(shown) + NOISE_um * rng.standard_normal(ROWS)
    return Record(STEP_S * np.arange(ROWS, dtype=np.float64), volts, reading)


def oscillator(frequency_Hz: float = FREQUENCY_HZ) -> Model:
    modes = bending_modes.Parameters(first_frequency_Hz=frequency_Hz, damping_ratio=ZETA)
    linear = linear_transduction.Parameters(sensitivity_um_per_V=1.0)
    blocks = BlockSettings(linear_transduction.ID, linear), BlockSettings(bending_modes.ID, modes)
    return Model("oscillator", None, blocks)


@pytest.mark.slow
@pytest.mark.parametrize("preload_um", [0.0, REST_um], ids=["symmetric", "preloaded"])
def test_a_cubic_spring_is_named_alone_wherever_it_is_symmetric(preload_um: float) -> None:
    found = search_records(oscillator(), [record(preload_um)])
    assert (found.verdict.word, found.best.hypothesis.effects) == ("named", ("stiffening",))
    assert found.verdict.complete
    values = found.best.hypothesis.values()
    assert values[0] == pytest.approx(CUBIC, rel=0.02)
    assert values[1:] == (pytest.approx((preload_um,), rel=0.05) if preload_um else ())


PAPER = load_model("paper")
HELD_V = np.full(900, 24.0)
HELD_V[0] = 0.0


@pytest.mark.parametrize(
    ("effect", "parameters", "also"),
    [
        ("thermal_drift", {"amplitude_um": 0.9, "time_constant_s": 9.0}, "creep"),
        ("charge_leakage", {"fraction": 0.9, "time_constant_s": 150.0}, "thermal_drift"),
    ],
)
def test_what_fits_every_row_as_well_stays_a_rival(effect: str, parameters: dict[str, float], also: str):
    record = record_of(PAPER, {effect: parameters}, voltage_V=HELD_V)
    found = search_records(PAPER, [record], Settings())
    assert found.verdict.word == "ambiguous"
    (leading,) = found.grades.effects
    assert leading.grade != "certain"
    assert {effect, also} <= {leading.id, *(x.id for x in leading.near_rivals)}


@pytest.mark.slow
def test_the_absolute_value_of_a_speed_is_a_fold():
    rng = np.random.default_rng(2)
    time_s = 0.02 * np.arange(500, dtype=np.float64)
    motor_V = np.repeat(rng.choice([-1.5, 1.5], 100), 5)
    speed = lsim(TransferFunction([2.0 * 400.0], np.polymul([0.17, 1.0], [1.0, 6.0, 400.0])), motor_V, time_s)[1]
    count = np.abs(speed) + 0.03 * rng.standard_normal(time_s.size)
    found = diagnose(None, [Record(time_s, motor_V, count)], Settings().between_rows("auto"))
    assert found.to_dict()["effects"][0]["id"] == "fold"
    assert found.gap.after.rms_um < 0.3 * found.gap.recalibrated.rms_um


NUMBER = {"sensor_lag": "time_constant_s", "source_resistance": "time_constant_s", "transport_delay": "delay_s"}
HIDDEN: Mapping[str, Mapping[str, float]] = {
    "": {},
    "thermal_drift": {"amplitude_um": 3.0, "time_constant_s": 10.0},
    "dead_zone": {"threshold_V": 3.0},
}


@pytest.mark.parametrize("hidden", few(HIDDEN, 1))
@pytest.mark.parametrize("own", few(NUMBER, 1))
def test_a_number_of_the_model_is_recalibrated_and_no_effect_takes_its_place(own: str, hidden: str) -> None:
    """Searched beside the number as given, a lag of 30 ms for 10 ms was creep and a delay."""
    given = PAPER.with_block(own, **{NUMBER[own]: 0.01})
    bench = PAPER.with_block(own, **{NUMBER[own]: 0.03})
    effects = {hidden: dict(HIDDEN[hidden])} if hidden else {}
    found = search_records(given, [record_of(bench, effects, levels(40.0))])
    assert found.verdict.word == ("named" if hidden else "recalibrated")
    assert found.best.hypothesis.effects == ((hidden,) if hidden else ())
    changed = found.best.hypothesis.own
    assert changed is not None
    assert [x.name for x in changed.form.free] == [f"{own}.{NUMBER[own]}"]
    assert changed.values[0] == pytest.approx(0.03, rel=0.01)


@pytest.mark.parametrize("uneven", [False, True])
def test_a_disturbance_may_be_as_quick_as_the_rows_show(uneven: bool) -> None:
    """Rows at uneven times show a hum of 100 Hz, rows of 30 in a second at even ones its alias."""
    given = PAPER.with_block("sensor_lag", time_constant_s=0.01)
    record = record_of(given, {}, levels(170.0))
    if uneven:
        late_s = np.random.default_rng(3).uniform(0.0, 0.008, len(record))
        record = replace(record, time_s=record.time_s + late_s - late_s[0])
    observed = [observe(record)]
    forms = affordable(given, candidate_forms(given, observed), observed)
    (hum,) = (x for x in forms if x.effect == "periodic_disturbance")
    assert (hum.free[-1].high > 100.0) == uneven
    assert hum.free[-1].high >= 0.5 / np.median(np.diff(record.time_s))


def _fitted(problem: FitProblem, hypothesis: Hypothesis) -> Fitted:
    found = fit(problem, hypothesis)
    assert found is not None
    return found


@pytest.mark.slow
def test_what_came_nearest_is_told_where_nothing_is_certain() -> None:
    record = record_of(PAPER, {"thermal_drift": {"amplitude_um": 3.0, "time_constant_s": 10.0}}, levels(40.0))
    rough = np.random.default_rng(2).choice([-0.6, 0.6], len(record) // 20).repeat(20)
    found = search_records(PAPER, [replace(record, displacement_um=record.displacement_um + rough)])
    assert found.verdict.word != "named"
    assert not any(x.grade == "certain" for x in found.grades.effects)
    told = alternatives(found, "unexplained")
    assert "thermal_drift" in {y for x in told for y in x.effects}
    assert all(0.1 < x.closes < 0.99 for x in told)
    assert alternatives(found, "no_gap") == ()


HELD_ROWS = 1800


def one_step(factor: float) -> Record:
    """A camera record of one step in its second row, and of what creeps by a tenth of it afterwards."""
    volts = np.full(HELD_ROWS, 14.0)
    volts[:2] = 0.0
    time_s = np.arange(HELD_ROWS) / 30.0
    read = factor * (0.4 * volts + 1.5 * time_s / 30.0 + np.random.default_rng(1).normal(0.0, 0.05, HELD_ROWS))
    return Record(time_s, volts, read)


def test_a_record_that_holds_a_voltage_is_measured_by_how_far_its_step_goes():
    refuse_unusable(read_model("paper"), ["one"], [one_step(1.0)], Settings())


def test_columns_of_another_device_are_refused_in_the_units_of_the_file_with_the_next_step():
    record = replace(one_step(1.0), quantities=Quantities("mA", "um", ("mA", "mm")))
    with pytest.raises(InputError) as refused:
        refuse_unusable(read_model("paper"), ["mine.csv"], [record], Settings())
    assert str(refused.value).startswith("mine.csv: found columns in mA and mm, expected V and lengths")
    assert "--model auto" in str(refused.value)
    assert "bender model fit" in str(refused.value)


def test_a_thousand_times_more_is_refused():
    with pytest.raises(InputError, match="say what units"):
        refuse_unusable(read_model("paper"), ["one"], [one_step(10_000.0)], Settings())
