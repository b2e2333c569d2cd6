import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_hil.runner.voltages import Voltages
from bender_inference.records.checks import read_model
from bender_investigate import excitation
from bender_investigate.safety import Allowed, of_rows, refusal, rows_of

CAMERA = Allowed(0.0, 50.0, 250.0, 0.05, (-10.0, 45.0), 30.0)
FAST = Allowed(0.0, 50.0, 200_000.0, 0.05, (-60.0, 120.0), 4000.0)


def test_rows_and_profile_are_the_same_thing():
    levels = np.array([0.0, 0.0, 3.0, 3.0, 1.0, 0.0])
    _, again = rows_of(of_rows(levels, 30.0), 30.0)
    np.testing.assert_array_equal(again, levels)


@settings(max_examples=25, deadline=None)
@given(
    top_V=st.floats(1.0, 50.0),
    small_V=st.floats(0.01, 5.0),
    duration_s=st.floats(8.0, 120.0),
    slew=st.floats(20.0, 1e5),
    rate_Hz=st.sampled_from([15.0, 30.0, 120.0]),
    seed=st.integers(0, 1000),
)
def test_no_excitation_leaves_what_the_bench_allows(top_V, small_V, duration_s, slew, rate_Hz, seed):
    allowed = Allowed(0.0, 50.0, slew, 0.05, (-1e4, 1e4), rate_Hz)
    rng = np.random.default_rng(seed)
    for profile in (
        excitation.rest_and_probe(allowed),
        excitation.first_excitation(allowed, top_V, small_V, duration_s, rng),
        excitation.another_excitation(allowed, top_V, duration_s, rng),
        excitation.up_and_down(allowed, top_V),
    ):
        assert refusal(profile, allowed, []) is None
        _, levels_V = rows_of(profile, rate_Hz)
        assert abs(levels_V[0]) <= allowed.change_V
        assert abs(levels_V[-1]) <= allowed.change_V
    profile = excitation.first_excitation(allowed, top_V, small_V, duration_s, rng)
    assert max(profile.levels_V) <= top_V
    # the way down by the slew comes after it
    assert profile.duration_s <= duration_s + 2.0 + top_V / allowed.profile_slew_V_per_s


def test_a_fast_sensor_gets_a_sweep_through_the_resonance():
    profile = excitation.first_excitation(FAST, 40.0, 1.0, 110.0, np.random.default_rng(1))
    assert profile.duration_s < 6.0
    _, levels_V = rows_of(profile, FAST.rate_Hz)
    spectrum = np.abs(np.fft.rfft(levels_V - levels_V.mean()))
    frequency_Hz = np.fft.rfftfreq(levels_V.size, FAST.step_s)
    around = spectrum[(frequency_Hz > 90.0) & (frequency_Hz < 120.0)]
    assert around.max() > 20.0


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        ((0.0, 60.0, 0.0), "it commands 0 to 60 V, allowed are 0 to 50 V"),
        ((0.0, -1.0, 0.0), "it commands -1 to 0 V"),
        ((0.0, 40.0, 0.0), "it changes by 40 V from row to row, allowed are 7.5 V"),
    ],
)
def test_a_profile_beyond_voltage_or_slew_is_refused(levels, said):
    profile = Voltages((0.0, 1.0, 2.0), levels, 3.0)
    reason = refusal(profile, CAMERA, [read_model("paper")])
    assert reason is not None
    assert reason.startswith(said)


def test_a_profile_under_which_one_rival_leaves_the_travel_is_refused():
    allowed = Allowed(0.0, 50.0, 250.0, 0.05, (-10.0, 45.0), 30.0)
    model = read_model("bench")
    twice = model.with_block("calibration", gain=2.5)
    ramp = np.concatenate([np.arange(0.0, 45.0, 5.0), np.full(60, 45.0), np.arange(45.0, -1.0, -5.0)])
    profile = of_rows(ramp, 30.0)
    assert refusal(profile, allowed, [model]) is None
    reason = refusal(profile, allowed, [model, twice])
    assert reason is not None
    assert "the tip goes from" in reason
    assert "allows -9 to 40.5 µm" in reason
