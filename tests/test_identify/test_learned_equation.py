"""The learned equation and its rivals: regression, supports, output error, and each kind found back."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bender_compiled.simulation import Drive, Simulator
from bender_identify.fitting.candidate import Candidate, scores
from bender_identify.fitting.correlation import correlation_rows
from bender_identify.fitting.repeating import repeating_factor
from bender_identify.fitting.resimulation import with_transducer
from bender_identify.identification import identify
from bender_identify.identification_result import Identification
from bender_identify.operators.bouc_wen_fit import fit_bouc_wen
from bender_identify.operators.first_order_lag import fit_lag
from bender_identify.operators.prandtl_ishlinskii_fit import fit_prandtl_ishlinskii
from bender_identify.operators.remanence import remanence_um
from bender_identify.paper.paper_sindy import naive_cubic, paper_recipe, plain_sindy_on
from bender_identify.paper.simulated_bouc_wen import (
    equation_29_percent,
    growing_tone,
    learn_bouc_wen,
    nothing_else,
    one_tone,
    three_tones,
    truth,
    two_tones,
    two_tones_rate,
)
from bender_identify.records.experiment import Experiment, experiment_of
from bender_identify.records.voltage_path import even_times
from bender_identify.regression.equation_search import equation_of
from bender_identify.regression.rates import Regression, conditioning, regression_of
from bender_identify.regression.sparse_fit import ensemble_of, greedy_supports, least_squares, likely, supports
from bender_identify.regression.terms import evaluated, scale_of, unit_of
from bender_identify.settings import LIBRARIES, Settings
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model

TIME = even_times(0.01, 3001)
VOLTS = three_tones(TIME)
BOUC_WEN = truth(three_tones, TIME)


def made(reading: np.ndarray, volts: np.ndarray = VOLTS, time_s: np.ndarray = TIME) -> Experiment:
    return experiment_of(Record(time_s, volts, reading), "a", Settings(), "linear")


def noisy(percent: float) -> np.ndarray:
    noise = np.random.default_rng(7).standard_normal(len(TIME))
    return BOUC_WEN + 0.01 * percent * BOUC_WEN.std() * noise


def regressed(terms: Sequence[str], experiment: Experiment, form: str = "weak") -> Regression:
    found = regression_of(terms, [experiment], 0.0, form)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("percent", "asked", "form", "error"),
    [(0.0, "auto", "strong", 1e-3), (0.0, "weak", "weak", 0.02), (1.0, "auto", "weak", 0.03)],
)
def test_coefficients_come_out_of_the_form_that_follows_the_noise(
    percent: float, asked: str, form: str, error: float
) -> None:
    regression = regressed(LIBRARIES["bouc_wen"], made(noisy(percent)), asked)
    assert regression.form == form
    assert least_squares(regression, (0, 1, 2)) == pytest.approx([10.0, -0.75, -0.5], rel=error, abs=error)


def test_lost_frames_and_uneven_times_leave_the_coefficients() -> None:
    kept = np.sort(np.random.default_rng(1).choice(len(TIME), 2700, replace=False))
    kept[0] = 0
    reading = BOUC_WEN.copy()
    reading[500:502] = np.nan
    reading[900:960] = np.nan
    regression = regressed(LIBRARIES["bouc_wen"], made(reading[kept], VOLTS[kept], TIME[kept]))
    assert least_squares(regression, (0, 1, 2)) == pytest.approx([10.0, -0.75, -0.5], rel=0.05, abs=0.05)


def test_scaling_the_displacement_and_the_voltage_changes_no_support() -> None:
    one, other = (made(0.02 * BOUC_WEN, 50.0 * VOLTS), made(BOUC_WEN))
    assert supports(regressed(LIBRARIES["combined"], one)) == supports(regressed(LIBRARIES["combined"], other))


def test_the_true_terms_are_among_the_supports() -> None:
    assert (0, 1, 2) in supports(regressed(("u'", "w |u'|", "|w| u'", "w", "u"), made(noisy(0.3))))


def test_terms_that_do_the_same_are_left_out_and_named() -> None:
    volts = 2.0 + np.sin(TIME)
    regression = regressed(("w", "|w|", "u", "u'"), made(3.0 * volts + np.cos(TIME), volts), "strong")
    assert regression.terms == ("w", "u", "u'")
    assert regression.twins == (("|w|", "w"),)


def test_the_ensemble_is_reproducible_and_sure_of_the_truth() -> None:
    regression = regressed(LIBRARIES["combined"], made(noisy(0.3)))
    draws = [ensemble_of(regression, 20, 0.05, np.random.default_rng(s)) for s in (4, 4, 5)]
    assert np.array_equal(draws[0].median, draws[1].median)
    assert not np.array_equal(draws[0].median, draws[2].median)
    kept = {regression.terms[k] for k in likely(draws[0])}
    assert {"u'", "w |u'|"} <= kept
    assert draws[0].median[regression.terms.index("u'")] == pytest.approx(10.0, rel=0.1)


def test_collinear_columns_are_seen_in_the_condition_number() -> None:
    u, rate = np.sin(TIME), np.cos(TIME)
    condition, _, vectors = conditioning(np.column_stack([np.ones_like(u), u**2, rate**2]))
    assert condition > 1e12
    assert np.all(np.abs(vectors[-1]) > 0.3)


W, U, RATE = np.array([-2.0, 3.0]), np.array([4.0, -5.0]), np.array([-6.0, 7.0])


@pytest.mark.parametrize(
    ("term", "values", "unit"),
    [
        ("w", [-2.0, 3.0], "1/s"),
        ("u", [4.0, -5.0], "um/(V s)"),
        ("w |w|", [-4.0, 9.0], "1/(um s)"),
        ("u'", [-6.0, 7.0], "um/V"),
        ("w |u'|", [-12.0, 21.0], "1/V"),
        ("|w| u'", [-12.0, 21.0], "1/V"),
        ("u^2 u'", [-96.0, 175.0], "um/V^3"),
        ("w^2 |u|", [16.0, 45.0], "1/(um V s)"),
    ],
)
def test_terms_have_values_and_units(term: str, values: list[float], unit: str) -> None:
    assert evaluated(term, W, U, RATE).tolist() == values
    assert unit_of(term) == unit


@given(w=st.floats(0.1, 10.0), u=st.floats(0.1, 10.0), t=st.floats(0.1, 10.0))
def test_a_scaled_coefficient_is_one_where_the_term_alone_makes_the_rate(w: float, u: float, t: float) -> None:
    for term in LIBRARIES["combined"]:
        size = evaluated(term, np.array([w]), np.array([u]), np.array([u / t]))[0]
        assert scale_of(term, w, u, t) * size == pytest.approx(w / t)


PLAYED_s = even_times(0.05, 800)
PLAYED_V = 25.0 * (1.0 - np.cos(0.9 * PLAYED_s)) * (0.3 + 0.7 * np.sin(0.11 * PLAYED_s) ** 2)
BASE = nothing_else()


def plays(gain: float, thresholds_V: tuple[float, ...], weights: tuple[float, ...]) -> Model:
    numbers = {"linear_gain_um_per_V": gain, "thresholds_V": thresholds_V, "weights_um_per_V": weights}
    return with_transducer(BASE, "prandtl_ishlinskii", **numbers)


PLAYS = plays(0.3, (3.0, 9.0), (0.1, 0.05))
BENT = (
    with_transducer(BASE, "sparse_equation", terms=("u'", "u u'"), coefficients=(0.4, 0.004))
    .with_block("rate_independent_hysteresis", form="plays", thresholds_V=(4.0,), weights_um_per_V=(0.1,))
    .with_block("creep", gains=(0.08,), time_constants_s=(2.0,))
)


def played(model: Model, offset_um: float = 0.0) -> Experiment:
    reading = Simulator(Drive.of_rows(PLAYED_s, PLAYED_V)).run(model).reading_um + offset_um
    reading += 0.02 * np.random.default_rng(0).standard_normal(len(PLAYED_s))
    return experiment_of(Record(PLAYED_s, PLAYED_V, reading), "a", Settings())


@pytest.mark.parametrize(
    ("model", "offset_um", "bent"),
    [(PLAYS, -7.0, False), (plays(-0.3, (3.0,), (-0.1,)), 0.0, False), (BENT, 0.0, True)],
    ids=["plays and an offset", "negative", "a polynomial and creep"],
)
def test_prandtl_ishlinskii_finds_what_is_there_and_nothing_else(model: Model, offset_um: float, bent: bool) -> None:
    experiment = played(model, offset_um)
    found = fit_prandtl_ishlinskii([experiment], BASE)
    _, held_out = scores(found, [experiment])
    assert held_out is not None
    assert held_out.error_percent < 1.0
    assert ("polynomial" in found.title, "creep" in found.title) == (bent, bent)
    if not bent:
        assert found.fit.offset_um == pytest.approx(offset_um, abs=0.02)


def test_the_remanence_of_plays_is_that_of_their_thresholds() -> None:
    left, remanent = remanence_um(PLAYS, 40.0, 5.0)
    assert remanent
    assert left == pytest.approx(0.1 * 3.0 + 0.05 * 9.0, rel=1e-3)


@pytest.mark.parametrize("alpha", [-0.2, 0.3])
def test_bouc_wen_finds_its_own_parameters(alpha: float) -> None:
    values = {"linear_gain_um_per_V": 0.5, "alpha_um_per_V": alpha, "beta_1_per_V": 0.1, "gamma_1_per_V": 0.04}
    found = fit_bouc_wen([played(with_transducer(BASE, "bouc_wen", **values))], BASE)
    for coefficient, true in zip(found.coefficients, values.values(), strict=True):
        assert coefficient.half_width is not None
        assert abs(coefficient.value - true) < max(coefficient.half_width, 1e-3)


def test_a_lag_finds_its_own_coefficients() -> None:
    model = with_transducer(BASE, "sparse_equation", terms=("w", "u", "u'"), coefficients=(-2.0, 0.9, 0.1))
    found = fit_lag([played(model)], BASE)
    assert found is not None
    assert found.fit.values == pytest.approx([-2.0, 0.9, 0.1], abs=0.02)
    assert remanence_um(found.model, 40.0, 5.0) == (pytest.approx(0.0, abs=1e-6), False)


@pytest.mark.slow
def test_an_operator_is_written_where_the_learned_equation_cannot_follow() -> None:
    settings = Settings(library="paper", ensemble=0)
    outcome = identify([played(PLAYS)], BASE, settings, np.random.default_rng(0))
    assert outcome.written.candidate.id == "prandtl_ishlinskii"
    assert outcome.written.remanent
    assert any("holds the operator" in finding for finding in outcome.findings)
    kept = identify([played(PLAYS)], BASE, replace(settings, keep="sindy"), np.random.default_rng(0))
    assert kept.written.candidate.id == "sindy"


@pytest.mark.parametrize("rate_1_s", [2.0, 5e-5])
def test_a_model_that_runs_away_at_rest_says_so(rate_1_s: float) -> None:
    model = with_transducer(BASE, "sparse_equation", terms=("w", "u", "u'"), coefficients=(rate_1_s, 0.1, 1.0))
    left, remanent = remanence_um(model, 10.0, 1.0)
    assert left == float("inf")
    assert remanent


PAPER = load_model("paper")
TRUTH = {"w": -0.48, "u": 1.652, "u'": 0.818, "|w|": -0.22, "w |w|": -0.124}
SETTINGS = Settings(library="paper", ensemble=10)


@pytest.fixture(scope="module")
def from_sine(sine_record: Record) -> Identification:
    experiment = experiment_of(sine_record, "sine.csv", SETTINGS, "smooth")
    return identify([experiment], PAPER, SETTINGS, np.random.default_rng(0))


def hold_the_truth(outcome: Identification) -> bool:
    found = {c.name: c for c in outcome.rows[0].candidate.coefficients}
    assert set(found) == set(TRUTH)
    return all(abs(found[name].value - true) < (found[name].half_width or 0.0) for name, true in TRUTH.items())


def test_one_sine_gives_the_displacement_and_intervals_that_hold_the_truth(from_sine: Identification) -> None:
    assert hold_the_truth(from_sine)
    assert from_sine.written.candidate.id == "sindy"
    assert from_sine.written.held_out.equation_29_percent <= 0.95
    assert not from_sine.written.remanent


def test_rivals_stand_beside_with_their_remanence(from_sine: Identification) -> None:
    rows = {row.candidate.id: row for row in from_sine.rows}
    assert set(rows) == {"sindy", "prandtl_ishlinskii", "bouc_wen", "first_order_lag"}
    assert rows["prandtl_ishlinskii"].remanent
    assert rows["bouc_wen"].remanent
    assert not rows["first_order_lag"].remanent
    assert all(row.held_out.rms_um > from_sine.written.held_out.rms_um for row in from_sine.rows[1:])


@pytest.mark.slow
def test_steps_of_a_supply_make_every_coefficient_known(held_record: Callable[..., Record]) -> None:
    volts = np.repeat(np.random.default_rng(4).uniform(-30.0, 50.0, 40), 20)
    record = held_record("paper", volts, noise_um=0.05, seed=1)
    outcome = identify([experiment_of(record, "a", SETTINGS)], PAPER, SETTINGS, np.random.default_rng(0))
    assert hold_the_truth(outcome)
    assert outcome.written.held_out.error_percent < 1.0
    assert "u" not in outcome.identifiability.weak


@pytest.mark.slow
def test_of_several_records_each_is_left_out_in_turn(held_record: Callable[..., Record]) -> None:
    t = np.arange(600) / 30
    records = [
        held_record("paper", 25 + 15 * np.sin(0.7 * t) + 8 * np.sin(2.9 * t), noise_um=0.05, seed=1),
        held_record("paper", np.abs(50 * np.sin(0.8 * t) * (t / 20)), noise_um=0.05, seed=2),
    ]
    settings = Settings(library="paper", ensemble=0)
    experiments = [experiment_of(record, f"{k}.csv", settings) for k, record in enumerate(records)]
    outcome = identify(experiments, PAPER, settings, np.random.default_rng(0))
    assert "each record in turn" in outcome.held_out_by
    assert outcome.rows[0].held_out.error_percent < 1.5
    assert not any(x.held_out.any() for x in outcome.experiments)
    kept = identify(experiments[:1], PAPER, settings, np.random.default_rng(0), held_out=experiments[1:])
    assert kept.held_out_by == "held-out records: 1.csv"
    assert kept.experiments[0].fitted.all()
    assert kept.experiments[1].held_out.all()


ROWS_s = even_times(0.05, 600)
TERMS = ("u'", "w |u'|", "|w| u'")
START = np.array([9.0, -0.7, -0.4])


def fitted(seed: int) -> Candidate:
    rng = np.random.default_rng(seed)
    w = truth(three_tones, ROWS_s)
    record = Record(ROWS_s, three_tones(ROWS_s), w + 0.02 * w.std() * rng.standard_normal(len(w)))
    experiment = experiment_of(record, "a", Settings(), "linear").fitting_all()
    return equation_of(TERMS, START, [experiment], nothing_else())


@pytest.mark.slow
def test_the_covariance_is_the_scatter_over_repeated_noise() -> None:
    fits = [fitted(seed) for seed in range(12)]
    values = np.array([f.fit.values for f in fits])
    told = np.mean([[c.std or 0.0 for c in f.coefficients] for f in fits], axis=0)
    assert np.std(values, axis=0) == pytest.approx(told, rel=0.6)
    assert np.mean(values, axis=0) == pytest.approx([10.0, -0.75, -0.5], abs=4.0 * told.max() / np.sqrt(12))


def test_intervals_hold_the_truth_and_the_offset_is_dropped() -> None:
    found = fitted(99)
    for coefficient, true in zip(found.coefficients, (10.0, -0.75, -0.5), strict=True):
        assert coefficient.half_width is not None
        assert abs(coefficient.value - true) < coefficient.half_width
    assert found.fit.offset_um == 0.0
    assert found.parameters == 3


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9])
def test_correlated_residuals_count_less(share: float) -> None:
    rng = np.random.default_rng(1)
    noise, x = rng.standard_normal(20_000), np.zeros(20_000)
    for k in range(1, len(x)):
        x[k] = share * x[k - 1] + noise[k]
    assert correlation_rows(x) == pytest.approx((1.0 + share) / (1.0 - share), rel=0.25)


def test_what_comes_back_in_every_cycle_does_not_average_out() -> None:
    time = even_times(1 / 30, 1200)
    volts = 10.0 * np.sin(np.pi * time)
    experiment = experiment_of(Record(time, volts, 0.9 * volts), "a", Settings(), "smooth").fitting_all()
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(int(experiment.fitted.sum()))
    repeated = np.cos(3.0 * np.pi * experiment.time_s[experiment.fitted])
    assert repeating_factor([experiment], noise, 1.0) == 1.0
    assert repeating_factor([experiment], np.zeros_like(noise), 1.0) == 1.0
    half, more = (repeating_factor([experiment], noise + share * repeated, 1.0) for share in (0.5, 1.0))
    assert 1.5 < half < more


def test_the_truth_is_that_of_an_independent_integration() -> None:
    def slope(t: float, w: np.ndarray) -> np.ndarray:
        rate = float(two_tones_rate(np.array([t]))[0])
        return 10.0 * rate - 0.75 * abs(rate) * w - 0.5 * rate * np.abs(w)

    t = np.linspace(0.0, 10.0, 101)
    exact = solve_ivp(slope, (0.0, 10.0), [0.0], "DOP853", t_eval=t, rtol=1e-9, atol=1e-9, max_step=0.01).y[0]
    assert truth(two_tones, t) == pytest.approx(exact, abs=1e-5)


def test_the_papers_number_is_the_squared_one() -> None:
    errors, values = paper_recipe()
    assert values.tolist() == [9.997, -0.75, -0.499]
    assert errors.squared == pytest.approx(2.743e-6, rel=1e-3)
    assert errors.trained == pytest.approx(1.66e-2, rel=0.01)


def test_polynomials_do_well_on_the_training_input_and_fail_on_another() -> None:
    errors, unseen = naive_cubic()
    assert errors.trained < 1e-3
    assert errors.unseen == pytest.approx(151.0, abs=1.0)
    assert equation_29_percent(unseen.truth_um, unseen.simulated_um) == errors.unseen


def test_without_noise_the_equation_comes_back() -> None:
    errors, found = learn_bouc_wen(1e-3, 0.0, np.random.default_rng(0), duration_s=8.0)
    assert [c.name for c in found.coefficients] == ["u'", "w |u'|", "|w| u'"]
    assert errors.trained <= 1e-6
    assert errors.unseen <= 1e-4


@pytest.mark.slow
def test_with_noise_an_unseen_input_is_met() -> None:
    inputs = (three_tones, growing_tone)
    errors, _ = learn_bouc_wen(1e-2, 1.0, np.random.default_rng(4), inputs, duration_s=100.0)
    assert errors.unseen <= 0.03
    assert errors.unseen < plain_sindy_on(1e-2, 1.0, np.random.default_rng(4), inputs, duration_s=100.0)


@pytest.mark.slow
def test_a_period_of_one_tone_is_enough_for_the_terms_under_noise() -> None:
    errors, found = learn_bouc_wen(1e-2, 1.0, np.random.default_rng(1), (one_tone,), duration_s=20.0)
    assert {c.name for c in found.coefficients} == {"u'", "w |u'|", "|w| u'"}
    assert errors.unseen < 0.3


def of_columns(columns: np.ndarray, rates: np.ndarray) -> Regression:
    count = columns.shape[1]
    return Regression(tuple(map(str, range(count))), columns, rates, np.ones(count), "weak", 1)


@given(st.integers(0, 10_000), st.integers(1, 4), st.sampled_from([0.0, 1e-14]))
def test_terms_that_others_add_up_to_are_not_offered(seed: int, dependent: int, rounding: float) -> None:
    rng = np.random.default_rng(seed)
    free = rng.standard_normal((60, 3))
    added_up = free @ rng.standard_normal((3, dependent)) + rounding * rng.standard_normal((60, dependent))
    rates = free @ np.array([1.0, 0.0, -0.5])
    found = greedy_supports(of_columns(np.column_stack([free, added_up]), rates))
    assert (0, 2) in found
    assert all(k < 3 for support in found for k in support)


@pytest.mark.parametrize("columns", [np.zeros((60, 2)), np.empty((60, 0))])
def test_terms_of_nothing_have_no_supports(columns: np.ndarray) -> None:
    assert greedy_supports(of_columns(columns, np.ones(60))) == []
