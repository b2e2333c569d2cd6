"""FmuPlant on a real FMU: the same numbers as the closed form, whatever is done to it."""

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest

from bender_loop.control.closed_loop import Sampling, simulate
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Step
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.plant import FmuPlant

VOLTAGES = (3.0, 0.0, 7.0, -2.0)


def opened(path, parameters=None):
    return FmuPlant(path, input_name="u", output_name="y", parameters=parameters)


def run(plant, step_s=0.02):
    plant.reset()
    return [plant.step(voltage, step_s) for voltage in VOLTAGES]


def expected(lag, step_s=0.02, **settings):
    return run(lag(**{"gain_um_per_V": 1.0, **settings}), step_s)


def test_steps_as_the_closed_form(lag_fmu, lag):
    with opened(lag_fmu) as plant:
        assert run(plant) == pytest.approx(expected(lag), rel=1e-13)


def test_reads_at_rest_and_after_a_step(lag_fmu):
    with opened(lag_fmu) as plant:
        plant.reset()
        assert plant.read() == 0.0
        assert plant.step(4.0, 0.05) == plant.read() > 0.0


def test_the_input_is_zero_at_rest(lag_fmu):
    with FmuPlant(lag_fmu, input_name="u", output_name="held") as plant:
        for _ in range(2):
            plant.reset()
            assert plant.read() == 0.0
            assert plant.step(3.0, 0.1) == pytest.approx(3.0)


@pytest.mark.parametrize("changes", [(), (('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"'),)])
@pytest.mark.parametrize("forgetful", [0, 1])
def test_every_reset_gives_the_same_bits(edited, lag, changes, forgetful):
    # A forgetful FMU saves its visible variables only, so restoring that state alone would begin in mid-motion.
    with opened(edited(*changes), parameters={"forgetful": forgetful}) as plant:
        first = run(plant)
        assert first == pytest.approx(expected(lag), rel=1e-13)
        assert run(plant) == first
        plant.reset()
        assert plant.read() == 0.0


def test_reset_counts_no_step_twice(lag_fmu):
    with FmuPlant(lag_fmu, input_name="u", output_name="clock") as plant:
        for _ in range(2):
            plant.reset()
            assert [plant.step(0.0, 0.5) for _ in range(3)] == [0.0, 0.5e6, 1.0e6]


def test_time_is_k_times_the_step(lag_fmu):
    with FmuPlant(lag_fmu, input_name="u", output_name="clock") as plant:
        plant.reset()
        clock = [plant.step(0.0, 0.1) * 1e-6 for _ in range(1000)]
        assert clock == pytest.approx([k * 0.1 for k in range(1000)], rel=1e-15)
        assert plant.time_s == 1000 * 0.1


def test_uneven_steps_do_not_accumulate_rounding(lag_fmu):
    steps = [0.1, 0.3] * 500
    with FmuPlant(lag_fmu, input_name="u", output_name="clock") as plant:
        plant.reset()
        for step_s in steps:
            plant.step(0.0, step_s)
        assert plant.time_s == math.fsum(steps)


def test_uneven_steps_give_the_closed_form(lag_fmu, lag):
    oracle = lag(1.0)
    with opened(lag_fmu) as plant:
        plant.reset()
        for voltage, step_s in zip(VOLTAGES, (0.01, 0.5, 0.02, 0.003), strict=True):
            assert plant.step(voltage, step_s) == pytest.approx(oracle.step(voltage, step_s), rel=1e-13)


def test_an_fmu_of_even_steps_refuses_uneven_ones_but_not_their_rounding(edited):
    even = ('canHandleVariableCommunicationStepSize="true"', 'canHandleVariableCommunicationStepSize="false"')
    with opened(edited(even)) as plant:
        plant.reset()
        for step_s in np.diff(np.arange(20) * 0.01):
            plant.step(1.0, float(step_s))
        assert plant.time_s == pytest.approx(0.19, rel=1e-12)
        with pytest.raises(InputError, match=r"equal steps only.*found 0.02 s after 0.01 s"):
            plant.step(1.0, 0.02)
        plant.reset()
        plant.step(1.0, 0.02)


@pytest.mark.parametrize("step_s", [0.0, -0.1, math.inf, math.nan])
def test_step_must_be_positive(lag_fmu, step_s):
    with opened(lag_fmu) as plant, pytest.raises(ValueError, match="step_s must be a finite number > 0"):
        plant.step(1.0, step_s)


