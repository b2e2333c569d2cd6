"""Gains under a bound on Ms over many units: margins against the tuner's own, the tolerance limit, units held out."""

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from bender_fleet.tuning.command import better_own
from bender_fleet.tuning.plants import UnitPlant, why_unservable
from bender_fleet.tuning.robust import Loops, tolerance_factor, tolerance_limit
from bender_fleet.tuning.search import FleetObjective, Settling, Tuned, UnitFigures, figures, own_gains, tuned_on
from bender_loop.control.pid import Gains
from bender_tuner.model.linear_model import linearise_at
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.model.reduced_model import reduce_model
from bender_tuner.model.sampled_model import model_from_step
from bender_tuner.task.settings import make_settings

SETTINGS = make_settings(evaluations=20, duration_s=3.0, setpoint_um=10.0)


class Late:
    """A lag behind a delay of whole steps, whose input is rounded to levels."""

    def __init__(self, gain: float, lag_s: float, delay_steps: int, level_V: float = 0.0) -> None:
        self.gain, self.lag_s, self.delay_steps, self.level_V = gain, lag_s, delay_steps, level_V
        self.reset()

    def reset(self) -> None:
        self.at_um, self.waiting = 0.0, [0.0] * self.delay_steps

    def step(self, voltage_V: float, step_s: float) -> float:
        level_V = round(voltage_V / self.level_V) * self.level_V if self.level_V else voltage_V
        self.waiting.append(level_V)
        target = self.gain * self.waiting.pop(0)
        self.at_um += (target - self.at_um) * -math.expm1(-step_s / self.lag_s)
        return self.at_um

    def close(self) -> None:
        """Nothing is open."""


def _unit(name: str, plant: Late) -> UnitPlant:
    linear = linearise_at(plant, SETTINGS.setpoint_um, SETTINGS.sampling, SETTINGS.limits)
    return UnitPlant(name, cast(Any, plant), linear, reduce_model(linear.model, SETTINGS.latency_frames))


def _population(count: int, seed: int) -> list[UnitPlant]:
    rng = np.random.default_rng(seed)
    return [
        _unit(f"u{k}", Late(float(np.exp(rng.normal(-0.5, 0.25))), 0.02, int(np.exp(rng.normal(1.5, 0.7)))))
        for k in range(count)
    ]


def _silent(*_: Any) -> None:
    return


def test_peaks_of_all_loops_at_once_are_those_of_each() -> None:
    rng = np.random.default_rng(1)
    plants = []
    for k in range(12):
        response = 0.6 * -np.expm1(-np.arange(60 + 10 * k) / rng.uniform(0.5, 20.0))
        plants.append(DelayedPlant(model_from_step(1 / 30, response), int(rng.integers(0, 8))))
    for integral in (0.5, 3.0, 8.0, 40.0):
        gains = Gains(0.05, integral, 0.01, 2 / 30)
        expected = np.array([sensitivity_peak(gains, x) for x in plants])
        found = Loops(plants).peaks(gains)
        assert (np.isinf(found) == np.isinf(expected)).all()
        stable = np.isfinite(expected)
        assert found[stable] == pytest.approx(expected[stable], rel=0.01)
        assert np.max(found) == np.max(expected)
    assert np.isinf(expected).any()


def test_the_factor_of_the_tolerance_limit_is_that_of_the_tables() -> None:
    # Hahn and Meeker, Statistical Intervals, 1991, table A.12b: 95 % confidence, 99 % of the population
    assert [tolerance_factor(n) for n in (10, 20, 50)] == pytest.approx([3.981, 3.295, 2.862], abs=2e-3)


def test_the_limit_covers_units_that_were_not_seen_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    covering = 0
    for _ in range(400):
        limit = tolerance_limit(1.0 + np.exp(rng.normal(-0.9, 0.3, 40)))
        covering += limit >= 1.0 + math.exp(-0.9 + 0.3 * 2.326)
    assert 0.92 <= covering / 400 <= 0.98
    assert tolerance_limit(np.array([1.5, 1.2, math.inf])) == math.inf


@pytest.mark.slow
def test_gains_that_break_the_bound_are_worse_than_all_that_keep_it() -> None:
    units = _population(10, 2)
    objective = FleetObjective(units, SETTINGS)
    slow, quick = Gains(0.001, 0.2, 0.001, 2 / 30), Gains(0.001, 60.0, 0.001, 2 / 30)
    assert objective.limit(quick) > SETTINGS.max_ms > objective.limit(slow)
    assert objective(quick) > 10.0 > objective(slow)
    assert objective(slow) > objective(replace(slow, integral_V_per_um_s=0.8))


@pytest.mark.slow
def test_units_that_were_not_tuned_on_keep_the_bound_that_the_start_breaks() -> None:
    known, others = _population(12, 7), _population(24, 8)
    start = Gains(0.008, 8.0, 0.015, 2 / 30)
    assert max(x.sensitivity_peak for x in figures(start, known, SETTINGS)) > SETTINGS.max_ms
    gains = tuned_on(known, start, SETTINGS, _silent).gains
    seen, unseen = figures(gains, known, SETTINGS), figures(gains, others, SETTINGS)
    assert max(x.sensitivity_peak for x in seen) <= SETTINGS.max_ms
    assert max(x.sensitivity_peak for x in unseen) <= SETTINGS.max_ms
    assert all(math.isfinite(x.settling_s) for x in unseen)
    assert FleetObjective(known, SETTINGS)(gains) <= FleetObjective(known, SETTINGS)(
        replace(gains, integral_V_per_um_s=1.0)
    )


