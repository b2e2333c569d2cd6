"""Messages of FMUs reach the instance that logged them, whatever else runs in the process."""

import fmpy
import pytest

from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant


def opened(path, limit):
    return FmuPlant(path, input_name="u", output_name="y", parameters={"fail_above": limit})


def failure(plant, voltage):
    with pytest.raises(RunError) as caught:
        plant.step(voltage, 0.02)
    return str(caught.value)


def test_an_instance_logs_after_another_one_is_gone(lag_fmu):
    with opened(lag_fmu, 10.0) as first:
        first.step(1.0, 0.02)
        with opened(lag_fmu, 20.0) as second:
            second.step(1.0, 0.02)
        del second
        assert "the input is beyond everything" in failure(first, 11.0)


def test_messages_are_not_mixed(lag_fmu):
    with opened(lag_fmu, 10.0) as first, opened(lag_fmu, 20.0) as second:
        assert "the input is beyond everything" in failure(second, 21.0)
        first._advance = lambda *_: (_ for _ in ()).throw(first._instance.failure("nothing", 3))
        assert "the FMU logged nothing" in failure(first, 1.0)


def test_a_run_of_fmpy_in_between_takes_no_message_away(lag_fmu):
    with opened(lag_fmu, 10.0) as plant:
        fmpy.simulate_fmu(str(lag_fmu), validate=False, stop_time=0.02, output=["y"])
        plant.reset()
        assert "the input is beyond everything" in failure(plant, 11.0)
