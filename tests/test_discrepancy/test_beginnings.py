"""Records that begin in motion: a voltage that is fitted, a motion that is led in, modes that ring from before."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from few import few
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of
from scipy.linalg import expm

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.measurement.corrected_model import driven
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.conclusion.measurement.playable import playable, playable_for
from bender_discrepancy.conclusion.notes import warnings
from bender_discrepancy.record_search import search_records
from bender_export.build import build_plant_fmu
from bender_inference.records.excitation import one_sine, sine_frequency_Hz
from bender_inference.records.initial_motion import moving, standing_before, started
from bender_inference.records.observations import observe
from bender_inference.records.ringing import first_resonance, free_ringing, rung_out
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model
from bender_plant.plant import longest_step_s

PAPER = load_model("paper")
DENSE_S = 1e-3


def of_frequency(first_Hz: float, damping_ratio: float) -> Model:
    return PAPER.with_block("bending_modes", first_frequency_Hz=first_Hz, damping_ratio=damping_ratio)


def stood_at(volts: float, voltage_V: np.ndarray, seed: int = 3) -> Record:
    """What a camera sees of a plant that stood at a voltage until the first row."""
    time_s = FRAME_S * np.arange(voltage_V.size, dtype=np.float64)
    drive = Drive(time_s, np.r_[-100.0, time_s], np.r_[volts, voltage_V])
    noise_um = NOISE_um * np.random.default_rng(seed).standard_normal(voltage_V.size)
    return Record(time_s, voltage_V, Simulator(drive).run(PAPER).reading_um + noise_um)


def switched_on_late(voltage_V: np.ndarray, first_s: float) -> Record:
    """What a camera sees that is switched on while a plant moves, at an instant between two frames."""
    time_s = FRAME_S * np.arange(voltage_V.size, dtype=np.float64)
    read = time_s >= first_s
    noise_um = NOISE_um * np.random.default_rng(5).standard_normal(int(read.sum()))
    reading_um = Simulator(Drive.of_rows(time_s, voltage_V)).run(PAPER).reading_um[read]
    return Record(time_s[read], voltage_V[read], reading_um + noise_um)


@given(st.floats(1.0, 500.0), st.floats(1e-3, 0.2), st.integers(50, 400))
def test_what_may_still_ring_from_before_is_no_reading(first_Hz: float, damping_ratio: float, rows: int) -> None:
    time_s = 0.01 * np.arange(rows, dtype=np.float64)
    seen = observe(Record(time_s, np.full(rows, 10.0), np.full(rows, 4.0)))
    kept = rung_out(seen, of_frequency(first_Hz, damping_ratio))
    rate_per_s = 2.0 * np.pi * first_Hz * damping_ratio
    gone = ~kept.usable
    assert np.array_equal(np.isnan(kept.measured_um), gone)
    assert np.all(np.diff(gone.astype(int)) <= 0)
    # a ten-thousandth is left of what rang, unless that would take more than a fifth of the record
    rang_s = float(time_s[kept.usable][0])
    assert np.exp(-rate_per_s * rang_s) < 1.001e-4 or rang_s >= 0.2 * float(time_s[-1]) * (1.0 - 1e-9)
    assert rang_s <= 0.2 * float(time_s[-1]) + 0.01


def test_nothing_rings_in_a_model_without_modes() -> None:
    still = replace(PAPER, blocks=tuple(x for x in PAPER.blocks if x.id != "bending_modes"))
    seen = observe(record_of())
    assert first_resonance(still) is None
    assert rung_out(seen, still) is seen
    assert free_ringing(still, seen.time_s).shape == (seen.time_s.size, 0)


@examples(max_examples=20)
@given(st.floats(5.0, 200.0), st.floats(0.0005, 0.5), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_mode_that_is_left_alone_rings_so(first_Hz: float, damping_ratio: float, q: float, rate: float) -> None:
    """Oracle: the matrix exponential of q'' + 2 zeta omega q' + omega^2 q = 0, in units of omega."""
    omega, turns = 2.0 * math.pi * first_Hz, np.linspace(0.0, 20.0, 60)
    system = np.array([[0.0, 1.0], [-1.0, -2.0 * damping_ratio]])
    rings = np.array([(expm(system * x) @ [q, rate])[0] for x in turns])
    free = free_ringing(of_frequency(first_Hz, damping_ratio), 3.0 + turns / omega)
    numbers, *_ = np.linalg.lstsq(free, rings)
    assert np.allclose(free @ numbers, rings, atol=1e-8)


