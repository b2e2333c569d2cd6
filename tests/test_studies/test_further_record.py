"""What an open answer asks for is recorded on the hidden bench: the experiment, or the same again, with its columns."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bender_loop.records.record import read_record
from bender_proving import Bench, make_case
from bender_studies.hidden_effects import session
from bender_studies.hidden_effects.trial import Answer, Trial

OPEN = Answer("case-0", "ambiguous", ("source_resistance",), ("sensor_lag",))
CASE = make_case("moved", ("sensor_lag",), 7, "camera", moved=0.05)


def _running(folder: Path, **more: object) -> session._Running:
    (folder / CASE.id).mkdir(parents=True)
    trial = Trial(CASE.id, (folder / "record.csv",), None, folder / CASE.id / "answer")
    return session._Running(CASE, replace(trial, **more), 170.0)  # type: ignore[arg-type]


def test_the_same_excitation_is_played_again_with_the_columns(tmp_path: Path) -> None:
    item = _running(tmp_path)
    again = session._again(item, replace(OPEN, columns=("supply_voltage_V",)), tmp_path)
    assert again is not None
    assert item.first is not None
    first, further = again.records
    assert first == item.trial.records[0]
    record, bench = read_record(further), Bench(CASE)
    plan = bench.excitation()
    assert record.supply_voltage_V is not None
    assert np.allclose(record.voltage_V, plan.voltage_V[plan.recorded])
    assert not np.allclose(record.displacement_um, bench.record(plan, bench.noise()).displacement_um)


def test_the_experiment_is_played_where_one_is_designed(tmp_path: Path) -> None:
    profile = tmp_path / "profile.csv"
    profile.write_text("time_s,voltage_V\n0,0\n0.5,10\n1.5,0\n3,0\n", encoding="utf-8")
    again = session._again(_running(tmp_path), replace(OPEN, profile=profile), tmp_path)
    assert again is not None
    record = read_record(again.records[1])
    assert record.supply_voltage_V is None
    assert record.voltage_V.max() == 10.0
    assert record.time_s[-1] < 5.0


@pytest.mark.parametrize(
    ("found", "more"),
    [
        (OPEN, {}),
        (replace(OPEN, verdict="named", columns=("supply_voltage_V",)), {}),
        (replace(OPEN, verdict="unexplained", columns=("supply_voltage_V",)), {}),
        (replace(OPEN, columns=("supply_voltage_V",)), {"fmu": Path("nominal.fmu")}),
    ],
    ids=["asks for nothing", "named", "unexplained", "of a foreign FMU"],
)
def test_nothing_is_recorded_where_nothing_open_is_asked_for(found: Answer, more: dict, tmp_path: Path) -> None:
    assert session._again(_running(tmp_path, **more), found, tmp_path) is None


def test_an_answer_asks_once(tmp_path: Path) -> None:
    item = _running(tmp_path)
    found = replace(OPEN, columns=("supply_voltage_V",))
    assert session._again(item, found, tmp_path) is not None
    assert session._again(item, found, tmp_path) is None
