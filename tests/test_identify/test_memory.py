"""How long a model answers a command, beside what its simulation does after one."""

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_identify.first_model.structures import Structure
from bender_identify.records.memory import memory_s
from bender_plant.model import Model, load_model


def part_left(model: Model, after_s: float) -> float:
    """Part of the largest answer to a pulse that is left from an instant on."""
    time_s = np.linspace(0.0, 2.0 * after_s, 4001)
    volts = np.where((time_s > 0.0) & (time_s < 0.02 * after_s), 10.0, 0.0)
    answer_um = Simulator(Drive.of_rows(time_s, volts)).run(model).reading_um
    return float(np.max(np.abs(answer_um[time_s > 1.02 * after_s])) / np.max(np.abs(answer_um)))


@pytest.mark.parametrize(
    ("structure", "values"),
    [
        (Structure(lags=1), (0.5,)),
        (Structure(lags=2), (0.5, 0.45)),
        (Structure(lags=1, delay=True), (0.5, 0.3)),
        (Structure(modes=1), (3.0, 0.05)),
        (Structure(modes=2), (10.0, 0.3, 12.0, 0.02, 0.5)),
    ],
)
def test_what_is_left_after_it_is_a_hundredth_or_so(structure: Structure, values: tuple[float, ...]) -> None:
    model = structure.model(values)
    after_s = memory_s(model)
    assert part_left(model, after_s) < 0.03
    assert part_left(model, 0.4 * after_s) > 0.03


def test_a_gain_has_no_memory_and_lags_before_and_behind_the_plant_have() -> None:
    gain = Structure().model(())
    assert memory_s(gain) == 0.0
    slow = gain.with_block("source_resistance", time_constant_s=1.0).with_block("sensor_lag", time_constant_s=2.0)
    assert memory_s(slow) == pytest.approx(3.0 * np.log(100.0))
    assert 0.0 < memory_s(load_model("paper")) < 10.0