def test_every_mode_rings() -> None:
    three = load_model("beam")
    count = sum(len(x.parameters.count * [0]) for x in three.blocks if x.id == "bending_modes")
    assert free_ringing(three, np.linspace(0.0, 1.0, 50)).shape == (50, 2 * count)


@pytest.mark.parametrize("volts", [20.0, 33.0, 50.0])
def test_the_voltage_is_found_at_which_a_plant_stood(volts: float) -> None:
    seen = observe(stood_at(volts, np.maximum(levels(30.0, 3), 5.0)))
    found = standing_before(PAPER, seen)
    assert found is not None
    assert found.start == "from_voltage"
    assert found.rest_before_V == pytest.approx(volts, rel=0.1)
    assert found.drive.voltage_V[0] == found.rest_before_V
    assert np.array_equal(found.command_V, seen.command_V)
    simulated = Simulator(found.drive).run(PAPER).reading_um
    left = (found.measured_um - simulated)[found.usable]
    assert np.std(left) < 1.1 * NOISE_um


@pytest.mark.parametrize(
    ("roll", "first_row"), [(11, 155), *(pytest.param(*x, marks=pytest.mark.slow) for x in ((67, 200), (140, 301)))]
)
def test_nothing_is_missing_where_a_record_begins_in_motion(roll: int, first_row: int) -> None:
    record = switched_on_late(np.roll(levels(40.0, 4), roll), FRAME_S * (first_row - 0.5))
    found = search_records(PAPER, [record])
    assert found.verdict.word == "no_gap"


def test_a_quick_recorder_may_hear_nothing_but_ringing_for_long() -> None:
    """More rows ring than tell of a voltage, and a fifth of the record at most is left out."""
    time_s = 1e-5 * np.arange(60_000.0)
    volts = np.where(time_s < 0.3, 30.0, 12.0)
    drive = Drive(time_s, np.r_[-50.0, time_s], np.r_[45.0, volts])
    seen = observe(Record(time_s, volts, Simulator(drive, coarser=8.0).run(PAPER).reading_um))
    found = standing_before(PAPER, seen)
    assert found is not None
    assert 11_000 < int((~found.usable).sum()) < 13_000
    few = observe(Record(time_s[:12], volts[:12], seen.measured_um[:12]))
    assert standing_before(of_frequency(1.0, 1e-3), few) is not None


def test_a_start_in_motion_that_is_told_gets_the_lead_in_that_fits() -> None:
    record = stood_at(40.0, np.maximum(levels(30.0, 3), 5.0))
    seen = moving(PAPER, record, observe(record))
    assert seen.start == "from_voltage"
    running = record_of(voltage_V=25.0 + 8.0 * np.sin(2.0 * np.pi * 1.3 * FRAME_S * np.arange(900)))
    assert moving(PAPER, running, observe(running)).start == "motion"


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
    assert any("describe record 2" in x and "record 1: amplitude_um" in x for x in said)
    assert not any("do not determine" in x for x in said)
    path = tmp_path / "model.fmu"
    measured = measure(findings.search, findings.model, findings.calibration, path, findings.of_record)
    assert measured.after.rms_um < 1.1 * NOISE_um
    (alone,) = driven(path, [second])
    seen = observe(second)
    assert np.sqrt(np.mean((second.displacement_um - alone)[seen.usable] ** 2)) < 1.1 * NOISE_um
