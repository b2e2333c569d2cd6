"""Around anybody's FMU: what stands in for it, what is put before and behind it, how it is followed."""

from pathlib import Path

import numpy as np
import pytest
from few import few
from foreign_fmus import TAU_S, foreign_fmu, needs_compiler
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bender_discrepancy.foreign import corrected_fmu
from bender_discrepancy.foreign.container_stages import Original, stages_around
from bender_discrepancy.foreign.relaxation_model import fit_relaxation
from bender_discrepancy.foreign.space_mapping import extrapolate_values
from bender_effects.form import Form, Free
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.records.observations import observe
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record
from bender_plant.blocks import BLOCKS, bending_modes, learned_hysteresis
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


FREQUENCY_HZ, ZETA = 12.0, 0.05


def run(coefficients: tuple[float, ...], step_s: float, rest: float, rows: int = 400) -> tuple[Record, np.ndarray]:
    """Return levels of chance and what z' = a w + b u + d |w| + e w |w|, w = z + c u, and a mode behind it show."""
    a, b, c, d, e = coefficients
    rng = np.random.default_rng(5)
    volts = np.repeat(rng.uniform(0.0, 30.0, rows), rng.integers(1, 60, rows))[:rows]
    volts[0] = 0.0
    times = step_s * np.arange(rows, dtype=np.float64)
    omega = 2.0 * np.pi * FREQUENCY_HZ
    state, shown = np.zeros(3), [0.0]

    def rate(_: float, x: np.ndarray, u: float) -> list[float]:
        w = x[0] + c * u
        slow = a * w + b * u + d * abs(w) + e * w * abs(w)
        return [slow, x[2], omega * omega * (w - x[1]) - 2.0 * ZETA * omega * x[2]]

    for u in volts[:-1].tolist():
        state = solve_ivp(rate, (0.0, step_s), state, args=(u,), rtol=1e-9, atol=1e-9).y[:, -1]
        shown.append(float(state[1]))
    return Record(times, volts, np.zeros(rows)), np.array(shown) + rest


def guess() -> tuple[BlockSettings, ...]:
    """Return the blocks of a linear model whose mode is not quite that of the runs."""
    return (BlockSettings(bending_modes.ID, bending_modes.Parameters(first_frequency_Hz=11.0, damping_ratio=0.1)),)


def coefficients_of(model: Model) -> tuple[float, ...]:
    found = next(x.parameters for x in model.blocks if x.id == learned_hysteresis.ID)
    return learned_hysteresis.constants(found, None)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("coefficients", few([(-0.5, 1.6, 0.8, -0.2, -0.12), (-2.0, 3.0, -0.3, 0.0, -0.05)], 0))
def test_an_equation_is_found_again_from_runs_at_several_rates(coefficients: tuple[float, ...]) -> None:
    runs = [run(coefficients, 0.05, 3.0), run(coefficients, 0.005, 3.0)]
    found = fit_relaxation(runs, guess(), "hold")
    assert found is not None
    (a, b, c, d, e), (true_a, *others, true_d, true_e) = coefficients_of(found), coefficients
    # w hardly falls below 0 here: w and |w| act together
    assert (a + d, b, c, e) == pytest.approx((true_a + true_d, *others, true_e), rel=1e-3, abs=1e-3)
    modes = next(x.parameters for x in found.blocks if x.id == bending_modes.ID)
    assert isinstance(modes, bending_modes.Parameters)
    assert modes.first_frequency_Hz == pytest.approx(FREQUENCY_HZ, rel=1e-3)
    assert modes.damping_ratio == pytest.approx(ZETA, rel=1e-2)


def test_a_relaxation_without_a_mode_gets_none() -> None:
    rows = 300
    rng = np.random.default_rng(2)
    volts = np.repeat(rng.uniform(0.0, 30.0, rows), 20)[:rows]
    volts[0] = 0.0
    shown, w = [0.0], 0.0
    for u in volts[:-1].tolist():
        for _ in range(200):
            middle = w + 0.5 * 2.5e-4 * (1.5 * u - w - 0.1 * w * w)
            w += 2.5e-4 * (1.5 * u - middle - 0.1 * middle * middle)
        shown.append(w)
    record = Record(0.05 * np.arange(rows, dtype=np.float64), volts, np.zeros(rows))
    found = fit_relaxation([(record, np.array(shown))], guess(), "hold")
    assert found is not None
    assert bending_modes.ID not in {x.id for x in found.blocks}
    a, b, c, d, e = coefficients_of(found)
    # w never falls below 0 here: w and |w| act together
    assert (a + d, b, c, e) == pytest.approx((-1.0, 1.5, 0.0, -0.1), abs=2e-3)


WIDE = Hypothesis((Part(Form("any", "any", (Free("x", -100.0, 100.0, False, (0.0,), 1.0),), lambda m, _: m), (0.0,)),))


@given(
    st.floats(-50.0, 50.0),
    st.floats(-20.0, 20.0).filter(lambda x: abs(x) > 1e-2),
    st.floats(-0.9, 0.9).filter(lambda x: abs(x) > 1e-2),
)
def test_numbers_that_come_nearer_by_the_same_part_lead_to_their_limit(limit: float, off: float, part: float) -> None:
    first, second, third = ((limit + off * part**k,) for k in range(3))
    assert extrapolate_values(WIDE, first, second, third).values()[0] == pytest.approx(
        limit, abs=1e-6 * (1.0 + abs(limit))
    )


def test_where_they_lead_beyond_a_bound_the_bound_is_meant_and_at_rest_they_stay() -> None:
    assert extrapolate_values(WIDE, (0.0,), (60.0,), (119.0,)).values() == (100.0,)
    assert extrapolate_values(WIDE, (3.0,), (3.0,), (3.0,)).values() == (3.0,)
