"""One controller for a population: quantiles by hand, groups of units alike, and a small fleet tuned for real."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import tomli_w

from bender_fleet.tuning.command import FleetTuning, judged, rows_of, serving_best, tune_fleet
from bender_fleet.tuning.groups import grouped
from bender_fleet.tuning.plants import UnitPlant
from bender_fleet.tuning.search import Tuned, UnitFigures, quantiles
from bender_loop.control.pid import Gains
from bender_loop.errors import InputError
from bender_plant.model import load_model
from bender_tuner.model.reduced_model import ReducedModel
from bender_tuner.task.settings import make_settings

GAINS = Gains(0.1, 1.0)


def _unit(gain: float, delay_s: float) -> UnitPlant:
    model = SimpleNamespace(model=SimpleNamespace(period_s=1.0 / 30.0))
    return cast(UnitPlant, SimpleNamespace(name="u", reduced=ReducedModel(gain, 0.0, delay_s), linearisation=model))


def test_quantiles_are_values_of_units_and_the_worst_is_the_worst() -> None:
    assert quantiles([3.0, 1.0, 2.0]) == {"median": 2.0, "q95": 3.0, "worst": 3.0}
    assert quantiles([float(x) for x in range(1, 101)]) == {"median": 50.0, "q95": 95.0, "worst": 100.0}
    assert quantiles([1.0, math.inf])["worst"] == math.inf


def test_units_alike_come_into_one_group_ordered_by_their_gain() -> None:
    rng = np.random.default_rng(3)
    quick = [_unit(float(0.3 * rng.uniform(0.95, 1.05)), 0.06) for _ in range(12)]
    late = [_unit(float(0.5 * rng.uniform(0.95, 1.05)), 0.4) for _ in range(8)]
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
