"""Behind an even curve a linear fit sees nothing: the numbers of what it hides stay until the curve is there."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from bender_discrepancy.settings import Settings
from bender_discrepancy.workflow import diagnose
from bender_loop.records.record import Record


@pytest.mark.slow
def test_the_absolute_value_of_a_speed_is_a_fold():
    rng = np.random.default_rng(2)
    time_s = 0.02 * np.arange(500, dtype=np.float64)
    motor_V = np.repeat(rng.choice([-1.5, 1.5], 100), 5)
    speed = lsim(TransferFunction([2.0 * 400.0], np.polymul([0.17, 1.0], [1.0, 6.0, 400.0])), motor_V, time_s)[1]
    count = np.abs(speed) + 0.03 * rng.standard_normal(time_s.size)
    found = diagnose(None, [Record(time_s, motor_V, count)], Settings().between_rows("auto"))
    assert found.to_dict()["effects"][0]["id"] == "fold"
    assert found.gap.after.rms_um < 0.3 * found.gap.recalibrated.rms_um
