"""Instruments beside the sensor: the supply's own voltmeter and ammeter, and a thermometer near the beam.

None is perfect. The voltmeter has a gain, an offset, noise and a resolution of its own, and is read at some time
within each row; the ammeter sees what charges the film and what leaks through it. The thermometer has noise and a
resolution, and follows the air around the film a little late.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from bender_proving.cases.hidden import log_uniform
from bender_proving.physics.lobatto import Array

FILM_UM_PER_K = (15.0, 60.0)
"""How far the tip of a PVDF film on polyimide moves for a kelvin."""


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
class Ammeter:
    """The ammeter of a supply, and what it feeds.

    Attributes:
        capacitance_F: of the film and its leads.
        leakage_ohm: across it.
        offset_A: what it shows for nothing.
        noise_A: standard deviation of a reading.
        resolution_A: of its display.
        averaged_s: over which it averages.
    """

    capacitance_F: float
    leakage_ohm: float
    offset_A: float
    noise_A: float
    resolution_A: float
    averaged_s: float

    def shown_A(self, before_V: Array, voltage_V: Array, rng: Generator) -> Array:
        """What it shows: voltages at the beginning and the end of the time it averages over."""
        drawn = self.capacitance_F * (voltage_V - before_V) / self.averaged_s + voltage_V / self.leakage_ohm
        seen = drawn + self.offset_A + self.noise_A * rng.standard_normal(len(voltage_V))
        return self.resolution_A * np.rint(seen / self.resolution_A)


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


def drawn_ammeter(rng: Generator, slowest_V_per_s: float) -> Ammeter:
    """Draw an ammeter that is good enough for the current of the slowest slew, and what it is connected to."""
    capacitance_F = log_uniform(rng, 2e-8, 5e-6)
    least_A = capacitance_F * slowest_V_per_s
    return Ammeter(
        capacitance_F=capacitance_F,
        leakage_ohm=log_uniform(rng, 30.0, 3000.0) / capacitance_F,
        offset_A=least_A * float(rng.uniform(-0.2, 0.2)),
        noise_A=least_A * log_uniform(rng, 0.001, 0.02),
        resolution_A=least_A * log_uniform(rng, 0.001, 0.02),
        averaged_s=log_uniform(rng, 0.0005, 0.005),
    )


def drawn_thermometer(rng: Generator) -> Thermometer:
    """Draw a thermometer: a thermistor or a platinum resistor behind a good bridge."""
    return Thermometer(
        noise_K=log_uniform(rng, 0.002, 0.02),
        resolution_K=float(rng.choice([0.001, 0.002, 0.005, 0.01])),
        tau_s=log_uniform(rng, 0.2, 2.0),
        start_C=float(rng.uniform(19.0, 26.0)),
    )
