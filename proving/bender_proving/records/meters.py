"""Instruments beside the sensor: the supply's own voltmeter, and a thermometer near the beam.

Neither is perfect. The voltmeter has a gain, an offset, noise and a resolution of its own, and is read at some time
within each row. The thermometer has noise and a resolution, and follows the air around the film a little late.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from bender_proving.cases.hidden import log_uniform
from bender_proving.physics.lobatto import Array


@dataclass(frozen=True, slots=True)
class Voltmeter:
    """The voltmeter of a supply.

    Attributes:
        gain: what it shows for a volt.
        offset_V: what it shows for nothing.
        noise_V: standard deviation of a reading.
        resolution_V: of its display.
        late: part of a row after which it is read, on average.
        jitter: largest deviation from that, in parts of a row.
    """

    gain: float
    offset_V: float
    noise_V: float
    resolution_V: float
    late: float
    jitter: float

    def instants_s(self, time_s: Array, rng: Generator) -> Array:
        """When it is read: within each row."""
        rows_s = np.diff(time_s, append=2.0 * time_s[-1] - time_s[-2])
        return time_s + rows_s * (self.late + self.jitter * rng.uniform(-1.0, 1.0, len(time_s)))

    def shown_V(self, voltage_V: Array, rng: Generator) -> Array:
        """What it shows of voltages."""
        seen = self.gain * voltage_V + self.offset_V + self.noise_V * rng.standard_normal(len(voltage_V))
        return self.resolution_V * np.rint(seen / self.resolution_V)


@dataclass(frozen=True, slots=True)
class Thermometer:
    """A thermometer near the beam.

    Attributes:
        noise_K: standard deviation of a reading.
        resolution_K: of its display.
        tau_s: how late it follows.
        start_C: temperature at the beginning.
    """

    noise_K: float
    resolution_K: float
    tau_s: float
    start_C: float

    def shown_C(self, time_s: Array, change_K: Array, rng: Generator) -> Array:
        """What it shows while the air changes by so much, shape (n,) as the rows."""
        followed = np.zeros(len(time_s))
        for k, step_s in enumerate(np.diff(time_s), 1):
            kept = math.exp(-step_s / self.tau_s)
            followed[k] = kept * followed[k - 1] + (1.0 - kept) * 0.5 * (change_K[k] + change_K[k - 1])
        seen = self.start_C + followed + self.noise_K * rng.standard_normal(len(time_s))
        return self.resolution_K * np.rint(seen / self.resolution_K)


def drawn_voltmeter(rng: Generator) -> Voltmeter:
    """Draw a voltmeter as laboratory supplies have them."""
    jitter = float(rng.uniform(0.0, 0.2))
    return Voltmeter(
        gain=1.0 + float(rng.uniform(-0.005, 0.005)),
        offset_V=float(rng.uniform(-0.05, 0.05)),
        noise_V=log_uniform(rng, 0.002, 0.02),
        resolution_V=float(rng.choice([0.001, 0.002, 0.005, 0.01])),
        late=float(rng.uniform(0.05 + jitter, 0.95 - jitter)),
        jitter=jitter,
    )


def drawn_thermometer(rng: Generator) -> Thermometer:
    """Draw a thermometer: a thermistor or a platinum resistor behind a good bridge."""
    return Thermometer(
        noise_K=log_uniform(rng, 0.002, 0.02),
        resolution_K=float(rng.choice([0.001, 0.002, 0.005, 0.01])),
        tau_s=log_uniform(rng, 0.2, 2.0),
        start_C=float(rng.uniform(19.0, 26.0)),
    )
