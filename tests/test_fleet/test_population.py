"""What the units say together, on tables whose bad batch, drift and outlier are known."""

from datetime import date, timedelta
from typing import Any

import numpy as np

from bender_fleet.population.experiment import undecided
from bender_fleet.population.features import Population
from bender_fleet.population.outliers import outliers
from bender_fleet.population.trends import bad_batches, drifts

NOTHING: dict[str, Any] = {"status": "done", "verdict": "named", "effects": [], "next_experiment": None}


def _effect(unit: str, name: str, size: float) -> dict[str, Any]:
    parameter = {"name": "size", "value": size, "std": 0.01, "unit": "1"}
    return {"unit": unit, "effect": name, "certain": True, "share_of_gap": 0.9, "parameters": [parameter]}


def _fleet(count: int = 160, *, bad: str = "", falls: float = 0.0, strange: int = -1, seed: int = 1) -> Population:
    rng = np.random.default_rng(seed)
    units, effects = [], []
    for k in range(count):
        name, batch = f"u{k:03d}", f"B{k % 8}"
        gain = float(1.0 - falls * k / count + 0.02 * rng.standard_normal()) * (1.4 if k == strange else 1.0)
        day = date(2026, 1, 1) + timedelta(days=k // 2)
        units.append({**NOTHING, "unit": name, "batch": batch, "date": day, "gain": gain, "recalibrated_um": 1.0})
        if batch == bad or rng.random() < 0.1:
            effects.append(_effect(name, "saturation", float(rng.lognormal())))
        if rng.random() < 0.3:
            effects.append(_effect(name, "creep", float(rng.lognormal())))
    return Population(units, effects)


def test_a_fleet_without_differences_shows_none() -> None:
    found = [(len(bad_batches(x)), len(drifts(x)), len(outliers(x))) for x in (_fleet(seed=k) for k in range(5))]
    assert np.sum(found) <= 1


def test_the_bad_batch_is_found_and_the_good_ones_are_not_blamed_for_being_better() -> None:
    found = bad_batches(_fleet(bad="B3"))
    assert {(x.batch, x.label) for x in found} == {("B3", "saturation")}
    assert found[0].inside == 1.0
    assert found[0].outside < 0.3


def test_a_falling_gain_is_found_with_its_size() -> None:
    (found,) = drifts(_fleet(falls=0.2))
    assert found.label == "gain"
    assert found.rank_correlation < -0.8
    assert 0.1 < found.early - found.late < 0.2


def test_a_unit_far_off_stands_out_and_the_reason_names_its_gain() -> None:
    (found,) = outliers(_fleet(strange=17))
    assert found.unit == "u017"
    assert found.reasons[0].startswith("gain 1.")


def test_ambiguous_units_come_together_by_their_rivals_one_with_a_profile_first() -> None:
    def unit(name: str, effects: list[str], why: str | None) -> dict[str, Any]:
        return {**NOTHING, "unit": name, "verdict": "ambiguous", "effects": effects, "next_experiment": why}

    units = [unit("a", ["creep", "ageing"], None), unit("b", ["ageing", "creep"], "Hold 30 V."), unit("c", ["x"], None)]
    first, second = undecided(Population(units, []))
    assert (first.rivals, first.units, first.why) == (("ageing", "creep"), ("b", "a"), "Hold 30 V.")
    assert second.units == ("c",)


def test_what_nobody_is_certain_of_is_not_counted() -> None:
    row = {**_effect("u000", "backlash", 1.0), "certain": False}
    base = _fleet()
    assert "backlash" not in Population(base.units, [*base.effects, row]).has_effect


def test_lists_of_shares_are_added_up_and_other_lists_left_out() -> None:
    row = _effect("u000", "creep", 0.0)
    names = (("gains[1]", 0.1, "1"), ("gains[2]", 0.05, "1"), ("time_constants_s[1]", 3.0, "s"), ("delay_s", 0.2, "s"))
    row["parameters"] = [{"name": n, "value": v, "std": 0.01, "unit": u} for n, v, u in names]
    (unit,) = _fleet(1).units
    found = {x.label: float(x.values[0]) for x in Population([unit], [row]).of_effects}
    assert found == {"creep: delay": 0.2, "creep: sum of gains": np.float64(0.1) + 0.05}
