"""Records that start in the middle of a motion."""

from pathlib import Path

import numpy as np
import pytest
from few import few
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of

from bender_compiled.simulation import Simulator
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.measurement.corrected_model import driven
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.conclusion.measurement.playable import playable, playable_for
from bender_discrepancy.conclusion.notes import warnings
from bender_discrepancy.records.excitation import one_sine, sine_frequency_Hz
from bender_discrepancy.records.initial_motion import standing_before, started
from bender_discrepancy.records.observations import observe, only_one_sine
from bender_discrepancy.settings import Settings
from bender_discrepancy.workflow import search_records
from bender_export.build import build_plant_fmu
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_plant.plant import longest_step_s

PAPER = load_model("paper")


def sine_V(frequency_Hz: float, rows: int, amplitude_V: float = 8.0, phase: float = 0.7) -> np.ndarray:
    return 25.0 + amplitude_V * np.sin(2.0 * np.pi * frequency_Hz * FRAME_S * np.arange(rows) + phase)


def cut(record: Record, first: int) -> Record:
    """What a recorder sees that is switched on late."""
    return Record(record.time_s[first:], record.voltage_V[first:], record.displacement_um[first:])


@examples(max_examples=10)
@given(st.floats(0.1, 3.0), st.floats(0.0, 6.0), st.floats(1.0, 20.0))
def test_the_frequency_of_a_sine_is_found(frequency_Hz: float, phase: float, amplitude_V: float) -> None:
    volts = sine_V(frequency_Hz, 1200, amplitude_V, phase)
    time_s = FRAME_S * np.arange(1200.0)
    assert sine_frequency_Hz(time_s, volts) == pytest.approx(frequency_Hz, abs=1e-3)
    assert one_sine(time_s, volts)


@pytest.mark.slow
@pytest.mark.parametrize("frequency_Hz", [0.31, 1.7])
def test_a_sine_was_running_before(frequency_Hz: float) -> None:
    whole = record_of(voltage_V=sine_V(frequency_Hz, 2400), effects={"sensor_lag": {"time_constant_s": 0.2}})
    late = cut(whole, 1200)
    seen = started(PAPER, late, observe(late))
    assert seen.drive.command_time_s[0] < -30.0
    assert np.array_equal(seen.command_V, late.voltage_V)
    assert seen.acting_V[0] == pytest.approx(whole.voltage_V[1199], abs=0.1)
    lagging = PAPER.with_block("sensor_lag", time_constant_s=0.2)
    left = late.displacement_um - Simulator(seen.drive).run(lagging).reading_um
    assert np.std(left) < 0.07


def test_what_starts_at_rest_stays_as_it_is() -> None:
    jumping = record_of(voltage_V=np.r_[np.full(300, 30.0), np.full(300, 10.0)])
    assert started(PAPER, jumping, observe(jumping)).drive.command_time_s[0] == 0.0
    at_rest = record_of()
    assert started(PAPER, at_rest, observe(at_rest)).drive.command_time_s[0] == 0.0


@pytest.mark.parametrize("linear", few([False, True], 0))
def test_an_fmu_is_led_in_as_the_simulation_is(tmp_path: Path, linear: bool) -> None:
    whole = record_of(voltage_V=sine_V(0.5, 900), linear=linear)
    late = cut(whole, 450)
    seen = started(PAPER, late, observe(late, linear))
    model = PAPER.with_block("creep", gains=(0.2,), time_constants_s=(3.0,)).with_block(
        "thermal_drift", amplitude_um=2.0
    )
    record, read = playable(seen.drive)
    assert record.time_s[0] < 0.0
    (readings,) = driven(build_plant_fmu(model, tmp_path / "led.fmu"), [record], linear)
    assert np.max(np.abs(read.readings(readings) - Simulator(seen.drive).run(model).reading_um)) < 1e-3


@pytest.mark.slow
def test_a_long_stand_is_driven_in_steps_that_a_plant_with_short_sub_steps_takes(tmp_path: Path) -> None:
    model = PAPER.with_block("stiffening", cubic_1_per_um2=1e-4)
    observations = observe(record_of(voltage_V=np.r_[np.full(450, 30.0), np.full(450, 10.0)]))
    stood = standing_before(PAPER, observations)
    assert stood is not None
    whole, _ = playable(stood.drive)
    assert np.diff(whole.time_s).max() > longest_step_s(model)
    record, read = playable_for(model, stood.drive)
    assert np.diff(record.time_s).max() <= longest_step_s(model)
    (readings,) = driven(build_plant_fmu(model, tmp_path / "led.fmu"), [record], False)
    assert np.max(np.abs(read.readings(readings) - Simulator(stood.drive).run(model).reading_um)) < 1e-3


@pytest.mark.slow
def test_a_lag_seen_by_one_sine_is_one_of_many(tmp_path: Path) -> None:
    whole = record_of(voltage_V=sine_V(1.0, 1200), effects={"source_resistance": {"time_constant_s": 0.03}})
    late = cut(whole, 700)
    found = search_records(PAPER, [late])
    assert only_one_sine(found.problem.observations)
    assert found.verdict.word == "ambiguous"
    said = {found.best.hypothesis.effects[-1], *(x.id for x in found.grades.effects[0].rivals)}
    assert {"source_resistance", "sensor_lag", "transport_delay", "rate_independent_hysteresis"} <= said
    assert "periodic_disturbance" not in found.best.hypothesis.effects


@pytest.mark.slow
def test_the_corrected_model_stands_for_the_record_with_the_largest_gap(tmp_path: Path) -> None:
    """A still first record must not leave the drift of the second one out of the model, or undetermined in it."""
    calm = record_of(seed=3)
    drifting = {"amplitude_um": 2.0, "time_constant_s": 6.0}
    second = record_of(effects={"thermal_drift": drifting}, seed=4, voltage_V=levels(seed=9))
    findings = find(search_records(PAPER, [calm, second], Settings(with_record_effects=True)))
    assert findings.of_record == 1
    block = next(x.parameters for x in findings.model.blocks if x.id == "thermal_drift")
    assert block.amplitude_um == pytest.approx(2.0, rel=0.05)
    (effect,) = findings.added
    assert effect.numbers == effect.by_record[1]
    assert effect.by_record[0] != effect.by_record[1]
    said = warnings(findings)
    assert any("stand for record 2" in x and "record 1: amplitude_um" in x for x in said)
    assert not any("do not determine" in x for x in said)
    path = tmp_path / "model.fmu"
    measured = measure(findings.search, findings.model, findings.calibration, path, findings.of_record)
    assert measured.after.rms_um < 1.1 * NOISE_um
    (alone,) = driven(path, [second])
    seen = observe(second)
    assert np.sqrt(np.mean((second.displacement_um - alone)[seen.usable] ** 2)) < 1.1 * NOISE_um
