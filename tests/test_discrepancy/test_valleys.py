"""Where a fit sets out: in valleys of the misfit, not twice in the same one."""

from dataclasses import replace

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.effects.form import amplitude, simple
from bender_discrepancy.fitting import starts
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.records.observations import observe
from bender_loop.records.record import Record
from bender_plant.model import load_model


def test_an_amplitude_that_sets_out_from_nought_is_tried_with_its_unit() -> None:
    """What it does is linear in it: with warnings as errors, a division by nought would end this."""
    times = np.linspace(0.0, 4.0, 200)
    volts = np.random.default_rng(1).uniform(-20.0, 20.0, 20).repeat(10)
    beam = load_model("beam")
    read = Simulator(Drive.of_rows(times, volts)).run(beam.with_block("electrostriction", coefficient_um_per_V2=1e-3))
    problem = problem_of(beam, (observe(Record(times, volts, read.reading_um)),))
    form = simple("electrostriction", amplitude("coefficient_um_per_V2", 1e-4, 1.0))
    from_nought = replace(form, free=(replace(form.free[0], starts=(-0.0,)),))
    (usual,), (found,) = (starts.scan(problem, Hypothesis(), x) for x in (form, from_nought))
    assert found.values == pytest.approx(usual.values, rel=1e-6)
    assert found.values[0] == pytest.approx(1e-3, rel=1e-3)
