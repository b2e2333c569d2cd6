"""A hidden bench in a closed loop, window by window, against the loop sample by sample."""

from dataclasses import dataclass

import numpy as np
import pytest

from bender_loop.control.references import Step
from bender_proving import Bench, make_case
from bender_proving.records.excitation import Excitation
from bender_studies.control.hidden_loop import AGREE_V, WINDOW_ROWS, run_hidden

RATE_HZ, SETPOINT_UM = 30.0, 10.0


@dataclass(frozen=True)
class Integral:
    """A controller that integrates, and forgets nothing."""

    gain_V_per_um: float

    def rest(self) -> float:
        return 0.0

    def step(self, state: float, time_s: float, reading_um: float) -> tuple[float, float]:
        after = min(max(state + self.gain_V_per_um * (SETPOINT_UM - reading_um), 0.0), 50.0)
        return after, after


@pytest.mark.parametrize("effects", [("transport_delay",), ("rate_independent_hysteresis",), ("creep",)])
def test_windows_give_the_loop_of_single_samples(effects: tuple[str, ...]):
    case = make_case("single", effects, 3, sensor="camera")
    controller, count = Integral(0.08), 3 * WINDOW_ROWS + 4
    bench, time_s = Bench(case), np.arange(count + 1) / RATE_HZ
    volts, tips, state = np.zeros(count + 1), np.zeros(count), controller.rest()
    for k in range(count):
        tips[k] = bench.clean(Excitation(case.sensor, time_s[: k + 2], volts[: k + 2]))[k]
        state, volts[k:] = controller.step(state, float(time_s[k]), float(tips[k]))
    found = run_hidden(case, controller, Step(SETPOINT_UM), RATE_HZ, count / RATE_HZ, seed=None)
    assert np.ptp(tips) > 1.0
    assert found.voltage_V == pytest.approx(volts[:count], abs=5 * AGREE_V)
    assert found.displacement_um == pytest.approx(tips, abs=5 * AGREE_V)
