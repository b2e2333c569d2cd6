"""Gains in every form, and the file of gains: what is written is read, what is wrong is named."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from bender_loop.control import pid
from bender_loop.control.pid import UNLIMITED, Gains, Limits, PidState
from bender_loop.errors import InputError
from bender_tuner.results.gains_file import read_bench_gains, read_gains, read_units, write_gains
from bender_tuner.rules.gain_forms import IsaForm, from_isa, to_discrete, to_isa

GAIN = st.floats(1e-3, 1e3)
TIME = st.floats(0.0, 1.0)


@given(kp=GAIN, ki=st.one_of(st.just(0.0), GAIN), kd=st.one_of(st.just(0.0), GAIN), tf=TIME, on_error=st.booleans())
def test_isa_and_back(kp: float, ki: float, kd: float, tf: float, on_error: bool) -> None:
    gains = Gains(kp, ki, kd, tf, on_error)
    form = to_isa(gains)
    assert form is not None
    back = from_isa(form, derivative_on_error=on_error)
    assert back.proportional_V_per_um == kp
    assert back.integral_V_per_um_s == pytest.approx(ki)
    assert back.derivative_V_s_per_um == pytest.approx(kd)
    assert (back.filter_time_s, back.derivative_on_error) == (tf, on_error)


def test_isa_by_hand() -> None:
    assert to_isa(Gains(2.0, 8.0, 0.5, 0.1)) == IsaForm(2.0, 0.25, 0.25, 0.1)
    assert to_isa(Gains(2.0, 0.0)) == IsaForm(2.0, math.inf, 0.0, 0.0)
    assert to_isa(Gains(0.0, 8.0)) is None, "pure integral action has none"


@pytest.mark.parametrize("values", [(0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (1.0, 1.0, math.nan, 0.0)])
def test_isa_settings_are_checked(values: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        IsaForm(*values)


@pytest.mark.parametrize("on_error", [False, True])
def test_discrete_form_is_the_block(on_error: bool) -> None:
    gains, period = Gains(0.3, 7.0, 0.02, 0.05, on_error), 1.0 / 30.0
    rng = np.random.default_rng(4)
    # both signals rest at 0 for one sample: the block's first derivative is zero, the filter's has to be too
    setpoint, measurement = (np.append(0.0, rng.normal(size=60)) for _ in range(2))
    form = to_discrete(gains, period)
    from_setpoint = lfilter(form.setpoint_V_per_um, form.denominator, setpoint)
    from_measurement = lfilter(form.measurement_V_per_um, form.denominator, measurement)
    state, commands = PidState(), []
    for r, y in zip(setpoint, measurement, strict=True):
        state, command = pid.step(gains, UNLIMITED, state, float(r), float(y), period)
        commands.append(command)
    assert np.asarray(from_setpoint) - np.asarray(from_measurement) == pytest.approx(np.array(commands), abs=1e-12)


def test_discrete_form_by_hand() -> None:
    form = to_discrete(Gains(1.0, 2.0, 0.5), 0.5)
    assert form.denominator == (1.0, -1.0, 0.0)
    assert form.setpoint_V_per_um == (2.0, -1.0, 0.0)
    assert form.measurement_V_per_um == (3.0, -3.0, 1.0)


def test_period_is_checked() -> None:
    with pytest.raises(ValueError, match="period_s"):
        to_discrete(Gains(1.0, 1.0), 0.0)


GAINS = Gains(0.25, 7.25, 0.0155, 2.0 / 30.0)
LIMITS = Limits(0.0, 50.0, 0.02)


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "gains.toml"
    write_gains(path, GAINS, LIMITS, 1.0 / 30.0)
    return path


@pytest.mark.parametrize("limits", [LIMITS, Limits(-math.inf, math.inf)])
@pytest.mark.parametrize("gains", [GAINS, Gains(0.0, 5.9), Gains(1.0, 0.0, 0.1, 0.0, True)])
def test_what_is_written_is_read(tmp_path: Path, gains: Gains, limits: Limits) -> None:
    path = tmp_path / "gains.toml"
    write_gains(path, gains, limits, 0.02)
    assert read_gains(path) == (gains, limits, 0.02)


def test_every_form_stands_in_the_file(written: Path) -> None:
    table = tomllib.loads(written.read_text(encoding="utf-8"))
    assert table["isa"]["integral_time_s"] == pytest.approx(0.25 / 7.25)
    assert table["isa"]["derivative_time_s"] == pytest.approx(0.0155 / 0.25)
    assert len(table["discrete"]["measurement_V_per_um"]) == 3


def test_pure_integral_action_is_written_without_isa(tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    write_gains(path, Gains(0.0, 5.9), LIMITS, 0.02)
    assert "isa" not in tomllib.loads(path.read_text(encoding="utf-8"))


def test_parallel_gains_alone_are_enough(tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    path.write_text("sampling_period_s = 0.01\n[parallel]\nproportional_V_per_um = 1\nintegral_V_per_um_s = 2\n")
    assert read_gains(path) == (Gains(1.0, 2.0), Limits(), 0.01)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = nan", "integral_V_per_um_s must be a finite number"),
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = -1.0", "integral_V_per_um_s must be a finite number"),
        ("integral_V_per_um_s = 7.25", 'integral_V_per_um_s = "7"', "parallel.integral_V_per_um_s: found '7'"),
        ("integral_V_per_um_s = 7.25", "", "parallel.integral_V_per_um_s: is missing"),
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = 7.5", "does not agree with [parallel]"),
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = 7.25\nspeed = 1", "parallel.speed: unknown key"),
        ("upper_V = 50.0", "upper_V = -1.0", "lower_V must lie below upper_V"),
        ("sampling_period_s = 0.03", "sampling_period_s = -0.03", "period_s must be"),
        ("[parallel]", "[parallel", "is not valid TOML"),
    ],
)
def test_a_faulty_file_is_named_with_what_is_wrong(written: Path, old: str, new: str, sentence: str) -> None:
    text = written.read_text(encoding="utf-8")
    assert old in text
    written.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_gains(written)
    assert str(caught.value).startswith(f"{written}: ")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_gains(tmp_path / "none.toml")


def test_nothing_is_written_for_a_period_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="period_s"):
        write_gains(tmp_path / "gains.toml", GAINS, LIMITS, math.nan)
    assert not list(tmp_path.iterdir())


def test_other_units_are_said_in_the_file_and_do_not_run_on_a_bench(written: Path, tmp_path: Path) -> None:
    assert "units" not in written.read_text(encoding="utf-8")
    assert read_units(written) is None
    assert read_bench_gains(written) == read_gains(written)
    path = tmp_path / "oven.toml"
    write_gains(path, GAINS, LIMITS, 0.02, units=("W", "K"))
    assert read_units(path) == ("W", "K")
    assert read_gains(path) == (GAINS, LIMITS, 0.02)
    with pytest.raises(InputError, match="found gains in W and K, expected V and µm, the units of a bench"):
        read_bench_gains(path)