@pytest.mark.slow
def test_a_few_units_keep_the_bound_with_30_per_cent_more_gain() -> None:
    few = [_unit(f"u{k}", Late(0.6 + 0.02 * k, 0.02, 4)) for k in range(4)]
    gains = tuned_on(few, Gains(0.008, 8.0, 0.015, 2 / 30), replace(SETTINGS, evaluations=10), _silent).gains
    others = [_unit("stronger", Late(0.66 * 1.3, 0.02, 4))]
    assert max(x.sensitivity_peak for x in figures(gains, others, SETTINGS)) <= SETTINGS.max_ms + 0.01


@pytest.mark.slow
def test_a_start_that_keeps_the_bound_is_never_made_worse() -> None:
    known = _population(10, 3)
    objective = FleetObjective(known, SETTINGS)
    start = Gains(0.01, 1.0, 0.01, 2 / 30)
    assert objective.limit(start) <= SETTINGS.max_ms
    assert objective(tuned_on(known, start, replace(SETTINGS, evaluations=5), _silent).gains) <= objective(start)


@pytest.mark.slow
def test_a_bound_that_is_not_firm_gives_way_where_the_slowest_unit_would_settle_later() -> None:
    units = [_unit(f"u{k}", Late(float(gain), 0.02, 4)) for k, gain in enumerate(np.geomspace(0.3, 1.2, 10))]
    objective, start = FleetObjective(units, SETTINGS), Gains(0.008, 4.0, 0.015, 2 / 30)
    theirs = objective.settling(start)
    firm, eased = (tuned_on(units, start, SETTINGS, _silent, is_firm=x) for x in (True, False))
    assert firm.max_ms == SETTINGS.max_ms < eased.max_ms <= objective.limit(start)
    assert theirs.is_better_than(objective.settling(firm.gains))
    assert objective.settling(eased.gains).is_better_than(theirs)
    assert objective.limit(eased.gains) <= eased.max_ms
    assert not firm.is_enough
    assert not eased.is_enough


@pytest.mark.parametrize(("level_V", "servable"), [(0.0, True), (0.3, True), (3.0, False)])
def test_a_unit_that_rests_on_coarse_levels_is_named(level_V: float, servable: bool) -> None:
    plant = Late(0.7, 0.02, 0, level_V)
    point = linearise_at(plant, SETTINGS.setpoint_um, SETTINGS.sampling, SETTINGS.limits).point
    assert (why_unservable(plant, point, SETTINGS) == "") is servable


def test_gains_are_compared_on_the_units_that_both_bring_to_rest() -> None:
    def told(*times: float) -> Settling:
        return Settling(np.array(times), np.zeros(len(times)))

    quick, slow, losing = told(0.2, 0.4, 0.9), told(0.3, 0.5, math.inf), told(0.1, math.inf, math.inf)
    assert quick.is_better_than(slow)
    assert slow.is_worse_than(quick)
    assert losing.is_worse_than(slow)
    assert not losing.is_better_than(slow)
    # more units at rest do not make up for a slower one
    assert told(0.8, 0.4, 0.9).is_worse_than(slow)
    assert not told(0.8, 0.4, 0.9).is_better_than(slow)
    assert quick.value < slow.value < losing.value


@pytest.mark.parametrize(("gain", "lag_s", "delay_steps"), [(0.4, 0.02, 2), (0.9, 0.2, 8), (2.0, 0.05, 20)])
def test_gains_of_a_units_own_keep_the_bound_and_bring_it_to_rest(gain: float, lag_s: float, delay_steps: int) -> None:
    unit = _unit("u", Late(gain, lag_s, delay_steps))
    found = own_gains(unit, SETTINGS, 1.7)
    assert found is not None
    gains, told = found
    assert told == figures(gains, [unit], SETTINGS)[0]
    assert told.sensitivity_peak <= 1.7
    assert math.isfinite(told.settling_s)


def test_a_unit_has_gains_of_its_own_only_where_no_set_serves_it_as_soon_as_the_nominal_gains_would() -> None:
    unit, best = _unit("u", Late(0.9, 0.1, 8)), Tuned(Gains(0.01, 1.0), 1.7)

    def own(peak: float, settling_s: float, nominal_s: float) -> bool:
        told, nominal = (UnitFigures("u", *x, 0.0) for x in ((peak, settling_s), (9.0, nominal_s)))
        return better_own(unit, told, best, nominal, SETTINGS) is not None

    found = own_gains(unit, SETTINGS, 1.7)
    assert found is not None
    soon_s, late_s = 0.5 * found[1].settling_s, 2.0 * found[1].settling_s
    assert not own(1.6, late_s, late_s)
    assert own(1.6, late_s, soon_s)
    assert not own(1.6, soon_s, 0.5 * soon_s)
    assert own(1.8, soon_s, late_s)
    assert own(math.inf, math.inf, math.inf)
