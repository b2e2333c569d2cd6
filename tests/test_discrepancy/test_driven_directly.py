"""An FMU behind a delay and what is static gets their commands at the very instants from which these act."""

from pathlib import Path

import numpy as np
import pytest
from foreign_fmus import TAU_S, foreign_fmu, needs_compiler

from bender_discrepancy.foreign import corrected_fmu
from bender_discrepancy.foreign.container_stages import Original, stages_around
from bender_discrepancy.records.observations import observe
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record
from bender_plant.blocks import BLOCKS
from bender_plant.model import BlockSettings, Model

STEP_V, DEAD_V, DELAY_S, GAIN, OFFSET_um = 3.0, 2.0, 0.0137, 1.1, 0.4


def block(name: str, **values: float) -> BlockSettings:
    return BlockSettings(name, BLOCKS[name].parameters(**values))


STAND_IN = Model(
    "lag", None, (block("linear_transduction", sensitivity_um_per_V=1.0), block("plant_lag", time_constant_s=TAU_S))
)
AROUND = STAND_IN.with_block("calibration", gain=GAIN, offset_um=OFFSET_um)


def answer_um(row_s: np.ndarray, acts_s: np.ndarray, volts: np.ndarray) -> np.ndarray:
    """The lag of 1 µm/V in closed form from event to event."""
    events = np.union1d(row_s, acts_s)
    now, last, at = 0.0, float(events[0]), {}
    for event in events:
        acting = np.flatnonzero(acts_s < event - 1e-12)
        level = float(volts[acting[-1]]) if acting.size else 0.0
        keep = float(np.exp(-(event - last) / TAU_S))
        now, last = keep * now + (1.0 - keep) * level, float(event)
        at[float(event)] = now
    return np.array([at[float(x)] for x in row_s])


@needs_compiler
def test_a_delay_steps_and_a_dead_zone_before_an_fmu_and_a_gain_behind_it_in_closed_form(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    rows = 300
    row_s = 0.02 * np.arange(rows, dtype=np.float64)
    acts_s = row_s + rng.uniform(0.0, 0.019, rows)
    volts = np.repeat(rng.uniform(-30.0, 30.0, rows // 6), 6)
    record = Record(row_s, volts, np.zeros(rows), command_time_s=acts_s)
    path = foreign_fmu(tmp_path / "lag.fmu")
    with FmuPlant(path) as plant:
        original = Original(path, plant.input, plant.output, {}, plant.read())
    model = AROUND.with_block("supply_quantisation", step_V=STEP_V).with_block("dead_zone", threshold_V=DEAD_V)
    stages = stages_around(STAND_IN, model.with_block("transport_delay", delay_s=DELAY_S), original.rest_um)
    assert stages.only_delay
    found = corrected_fmu._driven_directly(stages, original, observe(record), record)  # pyright: ignore[reportPrivateUsage]
    stepped = STEP_V * np.rint(volts / STEP_V)
    acting = np.sign(stepped) * np.maximum(np.abs(stepped) - DEAD_V, 0.0)
    expected = GAIN * answer_um(row_s, acts_s + DELAY_S, acting) + OFFSET_um
    assert found == pytest.approx(expected, abs=1e-9)


@needs_compiler
@pytest.mark.parametrize("any_step", [True, False])
def test_an_fmu_that_takes_equal_steps_only_keeps_the_raster_of_its_container(tmp_path: Path, any_step: bool) -> None:
    path = foreign_fmu(tmp_path / "lag.fmu", any_step=any_step)
    with FmuPlant(path) as plant:
        original = Original(path, plant.input, plant.output, {}, 0.0)
    assert original.takes_any_step is any_step


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("source_resistance", {"time_constant_s": 0.1}),
        ("slew_limit", {"slew_rate_V_per_s": 50.0}),
        ("sensor_lag", {"time_constant_s": 0.1}),
        ("backlash", {"half_width_um": 0.5}),
    ],
)
def test_what_has_a_state_of_its_own_needs_the_container(effect: str, values: dict[str, float]) -> None:
    assert not stages_around(STAND_IN, STAND_IN.with_block(effect, **values), 0.0).only_delay


def test_what_changes_the_inside_of_the_fmu_needs_the_container() -> None:
    changed = STAND_IN.with_block("plant_lag", time_constant_s=2.0 * TAU_S)
    assert not stages_around(STAND_IN, changed, 0.0).only_delay
