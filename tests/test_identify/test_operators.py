"""The rivals of the learned equation find their own kind back."""

from dataclasses import replace

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_identify.fitting.candidate import Candidate, scores
from bender_identify.fitting.resimulation import with_transducer
from bender_identify.identification import identify
from bender_identify.operators.bouc_wen_fit import fit_bouc_wen
from bender_identify.operators.first_order_lag import fit_lag
from bender_identify.operators.prandtl_ishlinskii_fit import fit_prandtl_ishlinskii
from bender_identify.operators.remanence import remanence_um
from bender_identify.paper.simulated_bouc_wen import nothing_else
from bender_identify.records.experiment import Experiment, experiment_of
from bender_identify.records.voltage_path import even_times
from bender_identify.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import Model

TIME = even_times(0.05, 800)
VOLTS = 25.0 * (1.0 - np.cos(0.9 * TIME)) * (0.3 + 0.7 * np.sin(0.11 * TIME) ** 2)
BASE = nothing_else()


def operator() -> Model:
    return with_transducer(
        BASE, "prandtl_ishlinskii",
        linear_gain_um_per_V=0.3, thresholds_V=(3.0, 9.0), weights_um_per_V=(0.1, 0.05),
    )  # fmt: skip


def made(model: Model, noise_um: float = 0.02, offset_um: float = 0.0) -> Experiment:
    reading = Simulator(Drive.of_rows(TIME, VOLTS)).run(model).reading_um + offset_um
    reading += noise_um * np.random.default_rng(0).standard_normal(len(TIME))
    return experiment_of(Record(TIME, VOLTS, reading), "a", Settings())


def held_out_percent(fit: Candidate, experiment: Experiment) -> float:
    _, held_out = scores(fit, [experiment])
    assert held_out is not None
    return held_out.error_percent


def test_prandtl_ishlinskii_finds_plays_an_offset_and_nothing_else() -> None:
    experiment = made(operator(), offset_um=-7.0)
    found = fit_prandtl_ishlinskii([experiment], BASE)
    assert held_out_percent(found, experiment) < 1.0
    assert found.fit.offset_um == pytest.approx(-7.0, abs=0.02)
    assert "creep" not in found.title
    assert "polynomial" not in found.title
    left, remanent = remanence_um(found.model, 40.0, 5.0)
    assert remanent
    assert left == pytest.approx(0.1 * 3.0 + 0.05 * 9.0, rel=0.1)


def test_prandtl_ishlinskii_finds_a_polynomial_and_creep() -> None:
    bent = with_transducer(BASE, "sparse_equation", terms=("u'", "u u'"), coefficients=(0.4, 0.004))
    plays = {"thresholds_V": (4.0,), "weights_um_per_V": (0.1,)}
    model = bent.with_block("rate_independent_hysteresis", form="plays", **plays)
    model = model.with_block("creep", gains=(0.08,), time_constants_s=(2.0,))
    experiment = made(model)
    found = fit_prandtl_ishlinskii([experiment], BASE)
    assert held_out_percent(found, experiment) < 1.0
    assert "polynomial" in found.title
    assert "creep" in found.title


def test_prandtl_ishlinskii_works_with_a_gain_of_either_sign() -> None:
    model = with_transducer(
        BASE, "prandtl_ishlinskii",
        linear_gain_um_per_V=-0.3, thresholds_V=(3.0,), weights_um_per_V=(-0.1,),
    )  # fmt: skip
    experiment = made(model)
    assert held_out_percent(fit_prandtl_ishlinskii([experiment], BASE), experiment) < 1.0


@pytest.mark.parametrize("alpha", [-0.2, 0.3])
def test_bouc_wen_finds_its_own_parameters(alpha: float) -> None:
    values = {"linear_gain_um_per_V": 0.5, "alpha_um_per_V": alpha, "beta_1_per_V": 0.1, "gamma_1_per_V": 0.04}
    found = fit_bouc_wen([made(with_transducer(BASE, "bouc_wen", **values))], BASE)
    for coefficient, true in zip(found.coefficients, values.values(), strict=True):
        assert coefficient.half_width is not None
        assert abs(coefficient.value - true) < max(coefficient.half_width, 1e-3)


def test_a_lag_finds_its_own_coefficients() -> None:
    model = with_transducer(BASE, "sparse_equation", terms=("w", "u", "u'"), coefficients=(-2.0, 0.9, 0.1))
    found = fit_lag([made(model)], BASE)
    assert found is not None
    assert found.fit.values == pytest.approx([-2.0, 0.9, 0.1], abs=0.02)
    assert remanence_um(found.model, 40.0, 5.0) == (pytest.approx(0.0, abs=1e-6), False)


@pytest.mark.slow
def test_an_operator_is_written_where_the_learned_equation_cannot_follow() -> None:
    settings = Settings(library="paper", ensemble=0)
    outcome = identify([made(operator())], BASE, settings, np.random.default_rng(0))
    assert outcome.written.candidate.id == "prandtl_ishlinskii"
    assert outcome.written.remanent
    assert any("holds the operator" in finding for finding in outcome.findings)
    kept = identify([made(operator())], BASE, replace(settings, keep="sindy"), np.random.default_rng(0))
    assert kept.written.candidate.id == "sindy"


@pytest.mark.parametrize("rate_1_s", [2.0, 5e-5])
def test_a_model_that_runs_away_at_rest_says_so(rate_1_s: float) -> None:
    model = with_transducer(BASE, "sparse_equation", terms=("w", "u", "u'"), coefficients=(rate_1_s, 0.1, 1.0))
    left, remanent = remanence_um(model, 10.0, 1.0)
    assert left == float("inf")
    assert remanent
