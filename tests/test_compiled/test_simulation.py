"""The compiled chain equals the plain kernel on every block and effect, whatever the drive and between the rows."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES
from few import few, few_rows
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from plant_runs import with_transducer

from bender_compiled.kernels import uncut_run
from bender_compiled.linear_modes import linear_modes_run, spring_alone
from bender_compiled.simulation import RUN_SUBSTEPS, Drive, Simulator
from bender_discrepancy.conclusion.measurement.corrected_model import driven
from bender_discrepancy.conclusion.measurement.playable import playable
from bender_export.build import build_plant_fmu
from bender_loop.records.between_rows import course, exposed, followed
from bender_plant.blocks import BLOCKS, Block
from bender_plant.composite_beam import CompositeBeam
from bender_plant.model import Model, ModelError, load_model
from bender_plant.plant import Plant, effective_settings

PAPER = load_model("paper")
RNG = np.random.default_rng(7)
STEPS = RNG.uniform(0.002, 0.2, 30)
TIME = np.concatenate([[0.5], 0.5 + np.cumsum(STEPS)])
VOLTAGE = np.append(np.repeat(RNG.uniform(0.0, 50.0, 10), 3), 0.0)


def plain(model: Model, time: np.ndarray, voltage: np.ndarray, command_time: np.ndarray) -> np.ndarray:
    """Readings at the rows by the plain kernel: the last command in force until the new one acts."""
    plant = Plant(model)
    state = plant.initial()
    readings = [plant.at_rest(time[0])[0]]
    in_force = 0.0
    for k in range(len(time) - 1):
        if command_time[k] > time[k]:
            state, _, _ = plant.step(state, in_force, time[k], command_time[k] - time[k])
        in_force = float(voltage[k])
        state, reading, _ = plant.step(state, in_force, command_time[k], time[k + 1] - command_time[k])
        readings.append(reading)
    return np.array(readings)


@pytest.mark.parametrize(
    ("block_id", "parameters"),
    few_rows(EXAMPLES, *range(0, len(EXAMPLES), 6)),
    ids=[f"{x} {k}" for k, (x, _) in enumerate(EXAMPLES)],
)
def test_every_effect_equals_the_plain_kernel(block_id: str, parameters: dict[str, Any]) -> None:
    model = PAPER.with_block(block_id, **parameters).with_block("calibration", gain=0.9, offset_um=0.3)
    late = TIME + 0.001
    ours = Simulator(Drive.of_rows(TIME, VOLTAGE, late)).run(model)
    # a delayed command is cut at other instants, so sub-steps differ
    bound = 1e-4 if block_id == "transport_delay" else 1e-7
    assert np.max(np.abs(ours.reading_um - plain(model, TIME, VOLTAGE, late))) < bound


TRANSDUCERS = {
    **{name: load_model(name) for name in ("paper", "beam", "bench")},
    **{name: with_transducer(name) for name in ("linear_transduction", "prandtl_ishlinskii", "bouc_wen")},
    "sparse_equation": with_transducer("sparse_equation", terms=("u'", "u |u'|", "w"), coefficients=(0.4, 0.03, -0.9)),
}


@pytest.mark.parametrize("model", TRANSDUCERS.values(), ids=list(TRANSDUCERS))
def test_every_transducer_equals_the_plain_kernel(model: Model) -> None:
    ours = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(model)
    assert np.max(np.abs(ours.reading_um - plain(model, TIME, VOLTAGE, TIME))) < 1e-7


def test_the_tip_is_what_the_sensor_sees_before_it_errs() -> None:
    model = PAPER.with_block("calibration", gain=2.0).with_block("thermal_drift", amplitude_um=5.0)
    ours = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(model)
    assert np.allclose(ours.tip_um, Simulator(Drive.of_rows(TIME, VOLTAGE)).run(PAPER).reading_um, atol=1e-6)


def test_a_linear_command_is_many_small_steps() -> None:
    time = np.linspace(0.0, 1.0, 21)
    voltage = 25.0 + 25.0 * np.sin(7.0 * time)
    fine = np.linspace(0.0, 1.0, 20 * 400 + 1)
    held = np.interp(fine + (fine[1] - fine[0]) / 2, time, voltage)
    # the record starts from 0 V at rest, so the first value is a jump in both
    linear = Simulator(Drive.of_rows(time, voltage, linear=True)).run(load_model("bench")).reading_um
    stairs = Simulator(Drive.of_rows(fine, held)).run(load_model("bench")).reading_um[::400]
    assert np.max(np.abs(linear - stairs)) < 2e-3


def test_a_model_that_needs_too_many_sub_steps_is_refused() -> None:
    model = PAPER.with_block("source_resistance", time_constant_s=1e-7)
    bounded = Simulator(Drive.of_rows(TIME, VOLTAGE), most_substeps=900)
    assert np.all(np.isfinite(bounded.run(PAPER).reading_um))
    with pytest.raises(ModelError, match="sub-steps"):
        bounded.run(model)


@pytest.mark.parametrize("corners", [False, True])
def test_running_away_is_an_error_also_before_a_block_with_corners(corners: bool) -> None:
    """Numbers of any size, and none at all, are cut no further than sense allows."""
    model = PAPER.with_block("stiffening", cubic_1_per_um2=-0.04)
    model = model.with_block("backlash", half_width_um=1.2) if corners else model
    time_s = np.arange(300) / 30.0
    voltage_V = np.where(np.arange(300) // 10 % 2, 45.0, 5.0)
    with pytest.raises(ArithmeticError, match="ran away"):
        Simulator(Drive.of_rows(time_s, voltage_V)).run(model)


def test_a_lead_in_acts_before_the_first_row() -> None:
    model = load_model("paper").with_block("creep", gains=(0.3,), time_constants_s=(2.0,))
    time_s = np.arange(200) / 30.0
    voltage_V = 25.0 + 20.0 * np.sin(time_s)
    whole = Simulator(Drive.of_rows(time_s, voltage_V)).run(model).reading_um
    later = Simulator(Drive(time_s[80:], time_s, voltage_V)).run(model).reading_um
    assert np.max(np.abs(later - whole[80:])) < 1e-9


@pytest.mark.parametrize("block_id", ["thermal_drift", "ageing"])
def test_the_clock_of_the_surroundings_starts_with_the_first_row(block_id: str) -> None:
    parameters = {"thermal_drift": {"amplitude_um": 3.0}, "ageing": {"loss": 0.3}}[block_id]
    model = load_model("paper").with_block(block_id, time_constant_s=2.0, **parameters)
    commands = np.full(60, 20.0)
    lead = Simulator(Drive(np.arange(10) / 1.0, np.arange(-50, 10) / 1.0, commands)).run(model).reading_um
    plain = Simulator(Drive(np.arange(10) / 1.0, np.arange(-50, 10) / 1.0, commands)).run(load_model("paper"))
    change = lead - plain.reading_um
    assert change[0] == pytest.approx(0.0, abs=1e-9)
    assert abs(change[3]) > 0.5


def by_kernel(block_id: str, **changes: Any) -> Block:
    """A block that takes one command after the other, as one of another package does."""
    return replace(BLOCKS[block_id], id="other", commands=None, **changes)


def halved(state: Any, _: Any, voltage: float, step_s: float) -> Any:
    return state, [(step_s, 0.5 * voltage)]


def in_two_parts(state: Any, _: Any, voltage: float, step_s: float) -> Any:
    return state, [(0.25 * step_s, 0.5 * voltage), (0.75 * step_s, voltage)]


@pytest.mark.parametrize("kernel", [halved, in_two_parts])
def test_a_command_block_of_another_package_acts_by_its_own_kernel(
    kernel: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A block that is left out would pass for one that does nothing."""
    monkeypatch.setitem(BLOCKS, "other", by_kernel("supply_quantisation", command=kernel))
    model = PAPER.with_block("other").with_block("source_resistance", time_constant_s=0.02)
    found = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(model).reading_um
    assert np.max(np.abs(found - plain(model, TIME, VOLTAGE, TIME))) < 1e-3
    without = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(PAPER).reading_um
    assert np.max(np.abs(found - without)) > 1.0


