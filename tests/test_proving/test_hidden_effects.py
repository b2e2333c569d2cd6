"""The table of hidden effects: what each does when it is nothing, and that it shows when it is something."""

import numpy as np
import pytest
from few import few_rows
from bender_proving import (
    INSIDE,
    NOISE_UM,
    OUTSIDE,
    Bench,
    Effect,
    Hidden,
    make_case,
    strength,
)
from bender_proving.chain import Commands, readings_um
from bender_proving.cases.effects import effect
from bender_proving.records.excitation import RATE_HZ
from bender_proving.cases.hidden import Sensor, Setting
from bender_proving.cases.residual import left_over_um
from bender_proving.physics.supply import shift_commands
from hypothesis import given, settings
from hypothesis import strategies as st

CONTRACT_IDS = {
    "transport_delay", "slew_limit", "supply_fall_lag", "source_resistance", "supply_quantisation", "dead_zone",
    "rate_independent_hysteresis", "creep", "charge_leakage", "saturation", "electrostriction", "second_mode",
    "tip_mass", "structural_damping", "stiffening", "backlash", "thermal_drift", "periodic_disturbance", "ageing",
    "sensor_lag", "sensor_quantisation", "lens_distortion",
}  # fmt: skip
EVERYWHERE = [(name, sensor) for name, entry in (INSIDE | OUTSIDE).items() for sensor in entry.ranges]
NEUTRAL: dict[str, dict[str, float]] = {
    "transport_delay": {"command_s": 0.0, "reading_s": 0.0},
    "dead_zone": {"half_width_V": 0.0, "shoulder_V": 0.0},
    "charge_leakage": {"fraction": 0.0, "tau_s": 3.0},
    "electrostriction": {"c_um_per_V2": 0.0, "bend_per_V2": 0.0},
    "rate_independent_hysteresis": {"limit_V": 5.0, "power": 1.0, "scale_um": 0.0, "chord_um_per_V": 0.0},
    "creep": {"growth": 0.0, "exponent": 0.1},
    "tip_mass": {"frequency_ratio": 1.0, "static_gain": 1.0},
    "second_mode": {"share": 0.0, "frequency_ratio": 1.0, "damping_ratio": 0.02},
    "thermal_drift": {"change_um": 0.0, "tau_s": 5.0, "span_s": 10.0},
    "periodic_disturbance": {"amplitude_um": 0.0, "frequency_Hz": 50.0, "phase_rad": 1.0, "overtone": 0.0},
    "ageing": {"faded": 0.0, "tau_s": 5.0, "span_s": 10.0},
    "lens_distortion": {"strength": 0.0, "centre_um": 0.0},
}
NEUTRAL_FORMS = {"rate_independent_hysteresis": "dahl"}


def answer(*hidden: Hidden) -> np.ndarray:
    """The readings of the nominal bench with what is hidden in it, to the same commands."""
    time_s = np.arange(60) / 30.0
    volts = np.random.default_rng(0).uniform(0.0, 50.0, 60)
    return readings_um(Commands(time_s, time_s, volts), hidden)


def test_every_effect_of_the_contract_has_two_forms_and_a_sensor():
    assert set(INSIDE) == CONTRACT_IDS
    assert all(len(entry.forms) >= 2 and entry.ranges for entry in INSIDE.values())
    assert len(OUTSIDE) >= 6
    assert not set(OUTSIDE) & set(INSIDE)


@pytest.mark.parametrize("name", NEUTRAL)
def test_nothing_of_an_effect_is_the_nominal_bench_to_the_bit(name: str):
    form = NEUTRAL_FORMS.get(name, INSIDE[name].forms[0])
    hidden = Hidden(name, form, 0.0, tuple(NEUTRAL[name].items()))
    np.testing.assert_array_equal(answer(hidden), answer())


@pytest.mark.parametrize(
    ("name", "form", "parameters"),
    [
        ("source_resistance", "lumped", {"tau_s": 1e-9, "second_tau_s": 0.0}),
        ("supply_fall_lag", "resistor", {"tau_s": 1e-9, "bleed_V": 0.0}),
        ("backlash", "one_gap", {"half_width_um": 0.0, "spread_um": 0.0}),
        ("structural_damping", "viscous", {"damping_ratio": 0.02, "drag_per_um": 0.0}),
        ("stiffening", "cubic", {"k3_per_um2": 0.0, "quintic_per_um2": 0.0}),
        ("supply_quantisation", "half_up", {"step_V": 1e-9}),
        ("saturation", "arctangent", {"scale_V": 1e9}),
    ],
)
def test_next_to_nothing_of_an_effect_is_next_to_the_nominal_bench(name: str, form: str, parameters: dict[str, float]):
    hidden = Hidden(name, form, 0.0, tuple(parameters.items()))
    np.testing.assert_allclose(answer(hidden), answer(), atol=1e-5, rtol=0)


