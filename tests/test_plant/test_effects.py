"""Every effect: neutral is the identity, step halving, and an oracle that integrates the whole chain at once."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES, FILES, OWN_ORACLE
from few import few, few_rows
from plant_runs import run_plant
from scipy.integrate import solve_ivp

from bender_plant.blocks import BLOCKS
from bender_plant.kernels.draining_lag import DRAG, RADIATION, level_held, losing_step, loss
from bender_plant.model import load_model
from bender_plant.plant import effective_settings

PAPER = load_model("paper")
OMEGA = 2 * math.pi * 104.37328430533374

NAMES = [f"{block_id} {k}" for k, (block_id, _) in enumerate(EXAMPLES)]
STAIRS = np.array([20.0, 20.0, 45.0, 10.0, 10.0, 30.0, 0.0, 50.0, 5.0, 5.0, 5.0, 49.0])


def stairs_of(block_id: str) -> np.ndarray:
    """The voltages of an effect that needs others than most."""
    return getattr(FILES.get(block_id), "VOLTS_V", STAIRS)


def test_every_effect_is_among_the_examples() -> None:
    machinery = {"linear_transduction", "learned_hysteresis", "sparse_equation", "prandtl_ishlinskii", "bouc_wen"}
    assert {block_id for block_id, _ in EXAMPLES} == set(BLOCKS) - machinery - {"bending_modes", "calibration"}


@pytest.mark.parametrize("block_id", sorted({block_id for block_id, _ in EXAMPLES}))
def test_an_effect_is_neutral_as_it_comes(block_id: str) -> None:
    """But for a supply, which needs to be quick."""
    neutral = PAPER.with_block(block_id, **({"slew_rate_V_per_s": 1e9} if block_id == "slew_limit" else {}))
    assert np.allclose(run_plant(neutral, STAIRS, 0.03), run_plant(PAPER, STAIRS, 0.03), rtol=0, atol=1e-3)


@pytest.mark.parametrize("change_V", [1e-9, 1e-8, 2.6e-6, 4e-6, 6e-6, 1e-4])
def test_a_quick_supply_never_passes_a_command_that_is_close(change_V: float) -> None:
    # 738 V/s are 4.9 V in a step: the command is reached within a millionth of it
    supply = PAPER.with_block("slew_limit", slew_rate_V_per_s=738.0)
    held, rising = np.full(120, 20.0), np.concatenate((np.full(100, 20.0), 20.0 + change_V * np.arange(1, 21)))
    moved = run_plant(supply, rising, 1 / 150) - run_plant(supply, held, 1 / 150)
    assert np.max(np.abs(moved)) < 2.0 * 20.0 * change_V + 1e-9


@pytest.mark.parametrize(("block_id", "parameters"), few_rows(EXAMPLES, *range(0, len(EXAMPLES), 4)), ids=NAMES)
def test_every_effect_changes_the_reading(block_id: str, parameters: dict[str, Any]) -> None:
    changed = run_plant(PAPER.with_block(block_id, **parameters), stairs_of(block_id), 0.03)
    assert np.max(np.abs(changed - run_plant(PAPER, stairs_of(block_id), 0.03))) > 0.02


@pytest.mark.parametrize(("block_id", "parameters"), few_rows(EXAMPLES, *range(0, len(EXAMPLES), 4)), ids=NAMES)
@pytest.mark.parametrize("step_s", few([1 / 30, 0.25], 0))
def test_halving_the_step_changes_nothing(block_id: str, parameters: dict[str, Any], step_s: float) -> None:
    model = PAPER.with_block(block_id, **parameters)
    stairs = stairs_of(block_id)
    whole, halves = run_plant(model, stairs, step_s), run_plant(model, stairs, step_s, parts=2)
    if block_id == "sensor_quantisation":
        assert np.max(np.abs(whole - halves)) < 0.7 + 1e-9
    else:
        assert np.max(np.abs(whole - halves)) < (1e-2 if block_id == "backlash" else 1e-3)


def oracle(block_id: str, p: dict[str, Any], voltages: np.ndarray, step_s: float) -> np.ndarray:  # noqa: C901, PLR0915
    """The whole chain as one system of differential equations, each held command cut at the corners of the supply."""
    delay = p.get("delay_s", 0.0)
    taus = p.get("time_constants_s", ()) if block_id == "creep" else ()

    def effective(v: float, leak: float) -> float:
        if block_id == "dead_zone":
            return math.copysign(max(abs(v) - p["threshold_V"], 0.0), v)
        if block_id == "saturation":
            if p.get("form") == "knee":
                return v / (1.0 + (abs(v) / 30.0) ** 1.5) ** (0.7 / 1.5)
            return 60.0 * v / (60.0 + abs(v)) if p.get("form") else 30.0 * math.tanh(v / 30.0)
        return v - p["fraction"] * leak if block_id == "charge_leakage" else v

    def drive(x: np.ndarray) -> tuple[float, float, float]:
        v, leak, z = x[0], x[1], x[2]
        u = effective(v, leak)
        w30 = w = z + 0.818 * u
        if block_id == "electrostriction":
            bending = p.get("bending_1_per_V2", 0.0) * v * v
            w += p["coefficient_um_per_V2"] * v * v * (1.0 / (1.0 + bending) if bending > 0.0 else 1.0 - bending)
        for g, slow in zip(p.get("gains", ()), x[7:], strict=False):
            w += g * slow
        return u, w30, w

    def rates(t: float, x: np.ndarray, command: float) -> np.ndarray:
        u, w30, w = drive(x)
        q, rate, q2, rate2 = x[3:7]
        out = np.zeros_like(x)
        if block_id == "source_resistance" or (block_id == "supply_fall_lag" and command < x[0]):
            out[0] = (command - x[0]) / p["time_constant_s"]
        if block_id == "source_resistance" and "second_share" in p:
            out[7] = (command - x[7]) / p["time_constant_s"]
            out[0] = (x[7] - x[0]) / (p["second_share"] * p["time_constant_s"])
        if block_id == "slew_limit" and abs(command - x[0]) > 1e-6:
            out[0] = math.copysign(p["slew_rate_V_per_s"], command - x[0])
        if block_id == "charge_leakage":
            out[1] = (x[0] - x[1]) / p["time_constant_s"]
        out[2] = -0.48 * w30 + 1.652 * u - 0.22 * abs(w30) - 0.124 * w30 * abs(w30)
        omega = OMEGA * p.get("frequency_ratio", 1.0)
        zeta = p["damping_ratio"] if block_id == "structural_damping" else 0.02
        rest = p.get("preload_um", 0.0)
        cube = (q + rest) ** 3 - rest**3 - 3.0 * rest**2 * q
        bending = p.get("bending_1_per_um2", 0.0) * q * q
        cube *= 1.0 / (1.0 + bending) if bending > 0.0 else math.sqrt(1.0 - 2.0 * bending)
        force = q + p.get("cubic_1_per_um2", 0.0) * (cube if block_id == "stiffening" else 0.0)
        out[3:5] = rate, -2 * zeta * omega * rate - omega**2 * (force - w)
        if block_id == "second_mode":
            omega2 = 2 * math.pi * 654.1
            out[5:7] = rate2, -2 * 0.02 * omega2 * rate2 - omega2**2 * (q2 - w)
        if block_id == "sensor_lag":
            out[7] = (q - x[7]) / p["time_constant_s"]
            second_s = p.get("second_share", 0.0) * p["time_constant_s"]
            out[8] = (x[7] - x[8]) / second_s if second_s else out[7]
        out[7 : 7 + len(taus)] = [(w30 - slow) / tau for slow, tau in zip(x[7:], taus, strict=False)]
        return out

    x = np.zeros(9 if block_id in ("sensor_lag", "source_resistance") else 7 + len(taus))
    instants = np.concatenate([[0.0], step_s * np.arange(len(voltages)) + delay])
    values = np.concatenate([[0.0], voltages])
    readings = []
    for k in range(len(voltages)):
        begin, end = k * step_s, (k + 1) * step_s
        inside = [begin, *[t for t in instants[1:] if begin < t < end - 1e-12], end]
        for a, b in itertools.pairwise(inside):
            command = values[np.nonzero(instants <= a + 1e-9)[0][-1]]
            lagging = block_id in ("source_resistance", "slew_limit")
            if not lagging and not (block_id == "supply_fall_lag" and command < x[0]):
                x[0] = command
            parts = [a, b]
            if block_id == "slew_limit":
                arrival = a + abs(command - x[0]) / p["slew_rate_V_per_s"]
                parts = [a, arrival, b] if a < arrival < b else parts
            for c, d in itertools.pairwise(parts):
                options = {"rtol": 1e-10, "atol": 1e-10, "args": (command,)}
                x = solve_ivp(rates, (c, d), x, "DOP853", **options).y[:, -1]
                if len(parts) == 3:
                    x[0] = command
        y = x[3]
        if block_id == "second_mode":
            y += p["share"] * (x[5] - x[3])
        if block_id == "sensor_lag":
            y = x[8]
        readings.append(y)
    return np.array(readings)


CONTINUOUS = {
    "transport_delay", "slew_limit", "supply_fall_lag", "source_resistance", "dead_zone", "charge_leakage",
    "saturation", "electrostriction", "creep", "second_mode", "tip_mass", "structural_damping", "stiffening",
    "sensor_lag",
}  # fmt: skip


@pytest.mark.parametrize(
    ("block_id", "parameters"),
    few_rows([x for x in EXAMPLES if x[0] in CONTINUOUS], 12, 19),
    ids=[name for name in NAMES if name.split()[0] in CONTINUOUS],
)
def test_against_solve_ivp(block_id: str, parameters: dict[str, Any]) -> None:
    model = PAPER.with_block(block_id, **parameters)
    ours = run_plant(model, STAIRS, 1 / 30)
    assert np.max(np.abs(ours - oracle(block_id, parameters, STAIRS, 1 / 30))) < 1e-3


@pytest.mark.parametrize("step_s", [0.01, 1 / 30])
def test_the_paper_model_against_solve_ivp_along_a_chirp(step_s: float) -> None:
    time_s = step_s * np.arange(24)
    volts = 25.0 + 25.0 * np.sin(2 * math.pi * (0.5 * time_s + 20.0 * time_s**2))
    assert np.max(np.abs(run_plant(PAPER, volts, step_s) - oracle("none", {}, volts, step_s))) < 1e-3


@pytest.mark.parametrize("tau_s", few([0.0005, 0.02, 0.3], 0))
def test_the_bench_model_against_solve_ivp(tau_s: float) -> None:
    model = load_model("bench").with_values({"source_resistance.time_constant": tau_s})
    expected = oracle("source_resistance", {"time_constant_s": tau_s}, STAIRS, 1 / 30)
    assert np.max(np.abs(run_plant(model, STAIRS, 1 / 30) - expected)) < 1e-3


@pytest.mark.parametrize(
    ("block_id", "parameters"),
    OWN_ORACLE,
    ids=[f"{name} {k}" for k, (name, _) in enumerate(OWN_ORACLE)],
)
def test_against_the_oracle_of_its_own(block_id: str, parameters: dict[str, Any]) -> None:
    stairs = stairs_of(block_id)
    ours = run_plant(PAPER.with_block(block_id, **parameters), stairs, 1 / 30)
    expected = FILES[block_id].oracle(parameters, stairs, 1 / 30, run_plant(PAPER, stairs, 1 / 30))
    assert np.max(np.abs(ours - expected)) < 1e-3


def test_a_delay_shifts_the_reading() -> None:
    late = run_plant(PAPER.with_block("transport_delay", delay_s=0.09), np.repeat(STAIRS, 3), 0.03)
    assert np.max(np.abs(late[3:] - run_plant(PAPER, np.repeat(STAIRS, 3), 0.03)[:-3])) < 1e-6


SHOWN = {
    "thermal_drift": ({"amplitude_um": 5.0, "time_constant_s": 0.5}, lambda y, t: y + 5.0 * (1 - np.exp(-t / 0.5))),
    "periodic_disturbance": (
        {"sine_um": 3.0, "frequency_Hz": 7.0},
        lambda y, t: y + 3.0 * np.sin(2 * math.pi * 7.0 * t),
    ),
    "ageing": ({"loss": 0.5, "time_constant_s": 1.0}, lambda y, t: y * (1 - 0.5 * (1 - np.exp(-t)))),
    "lens_distortion": ({"quadratic_1_per_um": 0.01}, lambda y, t: y + 0.01 * y**2),
    "sensor_quantisation": ({"step_um": 0.7}, lambda y, t: 0.7 * np.round(y / 0.7)),
}


@pytest.mark.parametrize("block_id", SHOWN)
def test_surroundings_and_sensor_add_what_they_say(block_id: str) -> None:
    parameters, shown = SHOWN[block_id]
    found = run_plant(PAPER.with_block(block_id, **parameters), STAIRS, 0.05)
    t = 0.05 * np.arange(1, len(STAIRS) + 1)
    assert np.allclose(found, shown(run_plant(PAPER, STAIRS, 0.05), t), atol=2e-3)


@pytest.mark.parametrize("ratio", [0.6, 1.5])
def test_a_tip_mass_moves_the_first_resonance_and_nothing_at_rest(ratio: float) -> None:
    model = load_model("beam")
    heavy = model.with_block("tip_mass", frequency_ratio=ratio)
    before, after = (
        next(modes for block, modes in effective_settings(x) if block.id == "bending_modes") for x in (model, heavy)
    )
    assert after.frequency_factor == pytest.approx(ratio * before.frequency_factor)
    stand = np.full(40, 30.0)
    assert run_plant(heavy, stand, 0.25)[-1] == pytest.approx(run_plant(model, stand, 0.25)[-1], rel=1e-9)


@pytest.mark.parametrize("preload_um", [-3.0, 4.0])
def test_a_preloaded_spring_rests_where_its_force_and_the_drive_agree(preload_um: float) -> None:
    k = 2e-3
    model = load_model("beam").with_block("bending_modes", count=1, shares="unity", damping_ratio=0.2)
    stand = np.full(60, 8.0)
    w = float(run_plant(model, stand, 0.25)[-1])
    q = float(run_plant(model.with_block("stiffening", cubic_1_per_um2=k, preload_um=preload_um), stand, 0.25)[-1])
    assert q + k * (q**3 + 3.0 * preload_um * q**2) == pytest.approx(w, rel=1e-6)


def test_a_sine_has_so_many_sub_steps_in_every_period() -> None:
    block = BLOCKS["periodic_disturbance"]
    sines = [block.parameters(sine_um=1.0, frequency_Hz=x) for x in (3.0, 7.0)]
    bounds = [block.ringing_step_s(x, None) for x in sines]
    assert bounds[0] * 3.0 == pytest.approx(bounds[1] * 7.0)
    assert 20 < 1.0 / (7.0 * bounds[1]) < 100


def test_backlash_loses_twice_its_half_width_at_a_reversal() -> None:
    settled = run_plant(PAPER.with_block("backlash", half_width_um=1.0), np.repeat([50.0, 0.0], 400), 0.05)
    plain = run_plant(PAPER, np.repeat([50.0, 0.0], 400), 0.05)
    # the ringing after the step pushes the play to one side or the other, never further than its half-width
    assert abs(settled[399] - plain[399]) <= 1.0 + 1e-6
    assert abs(settled[-1] - plain[-1]) == pytest.approx(1.0, abs=1e-6)


def test_a_spring_that_gives_way_is_an_error_not_a_number() -> None:
    with pytest.raises(ArithmeticError, match="ran away"):
        run_plant(PAPER.with_block("stiffening", cubic_1_per_um2=-0.01), np.full(20, 50.0), 0.05)


def test_a_lagging_counter_averages_the_size_of_a_speed_not_the_speed() -> None:
    folded = load_model("beam").with_block("fold", share=1.0, centre_um=0.0, rounding_um=0.0)
    there_and_back = np.resize([20.0, -20.0], 60)
    plain = run_plant(folded, there_and_back, 0.01)
    lagging = run_plant(folded.with_block("sensor_lag", time_constant_s=0.1), there_and_back, 0.01)
    assert float(np.min(lagging[-20:])) > 0.5 * float(np.mean(plain[-20:])) > 1.0


@pytest.mark.parametrize(("law", "size"), [(RADIATION, 293.0), (RADIATION, 5.0), (DRAG, 0.01), (DRAG, 20.0)])
@pytest.mark.parametrize("power", [10.0, 1e4, 1e7])
def test_a_loss_that_steepens_never_leads_beyond_the_level_that_is_held(law: int, size: float, power: float) -> None:
    held, level = level_held(power, size, law), 0.0
    assert loss(held, size, law) == pytest.approx(power, rel=1e-9)
    for _ in range(400):
        middle, end = losing_step(level, 1.0, size, law, 0.05, power, power, power)
        assert level <= end <= held
        assert middle <= held
        level = end
    assert level == pytest.approx(held, rel=1e-6)