@pytest.mark.parametrize(
    ("block_id", "numbers"), [("transport_delay", {"delay_s": 0.13}), ("supply_quantisation", {"step_V": 3.7})]
)
def test_a_kernel_does_what_the_rule_for_all_commands_does(
    block_id: str, numbers: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(BLOCKS, "other", by_kernel(block_id))
    kernel, rule = (
        Simulator(Drive.of_rows(TIME, VOLTAGE)).run(PAPER.with_block(x, **numbers)).reading_um
        for x in ("other", block_id)
    )
    assert np.max(np.abs(kernel - rule)) < 1e-3


def test_a_command_block_with_a_course_of_its_own_needs_held_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BLOCKS, "other", by_kernel("supply_quantisation", command=in_two_parts))
    straight = Simulator(Drive.of_rows(TIME, VOLTAGE, linear=True))
    with pytest.raises(ModelError, match="other: acts on held commands only"):
        straight.run(PAPER.with_block("other"))


@pytest.mark.parametrize("block_id", ["creep", "sensor_lag"])
def test_a_state_of_any_length_is_declared(block_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    known = BLOCKS[block_id]
    monkeypatch.setitem(BLOCKS, block_id, replace(known, state_of_any_length=not known.state_of_any_length))
    with pytest.raises(ValueError, match=f"{block_id}: found a block that .*expected both or neither"):
        uncut_run.__wrapped__(block_id)


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(1e-3, 0.1), st.floats(0.05, 10.0), st.booleans())
def test_behind_jumps_of_any_size_coarse_sub_steps_miss_little(seed: int, tau_s: float, size_V: float, rings: bool):
    rng = np.random.default_rng(seed)
    volts = np.clip(np.cumsum(rng.normal(scale=size_V, size=200)), 0.0, 50.0)
    volts[100:150] = 50.0
    drive = Drive.of_rows(np.cumsum(rng.uniform(0.005, 0.02, 200)), volts)
    beam = load_model("beam")
    model = replace(beam, blocks=tuple(x for x in beam.blocks if rings or x.id != "bending_modes"))
    model = model.with_block("source_resistance", time_constant_s=tau_s).with_block("sensor_lag", time_constant_s=0.01)
    fine = Simulator(drive).run(model).reading_um
    for coarser, allowed in ((3.0, 1e-4), (8.0, 1e-3)):
        coarse = Simulator(drive, coarser=coarser).run(model).reading_um
        assert coarse == pytest.approx(fine, abs=allowed * float(np.ptp(fine)))


