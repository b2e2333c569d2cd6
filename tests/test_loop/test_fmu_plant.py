"""FmuPlant on real FMUs of both versions: the numbers of the closed form, whatever is done to it; its messages."""

import math
import tempfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from native_hosts import needs_own_compiler

from bender_loop.errors import InputError, RunError
from bender_loop.fmu.check.check import check
from bender_loop.fmu.plant import FmuPlant
from bender_native.build import native_plant_fmu, way
from bender_plant.model import load_model

VOLTAGES = (3.0, 0.0, 7.0, -2.0)


def opened(path, parameters=None):
    return FmuPlant(path, input_name="u", output_name="y", parameters=parameters)


def run(plant, step_s=0.02):
    plant.reset()
    return [plant.step(voltage, step_s) for voltage in VOLTAGES]


def expected(lag, step_s=0.02, **settings):
    return run(lag(**{"gain_um_per_V": 1.0, **settings}), step_s)


def test_the_input_is_zero_at_rest(lag_fmu):
    with FmuPlant(lag_fmu, input_name="u", output_name="held") as plant:
        for _ in range(2):
            plant.reset()
            assert plant.read() == 0.0
            assert plant.step(3.0, 0.1) == plant.read() == pytest.approx(3.0)


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


def test_time_is_k_times_the_step_after_every_reset(lag_fmu):
    with FmuPlant(lag_fmu, input_name="u", output_name="clock") as plant:
        for _ in range(2):
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


def test_refused_parameters_are_bad_input_and_leave_no_files(lag_fmu, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(InputError, match=r"time_constant must be > 0.*with parameters .'time_constant': -1.0"):
        opened(lag_fmu, parameters={"time_constant": -1.0})
    assert not list(tmp_path.iterdir())
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


REFERENCE = Path(__file__).parents[3] / "shared" / "data" / "reference-fmus" / "fmi3"
STEP_S = 0.01
VOLTS = 25.0 + 20.0 * np.sin(np.arange(60) / 7.0)

needs_reference = pytest.mark.skipif(not REFERENCE.is_dir(), reason="the Reference FMUs (../shared/data) are not here")


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The beam with source resistance, compiled for FMI 2.0 and for 3.0."""
    folder = tmp_path_factory.mktemp("both")
    model = load_model("beam").with_block("source_resistance", time_constant_s=0.02)
    found = {}
    for version in (2, 3):
        found[version] = folder / f"plant{version}.fmu"
        found[version].write_bytes(native_plant_fmu(model, way(version)))
    return found


def _driven(plant: FmuPlant) -> list[float]:
    plant.reset()
    return [plant.step(float(volts), STEP_S) for volts in VOLTS]


@pytest.mark.slow
@needs_own_compiler
def test_both_versions_give_the_same_numbers(both: dict[int, Path]):
    with FmuPlant(both[2]) as two, FmuPlant(both[3]) as three:
        expected = _driven(two)
        assert _driven(three) == expected
        assert _driven(three) == expected  # from the restored state
        assert three.input.unit == two.input.unit == "V"
        for plant in (two, three):
            plant.set_parameters({"source_resistance.time_constant": 0.05})
        changed = _driven(three)
        assert changed == _driven(two)
        assert changed != expected
        assert three.read() == two.read()


@needs_own_compiler
def test_one_of_fmi_3_is_checked_and_its_bounds_are_kept(both: dict[int, Path]):
    report = check(both[3])
    assert "trial run" in report.ran
    assert not report.faults
    name = "source_resistance.time_constant"
    with FmuPlant(both[3]) as plant, pytest.raises(InputError, match=rf"{name}.*expected at least"):
        plant.set_parameters({name: -1.0})


@needs_reference
def test_feedthrough_hands_its_input_on():
    given, taken = "Float64_continuous_input", "Float64_continuous_output"
    with FmuPlant(REFERENCE / "Feedthrough.fmu", input_name=given, output_name=taken) as plant:
        # no unit: an input in V, an output in m
        assert [plant.step(volts, STEP_S) for volts in (0.5, -2.0, 3.25)] == [0.5e6, -2e6, 3.25e6]
    with pytest.raises(InputError, match=r"\d+ Real inputs.*; choose one with --input NAME"):
        FmuPlant(REFERENCE / "Feedthrough.fmu")
    with pytest.raises(InputError, match="is a Int32 input"):
        FmuPlant(REFERENCE / "Feedthrough.fmu", input_name="Int32_input")


def failure(plant, voltage):
    with pytest.raises(RunError) as caught:
        plant.step(voltage, 0.02)
    return str(caught.value)


def test_every_instance_logs_its_own_messages_whatever_ran_beside_it(lag_fmu):
    said = "the input is beyond everything"
    with opened(lag_fmu, {"fail_above": 10.0}) as first:
        first.step(1.0, 0.02)
        with opened(lag_fmu, {"fail_above": 20.0}) as second:
            assert said in failure(second, 21.0)
            assert said not in str(first._instance.failure("nothing", 3))
        fmpy.simulate_fmu(str(lag_fmu), validate=False, stop_time=0.02, output=["y"])
        first.reset()
        assert said in failure(first, 11.0)
