"""One controller for a population, and gains under a bound on Ms over many units."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import tomli_w

from bender_fleet.tuning.command import FleetTuning, better_own, judged, rows_of, serving_best, tune_fleet
from bender_fleet.tuning.groups import grouped
from bender_fleet.tuning.plants import UnitPlant, why_unservable
from bender_fleet.tuning.robust import Loops, tolerance_factor, tolerance_limit
from bender_fleet.tuning.search import (
    FleetObjective,
    Settling,
    Tuned,
    UnitFigures,
    figures,
    own_gains,
    quantiles,
    tuned_on,
)
from bender_loop.control.pid import Gains
from bender_loop.errors import InputError
from bender_plant.model import load_model
from bender_tuner.model.linear_model import linearise_at
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.model.reduced_model import ReducedModel, reduce_model
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


GAINS = Gains(0.1, 1.0)


def _read_unit(gain: float, delay_s: float) -> UnitPlant:
    model = SimpleNamespace(model=SimpleNamespace(period_s=1.0 / 30.0))
    return cast(UnitPlant, SimpleNamespace(name="u", reduced=ReducedModel(gain, 0.0, delay_s), linearisation=model))


def test_quantiles_are_values_of_units_and_the_worst_is_the_worst() -> None:
    assert quantiles([3.0, 1.0, 2.0]) == {"median": 2.0, "q95": 3.0, "worst": 3.0}
    assert quantiles([float(x) for x in range(1, 101)]) == {"median": 50.0, "q95": 95.0, "worst": 100.0}
    assert quantiles([1.0, math.inf])["worst"] == math.inf


def test_units_alike_come_into_one_group_ordered_by_their_gain() -> None:
    rng = np.random.default_rng(3)
    quick = [_read_unit(float(0.3 * rng.uniform(0.95, 1.05)), 0.06) for _ in range(12)]
    late = [_read_unit(float(0.5 * rng.uniform(0.95, 1.05)), 0.4) for _ in range(8)]
    seen = np.arange(20) % 3 > 0
    assert grouped([*late, *quick], seen, 2, np.random.default_rng(0)).tolist() == [1] * 8 + [0] * 12
    assert set(grouped(quick, seen[:12], 1, rng).tolist()) == {0}
    few = grouped(quick[:3], np.array([True, True, False]), 3, rng)
    assert few[0] != few[1]
    assert few[2] in few[:2]


def test_units_that_neither_set_of_gains_brings_to_rest_are_not_compared() -> None:
    def told(name: str, peak: float, settling: float) -> UnitFigures:
        return UnitFigures(name, peak, settling, 1.0)

    ours = [told("a", 1.5, 0.5), told("b", math.inf, math.inf), told("c", 1.6, 0.6), told("d", 1.2, 0.4)]
    theirs = [told("a", 1.4, 0.7), told("b", math.inf, math.inf), told("c", math.inf, math.inf), told("d", 9.0, 9.0)]
    found = FleetTuning([Tuned(GAINS, 1.7)], GAINS, [["a", "b", "c", "d"]], ["a", "b", "c"], ours, theirs)
    assert [[x.unit for x in own] for own in judged(found)] == [["a", "c"], ["a", "c"]]
    own, nominal = rows_of(found)
    assert (own[1], own[4], own[7]) == (2, 1.6, 0.6)
    assert (nominal[1], nominal[4], nominal[7]) == (1, math.inf, "never")


def _fleet(folder: Path, gains: list[float]) -> dict[str, Path]:
    base = load_model("paper")
    found = {}
    for k, gain in enumerate(gains):
        blocks = [x for x in base.blocks if x.id != "calibration"]
        table = replace(base, name=f"unit{k}", blocks=tuple(blocks)).to_table()
        table["block"].append({"id": "calibration", "gain": gain})
        found[f"unit{k}"] = folder / f"{k}.toml"
        found[f"unit{k}"].write_text(tomli_w.dumps(table), encoding="utf-8")
    return found


@pytest.mark.slow
def test_a_fleet_of_low_gain_is_faster_under_its_own_gains_than_under_the_nominal_ones(tmp_path: Path) -> None:
    models = _fleet(tmp_path, [0.72, 0.74, 0.76, 0.73, 0.75, 0.77, 0.71, 0.74])
    settings = make_settings(evaluations=40, duration_s=2.0, setpoint_um=6.0)

    def silent(*_: Any) -> None:
        return

    found = tune_fleet(models, "paper", settings, 1, 0.5, silent)
    assert len(found.held_out) == 4
    assert not found.unserved
    ours, nominal = judged(found)
    worst = quantiles([x.settling_s for x in ours])["worst"], quantiles([x.settling_s for x in nominal])["worst"]
    assert worst[0] < worst[1]
    assert max(x.sensitivity_peak for x in ours) <= settings.max_ms
    with pytest.raises(InputError, match="at least 4"):
        tune_fleet(dict(list(models.items())[:3]), "paper", settings, 1, 0.5, silent)


def test_a_unit_takes_the_set_that_keeps_the_bound_and_settles_soonest() -> None:
    tuned = [Tuned(GAINS, 1.7), Tuned(GAINS, 1.7), Tuned(GAINS, 2.0)]

    def told(*pairs: tuple[float, float]) -> list[UnitFigures]:
        return [UnitFigures("u", peak, settling, 0.0) for peak, settling in pairs]

    assert serving_best(told((1.8, 0.1), (1.6, 0.5), (1.9, 0.4)), tuned) == 2
    assert serving_best(told((1.6, 0.6), (1.6, 0.5), (2.1, 0.4)), tuned) == 1
    assert serving_best(told((3.0, 0.6), (math.inf, math.inf), (2.1, math.inf)), tuned) == 0
