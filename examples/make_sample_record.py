"""Write `record.csv` into this folder: the record that README and how-to pages use.

It is simulated, not measured. The actuator behind it is the built-in model `paper` with one physical effect that this
model lacks, a gain that is off by 5 %, and noise with a seed. `bender diagnose` has to find both.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record, write_record
from bender_plant.model import Model, load_model

Volts = NDArray[np.float64]

SEED = 2026
FRAME_S = 1.0 / 30.0
GAIN = 0.95
NOISE_um = 0.05
HOLDS = ((30, 8.0), (0, 6.0), (50, 6.0), (15, 3.0), (0, 1.0), (45, 0.5), (20, 0.5), (35, 1.0), (0, 3.0))
"""Levels in V and for how many seconds each is held."""


def actuator() -> Model:
    """Return the actuator of the record: the built-in model and creep over two time constants."""
    return load_model("paper").with_block("creep", gains=(0.05, 0.05), time_constants_s=(0.5, 5.0))


def commands_V() -> Volts:
    """Return the voltage of every row: a staircase, steps of several sizes, a slow sine and a faster one."""
    stairs = np.concatenate([np.arange(0.0, 51.0, 10.0), np.arange(40.0, -1.0, -10.0)]).repeat(15)
    steps = np.concatenate([np.full(round(hold_s / FRAME_S), level_V) for level_V, hold_s in HOLDS])
    time_s = FRAME_S * np.arange(240)
    sines = [high_V / 2.0 * (1.0 - np.cos(2.0 * np.pi * rate * time_s)) for high_V, rate in ((40, 0.25), (20, 2.0))]
    return np.round(np.concatenate([stairs, steps, *sines, np.zeros(15)]), 3)


def sample_record() -> Record:
    """Return the record."""
    voltage_V = commands_V()
    time_s = np.round(FRAME_S * np.arange(voltage_V.size, dtype=np.float64), 6)
    clean_um = Simulator(Drive.of_rows(time_s, voltage_V)).run(actuator()).reading_um
    noise_um = NOISE_um * np.random.default_rng(SEED).standard_normal(voltage_V.size)
    return Record(time_s, voltage_V, np.round(GAIN * clean_um + noise_um, 4))


if __name__ == "__main__":
    path = Path(__file__).with_name("record.csv")
    write_record(path, sample_record())
    print(f"written: {path}")
