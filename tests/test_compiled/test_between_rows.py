"""What happens between the rows: a band-limited voltage, and readings that integrate."""

from dataclasses import replace

import numpy as np
import pytest
from few import few
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.measurement.corrected_model import driven
from bender_discrepancy.conclusion.measurement.playable import playable
from bender_export.build import build_plant_fmu
from bender_loop.records.between_rows import course, exposed, followed
from bender_plant.model import load_model

BEAM = load_model("beam")
TIME_S = np.arange(300) / 30.0
TAU_S = 0.02


def lagged_sine_V(time_s: np.ndarray, frequency_Hz: float) -> np.ndarray:
    """A sine of 20 V about 25 V, settled behind a first-order lag: its own closed form."""
    omega = 2.0 * np.pi * frequency_Hz
    gain, phase = 1.0 / np.hypot(1.0, omega * TAU_S), -np.arctan(omega * TAU_S)
    return 25.0 + 20.0 * gain * np.sin(omega * time_s + phase)


@pytest.mark.parametrize("frequency_Hz", [1.0, 3.0, 6.0])
def test_a_smooth_voltage_is_followed_far_better_than_straight_lines(frequency_Hz: float):
    volts = 25.0 + 20.0 * np.sin(2.0 * np.pi * frequency_Hz * TIME_S)
    model = BEAM.with_block("source_resistance", time_constant_s=TAU_S)
    gain = Simulator(Drive.of_rows(TIME_S, np.full(300, 50.0))).run(BEAM).reading_um[-1] / 50.0
    truth = gain * lagged_sine_V(TIME_S, frequency_Hz)
    left = {}
    for hold in ("linear", "smooth"):
        drive = Drive(TIME_S, TIME_S, volts, linear=True, smooth=hold == "smooth")
        left[hold] = np.abs(Simulator(drive).run(model).reading_um - truth)[100:-10].max()
    assert left["smooth"] < 0.2 * left["linear"]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.4), st.booleans())
def test_between_even_rows_a_band_limited_voltage_is_exact(seed: int, part_of_rate: float, jitter: bool):
    rng = np.random.default_rng(seed)
    rate_Hz, phase = 600.0, rng.uniform(0.0, 6.0)
    omega = 2.0 * np.pi * part_of_rate * rate_Hz
    time_s = (np.arange(300) + jitter * rng.uniform(-2e-4, 2e-4, 300)) / rate_Hz
    instants, values = followed(time_s, 20.0 * np.sin(omega * time_s + phase))
    inner = (instants > time_s[60]) & (instants < time_s[-60])
    assert np.abs(values - 20.0 * np.sin(omega * instants + phase))[inner].max() < 20.0 * (3e-3 if jitter else 1e-3)
    at_rows = np.interp(time_s, instants, values)
    assert at_rows == pytest.approx(20.0 * np.sin(omega * time_s + phase), abs=1e-6)


@settings(max_examples=20, deadline=None)
@example(seed=0, jitter=False, stretches=[1, 1, 1])
@given(
    seed=st.integers(0, 10_000), jitter=st.booleans(), stretches=st.lists(st.integers(1, 60), min_size=1, max_size=4)
)
def test_the_course_runs_through_what_follows_it(seed: int, jitter: bool, stretches: list[int]):
    rng = np.random.default_rng(seed)
    steps = np.where(rng.random(sum(stretches)) < 0.5 * jitter, 1.2, 1.0)
    steps[np.cumsum(stretches)[:-1]] = 50.0
    time_s, volts = np.cumsum(steps) / 600.0, rng.uniform(0.0, 50.0, steps.size)
    if time_s.size < 2:
        return
    instants, values = followed(time_s, volts)
    assert course(time_s, volts)(instants) == pytest.approx(values, abs=1e-9)
    # where most rows are this far apart, none is a pause
    pauses = np.diff(time_s) > max(0.05, 10.0 * float(np.median(np.diff(time_s))))
    between = 0.5 * (time_s[:-1] + time_s[1:])[pauses]
    assert course(time_s, volts)(between) == pytest.approx(np.interp(between, time_s, volts), abs=1e-9)


@pytest.mark.parametrize("part_of_rate", [0.05, 0.11, 0.25, 0.4])
@pytest.mark.parametrize("delay_s", [0.0, 7e-4])
def test_coarse_parabolas_are_nearer_to_the_course_than_its_straight_pieces(part_of_rate: float, delay_s: float):
    """Both against the closed form of a lag behind a sine."""
    rate_Hz, tau_s = 600.0, 2e-3
    omega = 2.0 * np.pi * part_of_rate * rate_Hz
    time_s = np.arange(600) / rate_Hz
    static = replace(BEAM, blocks=tuple(x for x in BEAM.blocks if x.id != "bending_modes"))
    model = static.with_block("source_resistance", time_constant_s=tau_s)
    if delay_s:
        model = model.with_block("transport_delay", delay_s=delay_s)
    gain = Simulator(Drive.of_rows(TIME_S, np.full(300, 50.0))).run(model).reading_um[-1] / 50.0
    settled = 20.0 / np.hypot(1.0, omega * tau_s) * np.sin(omega * (time_s - delay_s) - np.arctan(omega * tau_s))
    drive = Drive(time_s, time_s, 20.0 * np.sin(omega * time_s), linear=True, smooth=True)
    left = {x: Simulator(drive, coarser=x).run(model).reading_um - gain * settled for x in (1.0, 3.0)}
    off = {x: float(np.abs(y[100:-60]).max()) for x, y in left.items()}
    assert off[3.0] < 0.6 * off[1.0]


