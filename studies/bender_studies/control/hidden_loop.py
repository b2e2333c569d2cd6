"""A bench of `bender_proving` in a closed loop, in virtual time, with any controller."""

from collections.abc import Callable

import numpy as np

from bender_loop.control.references import Reference
from bender_loop.records.record import Array, Record
from bender_proving import NOISE_UM, Bench, Case
from bender_proving.records.excitation import Excitation

Controller = Callable[[float, float], float]
"""From the time and the newest reading in µm to the command in V."""


def run_hidden(
    case: Case, controller: Controller, reference: Reference, rate_Hz: float, duration_s: float, seed: int | None
) -> Record:
    """Run the loop from rest; the displacement of the record is the true one, without noise.

    The bench has no state to step on from: each sample computes it anew from rest.

    Args:
        case: what is hidden.
        controller: called at every sample.
        reference: set-points, for the record.
        rate_Hz: samples per second.
        duration_s: of the loop.
        seed: of the noise that the controller sees, None for none.
    """
    bench, count = Bench(case), max(2, round(duration_s * rate_Hz))
    time_s = np.arange(count + 1) / rate_Hz
    volts, tips = np.zeros(count + 1), np.full(count, np.nan)
    noise = np.zeros(count) if seed is None else np.random.default_rng(seed).normal(0.0, NOISE_UM[case.sensor], count)
    for k in range(count):
        tips[k] = bench.clean(Excitation(case.sensor, time_s[: k + 2], volts[: k + 2]))[k]
        volts[k:] = controller(float(time_s[k]), float(tips[k] + noise[k]))
    rows = slice(0, count)
    return Record(time_s[rows], volts[rows], tips, setpoint_um=reference.sample(time_s[rows]))


def rms_um(record: Record, from_s: float = 0.0) -> float:
    """Return the rms of the true displacement from the set-point, from an instant on."""
    if record.setpoint_um is None:
        raise ValueError("setpoint_um must be there, found None")
    error: Array = (record.displacement_um - record.setpoint_um)[record.time_s >= from_s]
    return float(np.sqrt(np.mean(error**2)))
