"""Equation (30) learned back from recordings of the plant."""

from collections.abc import Callable

import numpy as np
import pytest

from bender_identify.identification import identify
from bender_identify.identification_result import Identification
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import load_model

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


@pytest.mark.slow
def test_one_sine_says_that_it_hardly_sees_the_voltage_coefficient(from_sine: Identification) -> None:
    assert "u" in from_sine.identifiability.weak
    assert "u'" not in from_sine.identifiability.weak
    text = " ".join(from_sine.findings)
    assert "weakly identified" in text
    assert "one frequency (0.5 Hz) at one amplitude" in text
    assert "no remanence" in text


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


@pytest.mark.slow
def test_the_same_seed_gives_the_same_outcome(held_record: Callable[..., Record]) -> None:
    volts = np.repeat(np.random.default_rng(5).uniform(0.0, 50.0, 10), 10)
    experiment = experiment_of(held_record("paper", volts, noise_um=0.05), "a", SETTINGS)
    one, two = (identify([experiment], PAPER, SETTINGS, np.random.default_rng(6)) for _ in range(2))
    assert one.written.candidate.equation == two.written.candidate.equation
    assert one.unseen == two.unseen
