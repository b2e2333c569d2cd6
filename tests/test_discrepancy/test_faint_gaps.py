"""Effects that are smaller than at their smallest start: a scan adds starts until the effect is below the residual."""

import math
from typing import Any

import numpy as np
import pytest
from few import few_rows
from reported_diagnosis import levels, record_of

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.effects.form import FAINTEST, Form, Free, scale, simple
from bender_discrepancy.fitting.fit_problem import FitProblem, problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.fitting.scans.chosen import scan_any
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
    few_rows(
        [
            ("transport_delay", "delay_s", 1e-4),
            ("sensor_lag", "time_constant_s", 1e-4),
            ("source_resistance", "time_constant_s", 1e-4),
            ("supply_fall_lag", "time_constant_s", 1.5e-4),
            ("slew_limit", "slew_rate_V_per_s", 1.5e5),
            ("stiffening", "cubic_1_per_um2", -1e-6),
        ],
        0,
    ),
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


@pytest.mark.parametrize(("vanishes_at", "low", "high"), [(None, 0.5, 18.0), (0.0, 1e-3, 18.0), (math.inf, 0.5, 9e3)])
def test_a_scale_has_room_towards_the_value_at_which_its_effect_vanishes(
    vanishes_at: float | None, low: float, high: float
) -> None:
    free = scale("any", 1.0, 9.0, 3, vanishes_at)
    assert (free.low, free.high) == pytest.approx((low, high))
    assert free.starts == pytest.approx((1.0, 3.0, 9.0))
    assert FAINTEST == 1e3


@pytest.mark.parametrize("starts", [(), (5.0,), (5.0, 5.0), (4.0, 5.0), (0.5, 1.5, 1.5)])
@pytest.mark.parametrize("vanishes_at", [0.0, 1.0, math.inf])
def test_a_scan_of_a_perfect_model_ends(vanishes_at: float, starts: tuple[float, ...]) -> None:
    """Nothing is left, so no effect is smaller: also from one start, or from two that are the same."""
    plain = record_of(voltage_V=levels(4.0))
    read_um = Simulator(Drive.of_rows(plain.time_s, plain.voltage_V)).run(PAPER).reading_um
    problem = problem_of(PAPER, (observe(Record(plain.time_s, plain.voltage_V, read_um)),))
    free = Free("frequency_ratio", 1e-9, 1e9, True, starts, vanishes_at=vanishes_at)
    form = simple("tip_mass", free)
    found = scan_any(problem, Hypothesis(), form, NOISE_UM, keep=1000)
    assert {x.values[0] for x in found} >= {x for x in starts if 0.3 < x < 10.0}
    assert len(found) < 40
    if vanishes_at == 1.0 and starts:
        nearest = min(abs(x.values[0] - 1.0) for x in found)
        assert nearest <= min(abs(x - 1.0) for x in starts) / FAINTEST * (1.0 + 1e-6)
