"""Behind an even curve of the sensor, a linear fit sees nothing of the structure."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from bender_discrepancy.workflow import diagnose
from bender_identify.first_model.structures import Structure
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.own_numbers import own_form
from bender_inference.records.observations import observe
from bender_inference.search.judgement.rules import Rules
from bender_inference.search.moves import Catalogue, Kit
from bender_inference.search.search import search
from bender_inference.settings import Settings
from bender_loop.records.record import Record

DEAD_ZONE_V, LAG_S, FREQUENCY_HZ, DAMPING_RATIO = 0.4, 0.17, 3.2, 0.15


def absolute_value(amplitude_V: float, seed: int) -> Record:
    """Steps of either sign through a dead zone, a lag and a mode; the sensor gives the absolute value."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(400.0) / 50.0
    command = amplitude_V * np.repeat(rng.choice([-1.0, 1.0], 41), 10)[:400] + 0.05 * rng.standard_normal(400)
    omega = 2.0 * np.pi * FREQUENCY_HZ
    mode = [1.0, 2.0 * DAMPING_RATIO * omega, omega**2]
    device = TransferFunction([2.0 * omega**2], np.polymul([LAG_S, 1.0], mode))
    acting = np.sign(command) * np.maximum(np.abs(command) - DEAD_ZONE_V, 0.0)
    # held between the rows
    moved = lsim(device, acting.repeat(20), np.arange(8000.0) / 1000.0, interp=False)[1][::20]
    return Record(time_s, command, np.abs(moved) + 0.02 * rng.standard_normal(400))


@pytest.mark.parametrize("hidden", [False, True])
def test_numbers_that_an_effect_hides_are_not_fitted_without_it(hidden: bool) -> None:
    model = Structure(lags=1, modes=1).model((LAG_S, FREQUENCY_HZ, DAMPING_RATIO), 2.0, 0.0, "hidden")
    problem = problem_of(model, (observe(absolute_value(1.5, 5)),))
    found = search(problem, Catalogue((Kit(None, (), own_form(model), hidden=hidden),)), Rules())
    assert any(x.hypothesis.own is not None for x in found.archive.fits) is not hidden


@pytest.mark.slow
def test_two_records_of_an_absolute_value_show_the_fold_and_what_is_behind_it() -> None:
    found = diagnose(None, [absolute_value(1.5, 5), absolute_value(1.0, 6)], Settings(same_zero=True))
    assert [x.id for x in found.added] == ["fold", "dead_zone"]
    values = found.findings.model.values()
    assert values["plant_lag.time_constant"] == pytest.approx(LAG_S, rel=0.1)
    assert values["bending_modes.damping_ratio"] == pytest.approx(DAMPING_RATIO, rel=0.1)
