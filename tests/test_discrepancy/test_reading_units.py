"""A gain of the reading moved into the transduction: the same readings, sizes in the unit of the reading."""

import math
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES
from plant_runs import run_plant

from bender_discrepancy.conclusion.measurement.reading_units import (
    gain_of_the_device,
    in_reading_units,
    length_power,
)
from bender_discrepancy.conclusion.numbers import MovedGain
from bender_discrepancy.workflow import diagnose
from bender_loop.records.record import Record
from bender_plant.blocks import BLOCKS, calibration
from bender_plant.model import BlockSettings, Model, load_model
from bender_report.number import Number

VOLTS_V = np.array([0.0, 8.0, 30.0, 30.0, -12.0, 5.0, 50.0, 20.0, -30.0, 0.0])
STEP_S = 0.02
DEVICE = Model(
    "device",
    None,
    (
        BlockSettings("linear_transduction", BLOCKS["linear_transduction"].parameters(sensitivity_um_per_V=0.6)),
        BlockSettings("bending_modes", BLOCKS["bending_modes"].parameters(first_frequency_Hz=11.0, damping_ratio=0.1)),
    ),
)
ORDER = list(BLOCKS)
BEFORE_THE_GAIN = [
    pytest.param(block_id, parameters, id=f"{block_id} {k}")
    for k, (block_id, parameters) in enumerate(EXAMPLES)
    if ORDER.index(block_id) < ORDER.index(calibration.ID)
    and not BLOCKS[block_id].transducer
    and block_id not in ("bending_modes", "residual_equation")
]


@pytest.mark.parametrize(
    ("unit", "power"), [("um", 1), ("1/um2", -2), ("um/V3", 1), ("1/(um.s)", -1), ("V", 0), ("1", 0)]
)
def test_a_unit_tells_how_a_number_grows_with_lengths(unit: str, power: int) -> None:
    assert length_power(unit) == power


@pytest.mark.parametrize(("block_id", "parameters"), BEFORE_THE_GAIN)
@pytest.mark.parametrize("gain", [0.3, 40.0])
def test_the_readings_stay_what_they_were(block_id: str, parameters: dict[str, Any], gain: float) -> None:
    model = DEVICE.with_block(block_id, **parameters).with_block("calibration", gain=-gain, offset_um=3.0)
    moved = in_reading_units(model, gain)
    assert moved.values()["calibration.gain"] == -1.0
    there, here = run_plant(model, VOLTS_V, STEP_S), run_plant(moved, VOLTS_V, STEP_S)
    np.testing.assert_allclose(here, there, rtol=0.0, atol=1e-5 * float(np.ptp(there)))


def test_a_ruler_is_not_the_device() -> None:
    assert gain_of_the_device(load_model("beam"), 1.4) == 1.0
    assert gain_of_the_device(DEVICE.with_block("calibration", gain=2.0), 1.4) == 1.0
    assert gain_of_the_device(DEVICE, -1.4) == 1.4


@pytest.mark.parametrize(("unit", "power"), [("um", 1.0), ("1/um2", -2.0)])
def test_the_interval_counts_what_size_and_gain_take_from_one_another(unit: str, power: float) -> None:
    # the size is twice a coordinate; coordinate and gain stand in for one another
    shared = np.array([[4e-4, -3e-4], [-3e-4, 9e-4]])
    draws = np.random.default_rng(5).multivariate_normal([3.0, 1.5], shared, 400_000)
    expected = float(np.std(2.0 * draws[:, 0] * draws[:, 1] ** power))
    told = Number("size", 6.0, unit, 0.04, None, "", False, (5.92, 6.08))
    moved = MovedGain(1.5, 0.03, np.array([-3e-4])).moved(told, np.array([2.0]))
    assert moved.value == pytest.approx(6.0 * 1.5**power)
    assert moved.std == pytest.approx(expected, rel=0.02)
    assert moved.interval is not None
    assert moved.interval[1] - moved.interval[0] == pytest.approx(4.0 * moved.std)


