"""The compiled chain equals the plain kernel on every block and effect, whatever the drive."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES
from few import few_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_compiled.kernels import uncut_run
from bender_compiled.simulation import RUN_SUBSTEPS, Bounds, Drive, Simulator
from bender_plant.blocks import BLOCKS, Block
from bender_plant.model import BlockSettings, Model, ModelError, load_model
from bender_plant.plant import Plant

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


@pytest.mark.parametrize("block_id", ["linear_transduction", "prandtl_ishlinskii", "bouc_wen"])
def test_every_transducer_equals_the_plain_kernel(block_id: str) -> None:
    bench = load_model("bench")
    others = tuple(x for x in bench.blocks if x.id != "learned_hysteresis")
    model = Model("test", bench.beam, (*others, BlockSettings(block_id, BLOCKS[block_id].parameters())))
    ours = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(model)
    assert np.max(np.abs(ours.reading_um - plain(model, TIME, VOLTAGE, TIME))) < 1e-7


@pytest.mark.parametrize("name", ["paper", "beam", "bench"])
def test_the_built_in_models_equal_the_plain_kernel(name: str) -> None:
    model = load_model(name)
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


def test_what_is_kept_changes_no_result() -> None:
    drive = Drive.of_rows(TIME, VOLTAGE)
    shared = Simulator(drive, bounds=Bounds(1e-3, 4e-3))
    for gain in (1.0, 0.5, 2.0, 1.0):
        for ratio in (1.0, 0.7):
            model = PAPER.with_block("calibration", gain=gain).with_block("tip_mass", frequency_ratio=ratio)
            alone = Simulator(drive, bounds=Bounds(1e-3, 4e-3)).run(model)
            assert np.array_equal(shared.run(model).reading_um, alone.reading_um)


def test_a_model_that_needs_too_many_sub_steps_is_refused() -> None:
    model = PAPER.with_block("source_resistance", time_constant_s=1e-7)
    bounded = Simulator(Drive.of_rows(TIME, VOLTAGE), most_substeps=900)
    assert np.all(np.isfinite(bounded.run(PAPER).reading_um))
    with pytest.raises(ModelError, match="sub-steps"):
        bounded.run(model)


def test_running_away_is_an_error() -> None:
    with pytest.raises(ArithmeticError, match="ran away"):
        Simulator(Drive.of_rows(TIME, VOLTAGE)).run(PAPER.with_block("stiffening", cubic_1_per_um2=-0.01))


def test_running_away_before_a_block_with_corners_is_an_error_too() -> None:
    """Numbers of any size, and none at all, are cut no further than sense allows."""
    model = (
        load_model("paper").with_block("stiffening", cubic_1_per_um2=-0.04).with_block("backlash", half_width_um=1.2)
    )
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


@settings(max_examples=25, deadline=None)
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