@pytest.mark.slow
def test_where_a_command_stands_for_long_coarse_sub_steps_are_few_and_true():
    """Also behind a spring that stiffens, which bounds them, and before a sensor through which ringing would show."""
    time_s = np.concatenate([[-60.0], np.arange(400) / 2000.0])
    volts = np.concatenate([[40.0], np.where(np.arange(400) % 40 < 20, 50.0, 10.0)])
    model = load_model("beam").with_block("stiffening", cubic_1_per_um2=1e-4)
    model = model.with_block("sensor_lag", time_constant_s=1e-3)
    drive = Drive(time_s[1:], time_s, volts)
    fine, coarse = Simulator(drive), Simulator(drive, coarser=3.0)
    expected = fine.run(model).reading_um
    assert coarse.run(model).reading_um == pytest.approx(expected, abs=1e-3 * float(np.ptp(expected)))
    assert coarse.simulated < 0.05 * fine.simulated


def test_small_jumps_cost_fewer_sub_steps_than_large_ones():
    time_s = np.arange(500) / 100.0
    beam = load_model("beam")
    model = replace(beam, blocks=tuple(x for x in beam.blocks if x.id != "bending_modes"))
    model = model.with_block("source_resistance", time_constant_s=0.01)
    cost = []
    for step_V in (0.1, 25.0):
        volts = np.where(np.arange(500) % 2, 25.0, 25.0 + step_V)
        volts[:2] = 50.0, 0.0
        simulator = Simulator(Drive.of_rows(time_s, volts), coarser=3.0)
        simulator.run(model)
        cost.append(simulator.simulated - RUN_SUBSTEPS)
    assert cost[0] < 0.5 * cost[1]