@pytest.mark.parametrize(
    ("dry", "drag", "effect"),
    [
        (60.0, 0.0, "bearing_friction"),
        pytest.param(0.0, 0.004, "speed_drag", marks=pytest.mark.slow),
        pytest.param(60.0, 0.004, "bearing_friction", marks=pytest.mark.slow),
    ],
)
def test_what_brakes_a_motor_is_told_in_the_unit_of_its_speed_as_the_model_has_it(
    dry: float, drag: float, effect: str
) -> None:
    rng, step_s, parts = np.random.default_rng(4), 0.02, 40
    volts = np.repeat(rng.uniform(-6.0, 6.0, 75), 12)
    read, speed = [], 0.0
    for u in volts:
        read.append(speed)
        for _ in range(parts):
            pull, h = 150.0 * u - speed * (1.0 + drag * abs(speed)), step_s / parts
            before = speed
            speed += h * (pull - math.copysign(dry, speed or pull)) / 0.12
            # within one small step of rest nothing turns that the drive does not turn
            if dry and (before * speed < 0.0 or before == 0.0) and abs(150.0 * u) <= dry:
                speed = 0.0
    readings = np.array(read) + rng.normal(0.0, 1.0, volts.size)
    found = diagnose(None, [Record(step_s * np.arange(volts.size, dtype=np.float64), volts, readings)])
    assert [x.id for x in found.findings.effects] == [effect]
    numbers = {x.name: x for x in found.findings.effects[0].numbers}
    for name, true in {"friction_um": dry, "drag_1_per_um": drag}.items():
        if true:
            low, high = numbers[name].interval or (0.0, 0.0)
            assert 0.98 * low < true < 1.02 * high
    values = found.findings.model.values()
    assert values["calibration.gain"] == 1.0
    transducer = next(x.parameters for x in found.findings.model.blocks if x.id == "linear_transduction")
    assert transducer.gain_factor * transducer.sensitivity_um_per_V == pytest.approx(150.0, rel=0.01)
    for name, number in numbers.items():
        spoken = name.removesuffix("_1_per_um").removesuffix("_um").removesuffix("_s")
        assert number.value == pytest.approx(values[f"{effect}.{spoken}"])


@pytest.mark.slow
def test_the_friction_of_an_axis_is_told_from_its_place() -> None:
    """An axis on dry friction with a weight on it, in a loop of its own: mm, and V of its drive."""
    rng, step_s, parts, tau_s, dry, weight = np.random.default_rng(5), 0.01, 20, 0.25, 60.0, -12.0
    aims = np.repeat(rng.uniform(-80.0, 80.0, 20), 60)
    volts, read, place, speed = [], [], 0.0, 0.0
    for aim in aims:
        volts.append(float(np.clip(0.12 * (aim - place), -6.0, 6.0)))
        read.append(place)
        for _ in range(parts):
            pull, h, before = 100.0 * volts[-1] + weight, step_s / parts, speed
            speed += h * (pull - speed - math.copysign(dry, speed or pull)) / tau_s
            if (before * speed < 0.0 or before == 0.0) and abs(pull) <= dry:
                speed = 0.0
            place += h * speed
    readings = np.array(read) + rng.normal(0.0, 0.02, aims.size)
    found = diagnose(None, [Record(step_s * np.arange(aims.size, dtype=np.float64), np.array(volts), readings)])
    assert [x.id for x in found.findings.effects] == ["bearing_friction"]
    numbers = {x.name: x.value for x in found.findings.effects[0].numbers}
    # speeds are counted by the way within the time constant
    assert numbers["friction_um"] == pytest.approx(dry * tau_s, rel=0.03)
    assert numbers["load_um"] == pytest.approx(weight * tau_s, rel=0.05)
    assert numbers["time_constant_s"] == pytest.approx(tau_s, rel=0.03)


def test_what_a_device_rests_at_is_a_stop_and_not_a_limit_of_its_reading() -> None:
    """A flap with a return spring, whose drive pushes on at either stop for as long as it likes."""
    rng, step_s, tau_s, per_V, high, low = np.random.default_rng(6), 0.02, 0.4, 12.0, 55.0, -30.0
    volts = np.repeat(rng.uniform(-9.0, 11.0, 40), 30)
    read, place, kept = [], 0.0, math.exp(-step_s / tau_s)
    for u in volts:
        read.append(place)
        # the drive is held: between the stops one exponential, and none comes off a stop within it
        place = min(max(per_V * u + (place - per_V * u) * kept, low), high)
    readings = np.array(read) + rng.normal(0.0, 0.3, volts.size)
    found = diagnose(None, [Record(step_s * np.arange(volts.size, dtype=np.float64), volts, readings)])
    assert [x.id for x in found.findings.effects] == ["output_limit"]
    numbers = {x.name: x.value for x in found.findings.effects[0].numbers}
    assert numbers["level_um"] == pytest.approx(high, rel=0.02)
    assert numbers["other_level_um"] == pytest.approx(-low, rel=0.02)
    assert numbers["time_constant_s"] == pytest.approx(tau_s, rel=0.03)
