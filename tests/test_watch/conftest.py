"""A device that is watched: a linear model, a record of it while all was well, and records of what became of it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record, write_record
from bender_plant.model import load_model

NOISE_UM = 0.05
ROWS = 1200


@dataclass(frozen=True)
class Device:
    """Where the files are."""

    folder: Path
    training: Path

    def recorded(self, seed: int, change: float = 1.0) -> Record:
        """Return a record of the device, whose gain is another one from the middle on."""
        return recorded(seed, change)

    def write(self, name: str, seed: int, change: float = 1.0, at: int = ROWS // 2, **spoil: float) -> Path:
        """Write a record of the device, whose gain is another one from a row on."""
        path = self.folder / name
        write_record(path, recorded(seed, change, at, spoil.get("volts", 1.0)))
        return path


def recorded(seed: int, change: float = 1.0, at: int = ROWS // 2, volts: float = 1.0) -> Record:
    """Return a record of 1200 rows at 50 Hz: steps, noise of 0.05 um, the gain another one from a row on."""
    rng = np.random.default_rng(seed)
    time = np.arange(ROWS) / 50.0
    voltage = volts * np.repeat(np.append(0.0, rng.uniform(0.0, 30.0, ROWS // 30 - 1)), 30)
    reading = Simulator(Drive.of_rows(time, voltage)).run(load_model("beam")).reading_um
    reading = np.where(np.arange(ROWS) < at, 1.0, change) * reading + NOISE_UM * rng.standard_normal(ROWS)
    return Record(time, voltage, reading)


@pytest.fixture(scope="module")
def device(tmp_path_factory: pytest.TempPathFactory) -> Device:
    folder = tmp_path_factory.mktemp("device")
    write_record(folder / "training.csv", recorded(1))
    return Device(folder, folder / "training.csv")
