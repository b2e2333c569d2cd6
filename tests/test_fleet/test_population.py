"""What the units say together, and a watch over every unit, on tables of which everything is known."""

import datetime
import json
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_fleet.page.page import page_of
from bender_fleet.population.experiment import undecided
from bender_fleet.population.features import Population
from bender_fleet.population.outliers import outliers
from bender_fleet.population.trends import bad_batches, drifts
from bender_fleet.work.reading import Reading
from bender_fleet.work.watch import CHANGED, STEADY, WatchWork
from bender_loop.errors import InputError
from bender_loop.records.record import Record, write_record
from bender_plant.model import load_model
from bender_watch.settings import Settings

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


pytest.importorskip("pyarrow")


MODEL = load_model("beam")
WORK = WatchWork(MODEL, Reading(), Settings(diagnose=False, explain_rows=300, learn_rows=1000), "1e5")


def written(path: Path, seed: int, rows: int = 1200, at: int | None = None) -> Path:
    """Write steps at 50 Hz with noise of 0.05 um, the gain 5 % larger from a row on."""
    rng = np.random.default_rng(seed)
    time = np.arange(rows) / 50.0
    voltage = np.repeat(np.append(0.0, rng.uniform(0.0, 30.0, rows // 30 - 1)), 30)
    reading = Simulator(Drive.of_rows(time, voltage)).run(MODEL).reading_um
    gain = np.where(np.arange(rows) < (rows if at is None else at), 1.0, 1.05)
    write_record(path, Record(time, voltage, gain * reading + 0.05 * rng.standard_normal(rows)))
    return path


@pytest.mark.parametrize("at", [None, 600])
def test_the_first_record_says_what_is_normal_for_the_others(at: int | None, tmp_path: Path) -> None:
    paths = [written(tmp_path / "first.csv", 1), written(tmp_path / "second.csv", 2, at=at)]
    found = WORK.do(paths, ["first.csv", "second.csv"])
    assert found.row["verdict"] == (STEADY if at is None else CHANGED)
    assert set(found.files) == {"events.jsonl", "watch.json", "report.html"}
    facts = json.loads(found.files["watch.json"])
    assert facts["rows"] == 1200
    assert found.row["alarms"] == facts["alarms"] == len(found.effects)
    if at is not None:
        assert 11.0 < found.row["since_s"] < 13.5
        assert [x["effect"] for x in found.effects] == found.row["effects"]


def test_of_a_single_record_the_first_rows_do(tmp_path: Path) -> None:
    found = WORK.do([written(tmp_path / "only.csv", 3, rows=2400, at=1800)], ["only.csv"])
    assert found.row["verdict"] == CHANGED
    assert 35.0 < found.row["since_s"] < 38.0


def test_too_few_rows_are_bad_input_of_that_unit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"few\.csv: found 60 readings"):
        WORK.do([written(tmp_path / "few.csv", 4, rows=60), written(tmp_path / "more.csv", 5)], ["few.csv", "more.csv"])


def test_the_page_says_which_batch_has_the_alarms(tmp_path: Path) -> None:
    units: list[dict[str, Any]] = [
        {
            "unit": f"u{k}", "batch": "ABC"[k % 3], "date": datetime.date(2026, 1, 1), "status": "done", "reason": None,
            "verdict": CHANGED if k % 3 == 1 else STEADY, "alarms": float(k % 3 == 1),
            "effects": [["gain_error", "creep"][k % 2]] if k % 3 == 1 else [], "sentence": "", "noise_um": 0.05,
        }
        for k in range(60)
    ]  # fmt: skip
    effects = [
        {"unit": x["unit"], "effect": x["effects"][0], "certain": True, "share_of_gap": None, "parameters": []}
        for x in units
        if x["effects"]
    ]
    population = Population(units, effects)
    assert ("B", "an alarm", 1.0) in [(x.batch, x.label, x.inside) for x in bad_batches(population)]
    page = page_of(population, "watch", tmp_path)
    assert "20 have changed" in page
    assert "B: an alarm in 100 % of 20 units, in 0 % of the others" in page
    assert "watch.json" in page