def test_parameters_act_from_the_start_and_from_the_next_reset(lag_fmu, lag):
    with opened(lag_fmu, parameters={"gain": 2e-6}) as plant:
        assert run(plant) == pytest.approx(expected(lag, gain_um_per_V=2.0), rel=1e-13)
        plant.set_parameters({"time_constant": 0.3})
        assert plant.step(0.0, 0.02) == pytest.approx(run(lag(2.0))[-1] * math.exp(-0.2), rel=1e-13)
        both = expected(lag, gain_um_per_V=2.0, tau_s=0.3)
        assert run(plant) == pytest.approx(both, rel=1e-13)
        assert run(plant) == pytest.approx(both, rel=1e-13)


@pytest.mark.parametrize("kind", ["refuse_above", "fail_above"])
def test_a_failing_step_is_told_and_the_next_reset_recovers(lag_fmu, lag, kind):
    with opened(lag_fmu, parameters={kind: 10.0}) as plant:
        plant.reset()
        plant.step(9.0, 0.02)
        status = "fmi2Discard" if kind == "refuse_above" else "fmi2Fatal.*the input is beyond everything"
        with pytest.raises(RunError, match=rf"step of 0.02 s from t = 0.02 s at input 11.0 ended with {status}"):
            plant.step(11.0, 0.02)
        assert run(plant) == pytest.approx(expected(lag), rel=1e-13)
        plant.reset()
        with pytest.raises(RunError):
            plant.step(11.0, 0.02)
        assert run(plant) == pytest.approx(expected(lag), rel=1e-13)


@pytest.mark.parametrize("gain", [1e308, 1e200])
def test_an_output_that_is_no_ordinary_number_fails_the_run(lag_fmu, gain):
    with opened(lag_fmu, parameters={"gain": gain}) as plant:
        assert plant.step(0.0, 0.02) == 0.0
        with pytest.raises(RunError, match=r"the output y is .* from t = 0.02 s at 100000.0 V, expected a number"):
            plant.step(1e5, 0.02)


def test_an_fmu_that_fails_in_the_trial_of_its_state_still_runs(lag_fmu, lag):
    with opened(lag_fmu, parameters={"fail_above": 0.5, "gain": 1e-5}) as plant:
        for _ in range(2):
            plant.reset()
            assert plant.step(0.4, 0.02) == pytest.approx(lag(10.0).step(0.4, 0.02), rel=1e-13)


def test_refused_parameters_are_bad_input(lag_fmu):
    with pytest.raises(InputError, match=r"time_constant must be > 0.*with parameters .'time_constant': -1.0"):
        opened(lag_fmu, parameters={"time_constant": -1.0})
    with opened(lag_fmu) as plant:
        plant.set_parameters({"time_constant": -1.0})
        with pytest.raises(InputError):
            plant.reset()
        plant.set_parameters({"time_constant": 0.1})
        plant.reset()


def test_closing_removes_the_files_and_may_be_done_twice(lag_fmu, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    plant = opened(lag_fmu)
    assert len(list(tmp_path.iterdir())) == 1
    plant.close()
    plant.close()
    assert not list(tmp_path.iterdir())
    for use in (plant.reset, plant.read, lambda: plant.step(1.0, 0.1)):
        with pytest.raises(RunError, match="closed"):
            use()


def test_a_failed_start_removes_the_files(lag_fmu, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(InputError):
        opened(lag_fmu, parameters={"time_constant": -1.0})
    assert not list(tmp_path.iterdir())


def test_two_instances_of_one_file_are_independent(lag_fmu):
    with opened(lag_fmu) as one, opened(lag_fmu) as other:
        alone = run(one)
        other.reset()
        one.reset()
        together = []
        for voltage in VOLTAGES:
            other.step(-voltage, 0.5)
            together.append(one.step(voltage, 0.02))
        assert together == alone


def test_closed_loop_through_the_fmu_is_that_of_the_closed_form(lag_fmu, lag):
    arguments = (Gains(0.5, 8.0, 0.01), Limits(0.0, 20.0), Step(10.0), Sampling(50.0), 1.0)
    with opened(lag_fmu) as plant:
        trace = simulate(plant, *arguments)
    oracle = simulate(lag(1.0), *arguments)
    np.testing.assert_allclose(trace.displacement_um, oracle.displacement_um, rtol=1e-12)
    np.testing.assert_allclose(trace.voltage_V, oracle.voltage_V, rtol=1e-12)


def test_the_path_may_be_text(lag_fmu: Path):
    with opened(str(lag_fmu)) as plant:
        assert plant.path == lag_fmu
