"""A fit that ends at a bound where the number says nothing found no such effect."""

import math

from hypothesis import given
from hypothesis import strategies as st

from bender_discrepancy.effects.catalogue import forms
from bender_discrepancy.effects.effect import Sizes
from bender_discrepancy.effects.form import Free
from bender_plant.kernels.bouc_wen import along
from bender_plant.model import load_model

OTHER_DEVICE = Sizes(10.0, 5.0, 600.0, 0.5, piezo_bender=False, highest_Hz=10.0)


@given(
    st.floats(1e-3, 1.0), st.floats(2.0, 1e3), st.floats(0.0, 1.0), st.sampled_from(["", "low", "high", "both"])
)  # fmt: skip
def test_only_the_ends_that_say_nothing_are_no_answer(low, high, place, ends):
    free = Free("tau_s", low, high, True, (), no_answer_at=ends)
    assert free.ends_without_answer(low) == (ends in ("low", "both"))
    assert free.ends_without_answer(high) == (ends in ("high", "both"))
    inside = math.exp(math.log(1.05 * low) + place * math.log(high / (1.05 * low) / 1.05))
    assert not free.ends_without_answer(inside)


def test_a_mode_that_does_not_ring_or_for_ever_and_a_leak_within_a_row_are_no_answers():
    found = {(form.effect, free.name): free for form in forms(OTHER_DEVICE) for free in form.free}
    damping, leak = found["second_mode", "damping_ratio"], found["charge_leakage", "time_constant_s"]
    assert damping.ends_without_answer(damping.high)
    assert damping.ends_without_answer(damping.low)
    frequency = found["second_mode", "frequency_Hz"]
    assert frequency.ends_without_answer(frequency.low)
    assert frequency.ends_without_answer(frequency.high)
    assert leak.ends_without_answer(leak.low)
    assert not damping.ends_without_answer(0.5)
    assert leak.high > OTHER_DEVICE.duration_s


LOOPS = [form for form in forms(OTHER_DEVICE) if form.name in ("Bouc-Wen", "Bouc-Wen beside a curve")]


@given(st.sampled_from(LOOPS), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_loop_saturates_within_the_voltages_that_showed_it(form, knee, share):
    """Whatever its numbers are, beyond the span it is at most 1 / (1 - 1/e) of what it is at its end."""
    _, *free = form.free[:3]
    ends = [(x.inward(x.low), x.inward(x.high)) for x in free]
    values = [x.outward(a + p * (b - a)) for x, (a, b), p in zip(free, ends, (knee, share), strict=True)]
    numbers = form.apply(load_model("beam"), (1.0, *values, *(0.0 for _ in form.free[3:]))).values()
    loop = [numbers[f"{form.effect}.{x}"] for x in ("alpha", "beta", "gamma")] + [1.0]
    span_V = OTHER_DEVICE.span_V
    assert along(0.0, 100.0 * span_V, *loop) <= 1.6 * along(0.0, span_V, *loop)


def test_a_loop_that_is_lost_where_the_voltage_turns_is_no_answer():
    for form in LOOPS:
        (share,) = (x for x in form.free if x.name == "gamma_over_beta")
        assert share.ends_without_answer(share.low)
        assert not share.ends_without_answer(share.high)


def test_what_comes_back_once_in_the_record_is_no_periodic_disturbance():
    """A swing as long as the record is any slow curve."""
    (frequency,) = [
        x
        for form in forms(OTHER_DEVICE)
        for x in form.free
        if form.effect == "periodic_disturbance" and x.name == "frequency_Hz"
    ]
    once_Hz = 1.0 / OTHER_DEVICE.duration_s
    assert frequency.ends_without_answer(once_Hz)
    assert not frequency.ends_without_answer(1.5 * once_Hz)
    assert not frequency.ends_without_answer(frequency.high)


def test_lags_of_another_device_reach_as_far_as_its_record():
    found = {form.effect: form.free[0] for form in forms(OTHER_DEVICE) if form.effect in ("sensor_lag", "creep")}
    day = Sizes(10.0, 5.0, 86_400.0, 0.5, piezo_bender=False, highest_Hz=0.1)
    slow = {form.effect: form.free[0] for form in forms(day) if form.effect == "sensor_lag"}
    assert slow["sensor_lag"].high > 100.0 * found["sensor_lag"].high
    assert slow["sensor_lag"].high > 0.3 * 86_400.0