def test_an_equation_keeps_its_sub_steps_where_a_command_stands_for_long():
    time_s = np.arange(60) / 30.0
    drive = Drive(time_s, np.concatenate([[-300.0], time_s]), np.concatenate([[40.0], np.linspace(40.0, 0.0, 60)]))
    fine = Simulator(drive).run(PAPER).reading_um
    assert Simulator(drive, coarser=8.0).run(PAPER).reading_um == pytest.approx(fine, abs=1e-3 * float(np.ptp(fine)))


BEAM = load_model("beam")
TIME_S = np.arange(300) / 30.0


@settings(max_examples=20)
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


@settings(max_examples=20)
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
def test_a_smooth_voltage_is_nearer_than_straight_lines_and_by_parabolas_nearer_still(
    part_of_rate: float, delay_s: float
):
    """All against the closed form of a lag behind a sine."""
    rate_Hz, tau_s = 600.0, 2e-3
    omega = 2.0 * np.pi * part_of_rate * rate_Hz
    time_s = np.arange(600) / rate_Hz
    static = replace(BEAM, blocks=tuple(x for x in BEAM.blocks if x.id != "bending_modes"))
    model = static.with_block("source_resistance", time_constant_s=tau_s)
    if delay_s:
        model = model.with_block("transport_delay", delay_s=delay_s)
    gain = Simulator(Drive.of_rows(TIME_S, np.full(300, 50.0))).run(model).reading_um[-1] / 50.0
    settled = 20.0 / np.hypot(1.0, omega * tau_s) * np.sin(omega * (time_s - delay_s) - np.arctan(omega * tau_s))

    def off(smooth: bool, coarser: float) -> float:
        drive = Drive(time_s, time_s, 20.0 * np.sin(omega * time_s), linear=True, smooth=smooth)
        read = Simulator(drive, coarser=coarser).run(model).reading_um
        return float(np.abs(read - gain * settled)[100:-60].max())

    assert off(True, 1.0) < 0.2 * off(False, 1.0)
    assert off(True, 3.0) < 0.6 * off(True, 1.0)


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


@settings(max_examples=12)
@example(1, 1e-7, False)
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


@pytest.mark.parametrize("hold", few(["hold", "smooth"], 0))
def test_an_fmu_reads_what_the_simulation_reads(hold: str, tmp_path):
    volts = np.random.default_rng(2).uniform(10.0, 40.0, 60)
    smooth = hold == "smooth"
    drive = Drive(TIME_S[:60], TIME_S[:60] + 0.004, volts, smooth, smooth, 0.015)
    record, read = playable(drive)
    model = BEAM.with_block("source_resistance", time_constant_s=0.03)
    (readings,) = driven(build_plant_fmu(model, tmp_path / "plant.fmu"), [record], smooth)
    assert read.readings(readings) == pytest.approx(Simulator(drive).run(model).reading_um, abs=2e-3)


@given(st.floats(0.01, 5.0), st.floats(0.0, 6.3))
def test_the_mean_of_a_ringing_is_that_of_the_integral(periods: float, phase: float):
    # ratios of damping of half a percent are read off swings that an exposure of 15 ms takes nearly all of
    exposure_s, time_s = 0.015, np.array([0.1])
    omega = 2.0 * np.pi * periods / exposure_s
    read = exposed(time_s, exposure_s)
    mean = read.readings(np.sin(omega * (read.instants_s - 0.1) + phase))
    assert mean == pytest.approx(np.sin(phase) * np.sinc(periods), abs=1e-12)


MODES = BLOCKS["bending_modes"]


def beam() -> CompositeBeam:
    """The beam of the paper."""
    assert PAPER.beam is not None
    return PAPER.beam


