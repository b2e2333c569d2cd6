"""What is played to a device, and what a person might record of it: uneven clocks, gaps, outliers, units, loops."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_proving.devices.device import Device, Element, draw_device

Array = NDArray[np.float64]
_SUBSTEPS = 8
_PLAYS = ("steps", "sines", "ramps", "noise", "one step", "still")


@dataclass(frozen=True, slots=True)
class Habits:
    """How a person records.

    Attributes:
        play: what is played.
        rows: of a record.
        period_s: between rows.
        span: of the command; `centre` in its middle.
        jitter: of the clock, a part of the period.
        noise: of the reading, a part of its span.
        gaps: so many stretches of the record are missing.
        lost: share of readings that are missing.
        outliers: so many readings are far off, by so many spans as `outlier_size` says.
        jump: the reading goes on beside itself by so many spans from the middle on.
        scale: from the device's number to the file's.
        offset: of the reading in the file.
        gain_of_loop: of an integrating loop around the device; 0 for none.
    """

    play: str
    rows: int
    period_s: float
    span: float
    centre: float
    jitter: float
    noise: float
    gaps: int
    lost: float
    outliers: int
    outlier_size: float
    jump: float
    scale: float
    offset: float
    gain_of_loop: float


@dataclass(frozen=True, slots=True)
class Strange:
    """A device and how it is recorded.

    Attributes:
        seed: that gives it again.
        device: what it is.
        habits: of whoever records it.
    """

    seed: int
    device: Device
    habits: Habits

    def write(self, path: Path, number: int) -> None:
        """Write a record of it; each number is a play of its own."""
        rng = np.random.default_rng([self.seed, 7, number])
        time_s, command, reading = _recorded(self.device, self.habits, rng)
        rows = (
            f"{t!r},{u!r},{'' if math.isnan(y) else repr(y)}" for t, u, y in zip(time_s, command, reading, strict=True)
        )
        path.write_text("\n".join(["time_s,voltage_V,displacement_um", *rows]) + "\n", encoding="utf-8")


def draw(seed: int) -> Strange:
    """Return the device of a seed; every fourth or so has one habit that is out of the ordinary."""
    rng = np.random.default_rng([seed, 3])
    device = draw_device(rng)
    odd = rng.uniform(size=8) < 0.08
    habits = Habits(
        play=str(rng.choice(_PLAYS, p=[0.3, 0.25, 0.2, 0.15, 0.08, 0.02])),
        rows=int(rng.integers(150, 500)),
        period_s=device.time_scale_s * float(10.0 ** rng.uniform(-1.0, 0.3)),
        span=float(10.0 ** rng.uniform(-0.5, 2.0)),
        centre=float(rng.choice([0.0, 0.5])),
        jitter=float(rng.choice([0.0, 0.02, 0.2])),
        noise=float(10.0 ** rng.uniform(-4.0, -1.5)) * float(not odd[0]),
        gaps=int(rng.choice([0, 0, 1, 2])),
        lost=float(rng.choice([0.0, 0.0, 0.02, 0.2])),
        outliers=int(rng.choice([0, 0, 1, 4])),
        outlier_size=float(10.0 ** rng.uniform(0.0, 3.0 if odd[1] else 1.0)),
        jump=float(10.0 ** rng.uniform(0.0, 2.0)) if odd[2] else 0.0,
        scale=float(10.0 ** rng.uniform(-7.0, 7.0)) if odd[3] else 1.0,
        offset=float(10.0 ** rng.uniform(0.0, 7.0)) if odd[4] else 0.0,
        gain_of_loop=float(rng.uniform(0.05, 0.4)) if rng.uniform() < 0.2 else 0.0,
    )  # fmt: skip
    return Strange(seed, device, habits)


def _recorded(device: Device, habits: Habits, rng: np.random.Generator) -> tuple[list[float], list[float], list[float]]:
    count = habits.rows
    steps_s = habits.period_s * (1.0 + habits.jitter * rng.uniform(-1.0, 1.0, count))
    wanted = habits.span * (habits.centre + _played(habits.play, count, rng))
    elements = device.elements(habits.span)
    command, plain = np.zeros(count), np.zeros(count)
    held = 0.0
    for k in range(count):
        plain[k] = _value(elements, held, steps_s[k] if k else 0.0)
        # a loop integrates what is missing; it knows the gain, as whoever has tuned it does
        held = held + habits.gain_of_loop * (wanted[k] - plain[k]) if habits.gain_of_loop else float(wanted[k])
        held = float(np.clip(held, -3.0 * habits.span, 3.0 * habits.span))
        command[k] = held
    reading = device.gain * plain
    extent = float(np.ptp(reading)) or abs(device.gain) * habits.span
    reading = reading + habits.noise * extent * rng.standard_normal(count)
    reading[rng.integers(0, count, habits.outliers)] += extent * habits.outlier_size
    reading[count // 2 :] += extent * habits.jump
    reading[rng.uniform(size=count) < habits.lost] = math.nan
    kept = np.ones(count, dtype=bool)
    for start in rng.integers(5, count - 5, habits.gaps):
        kept[start : start + int(rng.integers(3, 20))] = False
    time_s = np.cumsum(steps_s) - steps_s[0]
    reading = habits.scale * reading + habits.offset
    return time_s[kept].tolist(), command[kept].tolist(), reading[kept].tolist()


def _value(elements: list[Element], held: float, dt_s: float) -> float:
    value = held
    for _ in range(_SUBSTEPS):
        value = held
        for element in elements:
            value = element(value, dt_s / _SUBSTEPS)
    return value


def _played(play: str, count: int, rng: np.random.Generator) -> Array:
    """Return a course within about -0.5 ... 0.5, (count,)."""
    k = np.arange(count)
    if play == "still":
        return np.zeros(count)
    if play == "one step":
        return np.where(k > count // 10, 0.5, 0.0)
    if play == "steps":
        lengths = rng.integers(4, 30, count)
        return np.repeat(rng.uniform(-0.5, 0.5, count), lengths)[:count]
    if play == "sines":
        pitch = 10.0 ** rng.uniform(-2.0, -0.6, 4)
        return sum((0.125 * np.sin(2.0 * np.pi * p * k) for p in pitch), start=np.zeros(count))
    if play == "ramps":
        corners = np.sort(rng.integers(0, count, 8))
        return np.interp(k, [0, *corners, count], [0.0, *rng.uniform(-0.5, 0.5, 8), 0.0])
    return np.clip(0.2 * rng.standard_normal(count), -0.5, 0.5)
