"""Two records of a machine as a laboratory has them: coarse readings, noise, sometimes in motion from before."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import Generator

from bender_proving.machines.machine import Array, Machine
from bender_proving.machines.moving import MOVING
from bender_proving.machines.slow import SLOW
from bender_proving.machines.springs import SPRINGS

MACHINES = (*MOVING, *SPRINGS, *SLOW)
OTHER = 0.7
"""Amplitude of the second record beside that of the first."""


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """A machine with its two records.

    Attributes:
        machine: its kind.
        seed: of the draw.
        play: of the input.
        time_s, drive, reading: (n,) of each of the two records.
    """

    machine: Machine
    seed: int
    play: str
    time_s: tuple[Array, Array]
    drive: tuple[Array, Array]
    reading: tuple[Array, Array]

    def write(self, path: Path, number: int) -> None:
        """Write one of the records as a table of time, input and reading."""
        rows = zip(self.time_s[number], self.drive[number], self.reading[number], strict=True)
        lines = [f"{float(t)!r},{float(u)!r},{float(y)!r}" for t, u, y in rows]
        path.write_text("\n".join(["time_s,u,y", *lines]) + "\n", encoding="utf-8")


def draw(seed: int) -> Recorded:
    """Return the machine of a seed; kinds follow one another."""
    rng = np.random.default_rng([seed, 11])
    machine = MACHINES[seed % len(MACHINES)]
    respond, play = machine.draw(rng), str(rng.choice(machine.plays))
    rows, noise = int(rng.integers(800, 3000)), float(10.0 ** rng.uniform(-3.3, -1.8))
    steps, before = int(rng.choice([0, 4096])), int(rng.choice([0, 0, 50]))
    records = []
    for size in (1.0, OTHER):
        drive = machine.centre + size * machine.span * played(play, rows + before, rng)
        time_s = machine.row_s * np.arange(drive.size, dtype=np.float64)
        clean = respond(time_s, drive)
        extent = float(np.ptp(clean)) or 1.0
        reading = clean + noise * extent * rng.standard_normal(clean.size)
        if steps:
            grid = 2.0 * extent / steps
            reading = grid * np.round(reading / grid)
        records.append((time_s[: drive.size - before], drive[before:], reading[before:]))
    time, drive, reading = zip(*records, strict=True)
    return Recorded(machine, seed, play, time, drive, reading)


def played(play: str, count: int, rng: Generator) -> Array:
    """Return an input within about -0.5 to 0.5, (count,), that sets out from 0."""
    k = np.arange(count, dtype=np.float64)
    if play == "levels":
        values = np.concatenate([[0.0], rng.uniform(-0.5, 0.5, count)])
        return np.repeat(values, rng.integers(10, 60, count + 1))[:count]
    if play == "two levels":
        values = np.concatenate([[0.0], rng.choice([-0.4, 0.4], count)])
        return np.repeat(values, rng.integers(5, 40, count + 1))[:count]
    if play in ("sines", "slow sines"):
        turns = rng.uniform(3.0, 12.0, 3) * (1.0 if play == "slow sines" else 3.0)
        waves = sum((np.sin(2.0 * np.pi * n * k / count) for n in turns), start=np.zeros(count))
        return np.linspace(0.3, 1.0, count) * waves / 6.0
    if play == "ramps":
        corners = np.linspace(0, count, 17)
        size = np.repeat(np.linspace(0.2, 0.5, 8), 2) * np.tile([1.0, -1.0], 8)
        return np.interp(k, corners, np.concatenate([[0.0], size[:-1], [0.0]]))
    return np.clip(0.22 * rng.standard_normal(count), -0.5, 0.5)