@pytest.mark.parametrize(
    ("name", "form", "parameters", "small"),
    [
        ("source_resistance", "lumped", {"second_tau_s": 0.0}, "tau_s"),
        ("supply_fall_lag", "resistor", {"bleed_V": 0.0}, "tau_s"),
        ("sensor_lag", "one_pole", {"second_tau_s": 0.0}, "tau_s"),
        ("transport_delay", "command", {"reading_s": 0.0}, "command_s"),
    ],
)
def test_half_a_small_lag_leaves_half_the_residual(name: str, form: str, parameters: dict[str, float], small: str):
    whole, half = (
        answer(Hidden(name, form, 0.0, tuple((parameters | {small: value}).items()))) - answer()
        for value in (2e-5, 1e-5)
    )
    assert np.max(np.abs(whole)) > 0.01
    np.testing.assert_allclose(whole, 2.0 * half, atol=0.03 * float(np.max(np.abs(whole))))


def drawable(entry: Effect, form: str, magnitude: float, setting: Setting, seed: int) -> bool:
    try:
        return entry.hide(form, magnitude, setting, np.random.default_rng(seed)).magnitude == magnitude
    except ValueError:
        return False


@pytest.mark.parametrize("entry", list(INSIDE.values()), ids=list(INSIDE))
def test_covered_magnitudes_can_be_drawn_and_every_form_exists(entry: Effect):
    sensor = next(iter(entry.ranges))
    setting = Setting(sensor, RATE_HZ[sensor], 170.0)
    low, high = entry.ranges[sensor]
    hidden = [entry.hide(form, low, setting, np.random.default_rng(0)) for form in entry.forms]
    assert len({item.parameters for item in hidden} | {item.form for item in hidden}) > 1
    assert any(drawable(entry, form, high, setting, seed) for form in entry.forms for seed in range(5))
    with pytest.raises(ValueError, match="form of"):
        entry.hide("no such form", low, setting, np.random.default_rng(0))


@pytest.mark.parametrize(("name", "sensor"), few_rows(EVERYWHERE, *range(0, len(EVERYWHERE), 16)))
def test_what_is_hidden_shows_and_stays_in_its_range(name: str, sensor: Sensor):
    inside = name in INSIDE
    case = make_case("single" if inside else "outside", (name,), 4, sensor)
    low, high = effect(name).ranges[sensor]
    assert case.effect_ids == (name,)
    assert low <= abs(case.effects[0].magnitude) <= high
    assert strength(case) >= (3.0 if inside else 5.0) * (1 - 1e-9)


def test_both_of_a_pair_show_alone_and_beside_each_other():
    case = make_case("pair", ("lens_distortion", "transport_delay"), 2, "vibrometer")
    assert case.effect_ids == ("transport_delay", "lens_distortion")
    plan = Bench(case).excitation()
    floor_um = 3.0 * NOISE_UM["vibrometer"]
    both = readings_um(plan.commands, case.effects)
    for item in case.effects:
        alone = readings_um(plan.commands, (item,))
        assert left_over_um(alone, readings_um(plan.commands)) >= floor_um
        assert left_over_um(both, alone) >= floor_um


@settings(max_examples=20)
@given(step=st.floats(0.02, 10.0), volts=st.lists(st.floats(0.0, 50.0), min_size=3, max_size=10))
def test_quantised_commands_lie_on_the_lattice(step: float, volts: list[float]):
    for form in INSIDE["supply_quantisation"].forms:
        hidden = Hidden("supply_quantisation", form, step, (("step_V", step),))
        _, target = shift_commands(hidden, np.arange(len(volts), dtype=np.float64), np.array(volts))
        assert np.max(np.abs(target - volts)) <= step / 2 * (1 + 1e-9)
        np.testing.assert_allclose(target / step, np.rint(target / step), atol=1e-9)