def test_a_held_back_course_begins_late():
    model = BEAM.with_block("transport_delay", delay_s=0.05)
    drive = Drive(TIME_S, TIME_S, np.full(300, 20.0), linear=True, smooth=True)
    fine, coarse = (Simulator(drive, coarser=x).run(model).reading_um for x in (1.0, 3.0))
    assert coarse == pytest.approx(fine, abs=0.02)
    assert coarse[1] == pytest.approx(0.0, abs=1e-9)


def test_uneven_rows_are_joined_by_a_spline():
    time_s = np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, 300)) / 600.0
    instants, values = followed(time_s, np.sin(2.0 * np.pi * 60.0 * time_s))
    inner = (instants > time_s[60]) & (instants < time_s[-60])
    assert np.abs(values - np.sin(2.0 * np.pi * 60.0 * instants))[inner].max() < 0.02


def test_rows_far_apart_are_joined_by_a_straight_line():
    time_s = np.concatenate([[-300.0], TIME_S])
    volts = np.concatenate([[50.0], 25.0 + 20.0 * np.sin(2.0 * TIME_S)])
    instants, values = followed(time_s, volts)
    assert instants[0] == -300.0
    assert instants[1] == 0.0
    assert values.max() <= 50.0
    assert values.min() >= 4.9


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10_000), st.floats(1e-3, 0.03), st.booleans())
def test_an_exposure_is_the_mean_of_snapshots(seed: int, exposure_s: float, linear: bool):
    rng = np.random.default_rng(seed)
    volts = rng.uniform(0.0, 50.0, 40)
    time_s = np.arange(40) / 30.0
    # a kink of the slope by 460 µm/s, a step of 50 V behind 50 ms, costs 5e-4 of 14 µm within 30 ms
    model = BEAM.with_block("source_resistance", time_constant_s=0.05)
    found = Simulator(Drive(time_s, time_s + 0.02, volts, linear, exposure_s=exposure_s)).run(model).reading_um
    part = (np.arange(4000) + 0.5) / 4000 - 0.5
    dense_s = (time_s[:, None] + exposure_s * part).ravel()
    snapshots = Simulator(Drive(dense_s, time_s + 0.02, volts, linear)).run(model).reading_um
    assert found == pytest.approx(snapshots.reshape(40, -1).mean(axis=1), abs=9e-3)


def test_no_exposure_is_a_snapshot():
    volts = np.random.default_rng(1).uniform(0.0, 50.0, 300)
    snapshot = Simulator(Drive(TIME_S, TIME_S + 0.01, volts)).run(BEAM).reading_um
    short = Simulator(Drive(TIME_S, TIME_S + 0.01, volts, exposure_s=1e-7)).run(BEAM).reading_um
    assert short == pytest.approx(snapshot, abs=2e-3)


@pytest.mark.parametrize("hold", few(["hold", "smooth"], 0))
def test_an_fmu_reads_what_the_simulation_reads(hold: str, tmp_path):
    volts = np.random.default_rng(2).uniform(10.0, 40.0, 60)
    smooth = hold == "smooth"
    drive = Drive(TIME_S[:60], TIME_S[:60] + 0.004, volts, smooth, smooth, 0.015)
    record, read = playable(drive)
    model = BEAM.with_block("source_resistance", time_constant_s=0.03)
    (readings,) = driven(build_plant_fmu(model, tmp_path / "plant.fmu"), [record], smooth)
    assert read.readings(readings) == pytest.approx(Simulator(drive).run(model).reading_um, abs=2e-3)


def test_the_mean_of_a_parabola_is_exact():
    read = exposed(np.array([1.0, 2.0]), 0.5, (np.array([1.1]),))
    mean = read.readings(read.instants_s**2)
    assert mean == pytest.approx(np.array([1.0, 4.0]) + 0.25 / 12.0, abs=1e-12)


@given(st.floats(0.01, 5.0), st.floats(0.0, 6.3))
def test_the_mean_of_a_ringing_is_that_of_the_integral(periods: float, phase: float):
    # ratios of damping of half a percent are read off swings that an exposure of 15 ms takes nearly all of
    exposure_s, time_s = 0.015, np.array([0.1])
    omega = 2.0 * np.pi * periods / exposure_s
    read = exposed(time_s, exposure_s)
    mean = read.readings(np.sin(omega * (read.instants_s - 0.1) + phase))
    assert mean == pytest.approx(np.sin(phase) * np.sinc(periods), abs=1e-12)
