"""Effects that do less than their smallest start would: a scan goes on towards none until it does less than is left."""

import math
from typing import Any

import numpy as np
import pytest
from told_diagnosis import levels, record_of

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.effects.form import FAINTEST, Form, scale
from bender_discrepancy.fitting.fit_problem import FitProblem, problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.fitting.special_starts import scan_any
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import candidate_forms
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
NOISE_UM = 0.05


def bench_with(effect: str, **parameters: Any) -> tuple[FitProblem, Form]:
    """A record of levels from a paper bench with the effect, and the effect's first form."""
    plain = record_of(voltage_V=levels(40.0))
    drive = Drive.of_rows(plain.time_s, plain.voltage_V)
    read_um = Simulator(drive).run(PAPER.with_block(effect, **parameters)).reading_um
    read_um += NOISE_UM * np.random.default_rng(3).standard_normal(read_um.size)
    problem = problem_of(PAPER, (observe(Record(plain.time_s, plain.voltage_V, read_um)),))
    return problem, next(x for x in candidate_forms(PAPER, problem.observations) if x.effect == effect)


@pytest.mark.parametrize(
    ("effect", "name", "size"),
    [
        ("transport_delay", "delay_s", 1e-4),
        ("sensor_lag", "time_constant_s", 1e-4),
        ("source_resistance", "time_constant_s", 1e-4),
        ("supply_fall_lag", "time_constant_s", 1.5e-4),
        ("slew_limit", "slew_rate_V_per_s", 1.5e5),
        ("stiffening", "cubic_1_per_um2", -1e-6),
    ],
)
def test_an_effect_below_its_smallest_start_is_found(effect: str, name: str, size: float) -> None:
    problem, form = bench_with(effect, **{name: size})
    given = [abs(x) for x in form.free[0].starts] or [5e-4]
    assert not min(given) <= abs(size) <= max(given)
    starts = scan_any(problem, Hypothesis(), form, NOISE_UM)
    found = min(
        (x for x in (fit(problem, Hypothesis().plus(form, start.values)) for start in starts) if x is not None),
        key=lambda x: x.training_square,
    )
    assert found.hypothesis.parts[0].values[0] == pytest.approx(size, rel=0.15)


def test_a_scan_stays_among_the_starts_where_what_is_left_is_larger_than_they_do() -> None:
    problem, form = bench_with("sensor_lag", time_constant_s=0.2)
    starts = scan_any(problem, Hypothesis(), form, NOISE_UM, keep=100)
    assert sorted(x.values[0] for x in starts) == pytest.approx(sorted(form.free[0].starts))


@pytest.mark.parametrize(("nought", "low", "high"), [(None, 0.5, 18.0), (0.0, 1e-3, 18.0), (math.inf, 0.5, 9e3)])
def test_a_scale_has_room_towards_the_value_at_which_its_effect_vanishes(
    nought: float | None, low: float, high: float
) -> None:
    free = scale("any", 1.0, 9.0, 3, nought)
    assert (free.low, free.high) == pytest.approx((low, high))
    assert free.starts == pytest.approx((1.0, 3.0, 9.0))
    assert FAINTEST == 1e3
