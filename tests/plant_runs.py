"""A plant under held voltages, as tests run it."""

from collections.abc import Iterable

import numpy as np

from bender_plant.blocks import BLOCKS
from bender_plant.model import BlockSettings, Model, load_model
from bender_plant.plant import Plant


def run_plant(model: Model, voltages: np.ndarray, step_s: float, parts: int = 1) -> np.ndarray:
    """Return the reading after each step under held voltages, every step cut into so many parts."""
    plant = Plant(model)
    state = plant.initial()
    readings: list[float] = []
    reading = 0.0
    for k, voltage in enumerate(voltages):
        for part in range(parts):
            state, reading, _ = plant.step(state, float(voltage), (k + part / parts) * step_s, step_s / parts)
        readings.append(reading)
    return np.array(readings)


def with_transducer(block_id: str, **parameters: object) -> Model:
    """Return the model `bench`, whose source has a resistance, with another transducer."""
    bench = load_model("bench")
    others = tuple(x for x in bench.blocks if x.id != "learned_hysteresis")
    return Model("test", bench.beam, (*others, BlockSettings(block_id, BLOCKS[block_id].parameters(**parameters))))


def kernel_outputs_m(model: Model, steps: Iterable[tuple[float, float]], start_s: float = 0.0) -> list[list[float]]:
    """Return reading and tip in m after each step of (voltage_V, step_s), as FMUs give them."""
    plant = Plant(model)
    state, time_s, found = plant.initial(), start_s, []
    for voltage_V, step_s in steps:
        state, reading_um, tip_um = plant.step(state, voltage_V, time_s, step_s)
        found.append([1e-6 * reading_um, 1e-6 * tip_um])
        time_s += step_s
    return found
