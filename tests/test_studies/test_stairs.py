"""What stairs cost at least: behind a dead time, and with the command that goes as far as it may."""

from contextlib import closing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from integral_controller import Integral

from bender_loop.control.references import Profile
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record
from bender_native.ready import ready_plant_fmu
from bender_proving import make_case
from bender_studies.control.hidden_loop import rms_um, run_hidden
from bender_studies.control.trial import RATE_HZ, SLEW_V_PER_S, dead_time_um, least_um

STAIRS, LENGTH_S = Profile((0.0, 0.5, 2.0), (0.0, 10.0, 5.0)), 3.5


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(st.floats(0.1, 2.0), st.sampled_from(["slew_limit", "source_resistance", "backlash", "saturation"]))
def test_no_controller_goes_below_what_a_bench_costs_at_least(gain_V_per_um: float, hidden: str):
    case = make_case("single", (hidden,), 4, sensor="camera")
    with closing(FmuPlant(ready_plant_fmu("paper"))) as like:
        run = run_hidden(
            case, Integral(gain_V_per_um, STAIRS.value, SLEW_V_PER_S / RATE_HZ), STAIRS, RATE_HZ, LENGTH_S, None, like
        )
    assert 0.0 < least_um(case, STAIRS, run) <= rms_um(run) * (1.0 + 1e-9)


@given(st.integers(0, 4), st.floats(0.02, 0.98))
def test_a_dead_time_costs_the_samples_that_it_hides_the_command_from(samples: int, part: float):
    """A command shows in the first sample behind it, a dead time of a part of a sample later in the same one."""
    time_s = np.arange(round(LENGTH_S * RATE_HZ)) / RATE_HZ
    record = Record(time_s, 0.0 * time_s, 0.0 * time_s, setpoint_um=STAIRS.sample(time_s))
    missed = 10.0**2 + 5.0**2
    expected = np.sqrt((samples + 1) * missed / time_s.size)
    assert dead_time_um(STAIRS, record, samples / RATE_HZ) == pytest.approx(expected)
    assert dead_time_um(STAIRS, record, (samples + part) / RATE_HZ) == pytest.approx(expected)
