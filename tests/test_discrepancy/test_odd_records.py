"""Records as nobody planned them: without noise, from coarse and quiet sensors, read in a part only."""

from dataclasses import replace

import numpy as np
import pytest
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.records.noise import least_noise_um
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import diagnose, search_records
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")


def exact(duration_s: float = 14.0) -> Record:
    """A record without noise of the model as given."""
    volts = levels(duration_s)
    time_s = FRAME_S * np.arange(volts.size, dtype=np.float64)
    return Record(time_s, volts, Simulator(Drive.of_rows(time_s, volts)).run(PAPER).reading_um)


@pytest.mark.slow
@pytest.mark.parametrize("decimals", [2, 3, 6])
def test_another_simulator_that_prints_its_readings_agrees(decimals: int) -> None:
    record = exact()
    record = replace(record, displacement_um=np.round(record.displacement_um, decimals))
    found = search_records(PAPER, [record])
    assert found.verdict.word == "no_gap"
    assert found.archive.noise_um >= 0.99 * 10.0**-decimals / np.sqrt(12.0)


@pytest.mark.parametrize("decimals", [1, 2, 4])
def test_readings_are_no_better_than_their_last_digit(decimals: int) -> None:
    readings = np.round(np.random.default_rng(3).uniform(-7.0, 20.0, size=500), decimals)
    assert least_noise_um(readings, steps=True) == pytest.approx(10.0**-decimals / np.sqrt(12.0))
    assert least_noise_um(1e3 * readings, steps=True) == pytest.approx(10.0 ** (3 - decimals) / np.sqrt(12.0))
    span = float(np.ptp(readings))
    assert least_noise_um(readings, steps=False) == pytest.approx(1e-6 * span)


@pytest.mark.slow
@pytest.mark.parametrize(("step_um", "noise_um", "seed"), [(0.5, 0.02, 1), (0.2, 0.005, 2), (0.5, 0.005, 3)])
def test_readings_that_all_lie_within_their_steps_are_no_fault(step_um: float, noise_um: float, seed: int) -> None:
    record = exact(12.0)
    noise = noise_um * np.random.default_rng(seed).standard_normal(len(record))
    record = replace(record, displacement_um=step_um * np.round((record.displacement_um + noise) / step_um))
    findings = find(search_records(PAPER, [record]))
    assert findings.verdict == "named"
    assert [x.id for x in findings.effects] == ["sensor_quantisation"]


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.18), (0.2, 0.25), (0.6, 1.0)])
def test_a_camera_that_saw_a_part_of_the_record_is_judged_on_that(begin: float, end: float) -> None:
    volts = levels(50.0)
    hidden = {"creep": {"gains": (0.15,), "time_constants_s": (0.8,)}}
    record = record_of(effects=hidden, voltage_V=volts)
    place = np.arange(len(record)) / len(record)
    seen = (place >= begin) & (place < end)
    record = replace(record, displacement_um=np.where(seen, record.displacement_um, np.nan))
    read = observe(record)
    assert all(int(x.sum()) >= 6 for x in (read.training, read.judging, read.reporting))
    told = diagnose(PAPER, [record]).to_dict()
    assert told["verdict"] != "no_gap"
    assert told["gap"]["after"]["rms_um"] is not None
    assert "nan" not in told["sentence"]
    if told["verdict"] == "named":
        assert [x["id"] for x in told["effects"]] == ["creep"]
        assert told["gap"]["after"]["rms_um"] < 1.5 * NOISE_um
