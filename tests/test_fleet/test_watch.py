"""A watch over every unit: which changed, since when, and what those that did have in common."""

import datetime
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pyarrow")

from bender_compiled.simulation import Drive, Simulator
from bender_fleet.page.page import page_of
from bender_fleet.population.features import Population
from bender_fleet.population.trends import bad_batches
from bender_fleet.work.reading import Reading
from bender_fleet.work.watch import CHANGED, STEADY, WatchWork
from bender_loop.errors import InputError
from bender_loop.records.record import Record, write_record
from bender_plant.model import load_model
from bender_watch.settings import Settings

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
