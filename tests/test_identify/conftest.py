import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_identify.records.voltage_path import even_times
from bender_loop.records.record import Record
from bender_plant.model import load_model

Array = np.ndarray
FRAME_S = 1 / 30


def sine_V(time_s: Array) -> Array:
    return 10.0 * np.sin(np.pi * time_s + 0.5)


@pytest.fixture(scope="session")
def sine_record() -> Record:
    """The paper's input as a camera sees it: 10 sin(pi t + 0.5) from rest, 30 frames per second, a tracked tip."""
    time_s = even_times(FRAME_S, 1800)
    fine = np.arange(0.0, 60.0, 1 / 3000)
    tip = Simulator(Drive(time_s, fine, sine_V(fine), linear=True)).run(load_model("paper")).reading_um
    noise = 0.05 * np.random.default_rng(3).standard_normal(len(tip))
    return Record(time_s, sine_V(time_s), tip + noise)


@pytest.fixture(scope="session")
def held_record() -> Callable[..., Record]:
    """Return a function that makes a record of a model under held voltages."""

    def make(model: str, voltage_V: Array, step_s: float = FRAME_S, noise_um: float = 0.0, seed: int = 0) -> Record:
        time_s = even_times(step_s, len(voltage_V))
        reading = Simulator(Drive.of_rows(time_s, voltage_V)).run(load_model(model)).reading_um
        noise = noise_um * np.random.default_rng(seed).standard_normal(len(reading))
        return Record(time_s, voltage_V, reading + noise)

    return make


@pytest.fixture
def identify_command() -> Callable[[list[str]], int]:
    """Return a function that runs the command on words."""
    from bender_identify.command import add_arguments, run

    def call(words: list[str]) -> int:
        parser = argparse.ArgumentParser()
        add_arguments(parser)
        return run(parser.parse_args(words))

    return call


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """The folder of measurements by others that lies beside the checkout."""
    folder = Path(__file__).parents[3] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measurements of others (../shared/data) are not here")
    return folder
