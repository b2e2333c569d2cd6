"""What a drawn system is driven with: steps, a sweep or a multisine, and the record that is read of it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from bender_proving.systems.linear import Array, LinearSystem, drawn_system

ROWS, ROW_S, FULL_V = 4000, 0.01, 50.0
KINDS = ("steps", "sweep", "multisine")


@dataclass(frozen=True, slots=True, eq=False)
class PlayedSystem:
    """A system with two records of it, arrays of shape (n,); the second one is for judging alone."""

    system: LinearSystem
    kind: str
    noise_um: float
    time_s: Array
    voltage_V: tuple[Array, Array]
    reading_um: tuple[Array, Array]
    clean_um: tuple[Array, Array]


def played_system(number: int, seed: int) -> PlayedSystem:
    """Return the system of this number: its order and kind of drive go round, the rest is drawn from the seed.

    The noise lies 10 to 40 dB below the standard deviation of the clean reading.
    """
    rng = np.random.default_rng([seed, number])
    system = drawn_system(1 + number % 4, rng, ROW_S)
    kind = KINDS[(number // 4) % len(KINDS)]
    time_s = np.arange(ROWS, dtype=np.float64) * ROW_S
    volts = (_drive(kind, time_s, rng), _drive("steps", time_s, rng))
    clean = (system.answer(time_s, volts[0]), system.answer(time_s, volts[1]))
    noise_um = float(np.std(clean[0])) * 10.0 ** (-float(rng.uniform(10.0, 40.0)) / 20.0)
    read = tuple(x + rng.normal(0.0, noise_um, ROWS) + 1.0 for x in clean)
    return PlayedSystem(system, kind, noise_um, time_s, volts, (read[0], read[1]), clean)


def _drive(kind: str, time_s: Array, rng: Generator) -> Array:
    if kind == "steps":
        held = rng.integers(20, 160, ROWS)
        volts = np.repeat(rng.uniform(0.0, FULL_V, ROWS), held)[:ROWS]
    elif kind == "sweep":
        low, high, duration = 0.05, 0.4 / ROW_S, float(time_s[-1])
        rate = math.log(high / low) / duration
        phase = 2.0 * math.pi * low * (np.exp(rate * time_s) - 1.0) / rate
        volts = 0.5 * FULL_V * (1.0 - np.cos(phase))
    else:
        lines = np.arange(1, int(0.4 * ROWS), 3)
        phases = rng.uniform(0.0, 2.0 * math.pi, lines.size)
        waves = np.cos(2.0 * math.pi * np.outer(np.arange(ROWS), lines) / ROWS + phases).sum(axis=1)
        volts = 0.5 * FULL_V * (1.0 + waves / np.max(np.abs(waves)))
    volts = volts.copy()
    volts[0] = 0.0
    return volts