def modes_of(model: Model) -> tuple[tuple[float, ...], ...]:
    """The constants of a model's modes."""
    parameters = next(p for block, p in effective_settings(model) if block is MODES)
    return MODES.constants(parameters, beam())


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 3),
    zeta=st.floats(1e-6, 0.95),
    factor=st.floats(1e-3, 1e3),
    different=st.integers(1, 1000),
)
def test_a_run_of_their_own_equals_the_one_of_any_modes(
    seed: int, count: int, zeta: float, factor: float, different: int
) -> None:
    rng = np.random.default_rng(seed)
    shares = "beam" if count > 1 else "unity"
    parameters = MODES.parameters(count=count, shares=shares, damping_ratio=zeta, frequency_factor=factor)
    constants = MODES.constants(parameters, beam())
    state = rng.normal(size=2 * count + 1)
    # lengths that return, and with many different ones places of the table that are taken by another
    lengths_s = 10.0 ** rng.uniform(-9.0, 0.0, different)
    h = rng.choice(lengths_s, 600)
    w0, wm, w1 = rng.normal(size=(3, h.size))
    ours = linear_modes_run()(state, tuple(mode[:3] for mode in constants), (0.0, 0.0, 0.0), h, w0, wm, w1)
    theirs = uncut_run("bending_modes")(state, constants, np.cumsum(h), h, w0, wm, w1, w0, wm, w1)
    for mine, other in zip(ours, theirs, strict=True):
        scale = 1.0 + np.max(np.abs(other))
        assert np.max(np.abs(mine - other)) <= 1e-12 * scale


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 3),
    cubic=st.sampled_from([0.0, 0.3, -0.002]),
    bend=st.floats(-0.5, 0.5),
    quadratic=st.floats(-0.02, 0.02),
)
def test_a_spring_on_the_first_of_them_gives_the_same_numbers(
    seed: int, count: int, cubic: float, bend: float, quadratic: float
) -> None:
    rng = np.random.default_rng(seed)
    parameters = MODES.parameters(count=count, shares="beam" if count > 1 else "unity", cubic_1_per_um2=cubic)
    parameters = parameters.loaded(bending_1_per_um2=bend, quadratic_1_per_um=quadratic)
    constants = MODES.constants(parameters, beam())
    h = rng.choice([1e-4, 3e-4, 7e-4], 600)
    w0, wm, w1 = rng.normal(size=(3, h.size))
    state = np.zeros(2 * count + 1)
    spring = spring_alone(constants)
    assert spring == (cubic, bend, quadratic)
    ours = linear_modes_run()(state, tuple(mode[:3] for mode in constants), spring, h, w0, wm, w1)
    theirs = uncut_run("bending_modes")(state, constants, np.cumsum(h), h, w0, wm, w1, w0, wm, w1)
    # a spring that softens may run away, and whatever rounding there was with it
    assume(np.max(np.abs(theirs[:3])) < 100.0)
    for mine, other in zip(ours, theirs, strict=True):
        assert np.max(np.abs(mine - other)) <= 1e-11 * (1.0 + np.max(np.abs(other)))


def test_any_other_load_takes_the_run_of_any_modes() -> None:
    loads = {
        "coulomb_friction": {"level_um": 0.1},
        "quadratic_drag": {"drag_1_per_um": 0.1},
        "hysteretic_spring": {"share": 0.1},
    }
    for block_id, parameters in loads.items():
        model = PAPER.with_block(block_id, **parameters)
        assert spring_alone(modes_of(model)) is None, block_id
    assert spring_alone(modes_of(PAPER)) == (0.0, 0.0, 0.0)
    stiff = PAPER.with_block("stiffening", cubic_1_per_um2=1e-4)
    assert spring_alone(modes_of(stiff)) == (1e-4, 0.0, 0.0)


@pytest.mark.parametrize(("cubic", "bend"), [(1e-3, 0.0), (3e-3, 1e-2), (5e-4, -5e-3)])
def test_ever_shorter_sub_steps_come_to_one_motion_at_any_stiffness(cubic: float, bend: float) -> None:
    """Halving them takes the error to a sixth at most: more than the third order, though the level may jump."""
    omega, volts = 2600.0, np.random.default_rng(3).uniform(0.0, 20.0, 40).repeat(90)

    def ends(pieces: int) -> np.ndarray:
        h = np.full(volts.size * pieces, 0.12 / omega / pieces)
        w = volts.repeat(pieces)
        found = linear_modes_run()((0.0, 0.0, 0.0), ((omega, 0.02, 1.0),), (cubic, bend, 0.0), h, w, w, w)
        return found[2][pieces - 1 :: pieces]

    finest = ends(16)
    coarse, fine = (float(np.sqrt(np.mean((ends(x) - finest) ** 2))) for x in (1, 2))
    assert coarse < 1e-4
    assert fine < coarse / 6.0
