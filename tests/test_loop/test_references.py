"""References: closed forms, corners, bounds, and `value` = `sample` for each of them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control.references import (
    Profile,
    Sine,
    Step,
    read_profile,
)
from bender_loop.errors import InputError

EVERY = [
    Step(10.0, 0.5, 2.0),
    Sine(4.0, 1.5, 6.0, 0.3),
    Profile((0.0, 0.7, 1.1), (1.0, 2.0, 3.0)),
]


@pytest.mark.parametrize("reference", EVERY, ids=lambda reference: type(reference).__name__)
@given(times=st.lists(st.floats(-1.0, 5.0), min_size=1, max_size=20))
def test_value_is_sample(reference, times):
    sampled = reference.sample(times)
    assert sampled.shape == (len(times),)
    assert [reference.value(time_s) for time_s in times] == pytest.approx(sampled.tolist(), abs=1e-12)


def test_a_step_is_taken_where_rounding_puts_its_time():
    assert [Step(10.0, 0.3, 1.0).value(t) for t in (0.0, 0.29, 0.1 + 0.2, 9.0)] == [1.0, 1.0, 10.0, 10.0]


def test_profile_holds():
    profile = Profile((0.0, 0.5, 2.0), (1.0, 2.0, 3.0))
    assert [profile.value(t) for t in (-1.0, 0.0, 0.49, 0.5, 1.99, 2.0, 99.0)] == [1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]


def test_sine_by_hand():
    sine = Sine(2.0, 0.25, 5.0, math.pi / 2)
    assert [sine.value(t) for t in (0.0, 1.0, 2.0)] == pytest.approx([7.0, 5.0, 3.0])
    assert Sine(2.0, 0.25).value(1.0) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Step(math.nan), "level_um must be finite, found nan"),
        (lambda: Sine(1.0, -1.0), "frequency_Hz must be > 0, found -1.0"),
        (lambda: Profile((0.0, 0.0), (1.0, 2.0)), "times_s must increase strictly"),
        (lambda: Profile((), ()), "must be of one length > 0"),
    ],
)
def test_bad_settings(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_profile_from_a_file(tmp_path):
    path = tmp_path / "profile.csv"
    path.write_text("time_s,setpoint_um,remark\n0,0,start\n1.5,10,up\n")
    assert read_profile(path) == Profile((0.0, 1.5), (0.0, 10.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,setpoint_um\n", "must be of one length > 0"),
        ("time_s,level\n0,0\n", "line 1, column setpoint_um: no such column"),
        ("time_s,setpoint_um\n0,nan\n", "line 2, column setpoint_um: found nan, expected a finite number"),
        ("time_s,setpoint_um\n0,\n", "line 2, column setpoint_um: found '', expected a number"),
        ("time_s,setpoint_um\n0,0\n0,1\n", "line 3, column time_s: found 0.0, expected more than 0.0"),
    ],
)
def test_bad_profiles(tmp_path, text, message):
    path = tmp_path / "profile.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_profile(path)
