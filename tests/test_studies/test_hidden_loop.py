"""A hidden bench in a closed loop, window by window, against the loop sample by sample."""

from collections.abc import Iterator
from contextlib import closing, contextmanager

import numpy as np
import pytest
from integral_controller import Integral

from bender_loop.control.references import Sine, Step
from bender_loop.fmu.plant import FmuPlant
from bender_native.ready import ready_plant_fmu
from bender_plant.model import load_model
from bender_proving import Bench, Case, make_case
from bender_proving.physics.lobatto import Array
from bender_proving.records.excitation import Excitation
from bender_studies.control import hidden_loop
from bender_studies.control.hidden_loop import AGREE_V, WINDOW_ROWS, run_hidden

RATE_HZ, SETPOINT_UM = 30.0, 10.0


def swinging_um(time_s: float) -> float:
    return SETPOINT_UM * (1.0 - np.cos(2.0 * np.pi * 0.3 * time_s)) / 2.0


@contextmanager
def model(half_width_um: float = 0.0) -> Iterator[FmuPlant]:
    """The nominal model, with a play or without."""
    found = load_model("paper")
    if half_width_um:
        found = found.with_block("backlash", half_width_um=half_width_um)
    with closing(FmuPlant(ready_plant_fmu(found))) as plant:
        yield plant


@pytest.mark.parametrize("effects", [("transport_delay",), ("rate_independent_hysteresis",), ("creep",), ("backlash",)])
def test_windows_give_the_loop_of_single_samples(effects: tuple[str, ...]):
    """Whatever the model that is run beside the bench: this one has none of what is hidden."""
    case = make_case("single", effects, 3, sensor="camera")
    controller, count = Integral(0.08), 3 * WINDOW_ROWS + 4
    bench, time_s = Bench(case), np.arange(count + 1) / RATE_HZ
    volts, tips, state = np.zeros(count + 1), np.zeros(count), controller.rest()
    for k in range(count):
        tips[k] = bench.clean(Excitation(case.sensor, time_s[: k + 2], volts[: k + 2]))[k]
        state, volts[k:] = controller.step(state, float(time_s[k]), float(tips[k]))
    with model() as like:
        found = run_hidden(case, controller, Step(SETPOINT_UM), RATE_HZ, count / RATE_HZ, None, like)
    assert np.ptp(tips) > 1.0
    assert found.voltage_V == pytest.approx(volts[:count], abs=5 * AGREE_V)
    assert found.displacement_um == pytest.approx(tips, abs=5 * AGREE_V)


@pytest.mark.slow
def test_a_model_with_the_play_of_the_bench_takes_few_rounds(monkeypatch: pytest.MonkeyPatch):
    """Taken to be linear, a bench with a play in it takes a round for nearly every sample."""
    case, asked = make_case("single", ("backlash",), 3, sensor="camera"), []
    half_width_um = dict(case.effects[0].parameters)["half_width_um"]

    class Counted(Bench):
        def clean(self, plan: Excitation, number: int = 0) -> Array:
            asked.append(len(plan.time_s))
            return super().clean(plan, number)

    def rounds(of: Case, half_um: float) -> int:
        asked.clear()
        with model(half_um) as like:
            run_hidden(of, Integral(0.08, swinging_um), Sine(5.0, 0.3, 5.0), RATE_HZ, 5.0, 3, like)
        return len(asked)

    monkeypatch.setattr(hidden_loop, "Bench", Counted)
    assert rounds(case, half_width_um) < 30
    assert rounds(case, 0.0) > 2 * rounds(case, half_width_um)
