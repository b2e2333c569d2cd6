"""Hidden devices of `proving` whose effects come in while they are watched, at once or along a ramp.

The reading is that of the nominal device until the change, and that of a device which has always had the effect from
then on; along a ramp it goes from the one to the other. The strength is sought for which what the effect adds over the
whole record is so many times the noise, rms.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record
from bender_proving import chain
from bender_proving.bench import stream
from bender_proving.cases.effects import effect
from bender_proving.cases.hidden import NOISE_UM, Hidden, Sensor
from bender_proving.records.excitation import Excitation, even
from bender_proving.records.excitations import rich

Array = NDArray[np.float64]

EFFECTS = (
    "transport_delay", "source_resistance", "slew_limit", "dead_zone", "charge_leakage", "saturation",
    "electrostriction", "rate_independent_hysteresis", "creep", "backlash", "sensor_lag", "lens_distortion",
)  # fmt: skip
SIZES = (1.0, 3.0, 10.0)
SHAPES = ("step", "ramp")
SENSOR: Sensor = "camera"
HALVINGS = 14
RAMP = 0.1
"""Of the record: how long a ramp takes."""


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A device that changes in mid-run.

    Attributes:
        effect: id of what comes in.
        size: rms of what it adds, over the noise.
        shape: "step" or "ramp".
        record: of the device.
        row: before which the change begins, from 0.
        added_um: (n,) what the change adds to the reading.
        noise_um: (n,) of the readings.
    """

    effect: str
    size: float
    shape: str
    record: Record
    row: int
    added_um: Array
    noise_um: Array


@dataclass(frozen=True, slots=True, eq=False)
class Quiet:
    """A device that does not change.

    Attributes:
        plan: its excitation.
        clean_um: (n,) readings without noise.
    """

    plan: Excitation
    clean_um: Array

    def record(self, seed: int) -> Record:
        """Return a record of it, with noise of its own."""
        return _recorded(self.plan, self.clean_um, stream(seed, "watched, noise"))


def quiet(seed: int) -> Quiet:
    """Return an excitation and what the device reads while all is well."""
    plan = rich(SENSOR, stream(seed, "watched"))
    return Quiet(plan, chain.readings_um(plan.commands)[plan.recorded])


def lasting(devices: Sequence[Quiet], rows: int) -> Record:
    """Return one record of so many rows, in which the excitations of devices follow each other again and again."""
    voltage_V = np.concatenate([x.plan.voltage_V[x.plan.recorded] for x in devices])
    plan = even(SENSOR, np.resize(voltage_V, rows))
    return _recorded(plan, chain.readings_um(plan.commands)[plan.recorded], stream(rows, "watched, lasting"))


def changed(name: str, size: float, shape: str, seed: int) -> Change | None:
    """Return a device with an effect that comes in; None where it cannot be of that size."""
    device = _with_effect(name, size, seed)
    if device is None:
        return None
    plan, clean, added = device
    rng, rows = stream(seed, "changed, row"), clean.size
    row = int(rng.integers(rows // 4, rows // 2))
    since = np.arange(rows) - row
    weight = np.clip((since + 1.0) / (RAMP * rows), 0.0, 1.0) if shape == "ramp" else (since >= 0).astype(float)
    record = _recorded(plan, clean + weight * added, stream(seed, "changed, noise"))
    read = clean + weight * added
    return Change(name, size, shape, record, row, weight * added, record.displacement_um - read)


@lru_cache(maxsize=2)
def _with_effect(name: str, size: float, seed: int) -> tuple[Excitation, Array, Array] | None:
    """Return an excitation, what is read without the effect, and what that adds; the same for every shape."""
    plan = rich(SENSOR, stream(seed, "changed"))
    clean = chain.readings_um(plan.commands)[plan.recorded]
    hidden = _sized(name, size * NOISE_UM[SENSOR], plan, clean, seed)
    if hidden is None:
        return None
    return plan, clean, chain.readings_um(plan.commands, (hidden,))[plan.recorded] - clean


def _recorded(plan: Excitation, clean: Array, rng: np.random.Generator) -> Record:
    read = clean + NOISE_UM[SENSOR] * rng.standard_normal(clean.size)
    return Record(plan.time_s[plan.recorded], plan.voltage_V[plan.recorded], read)


def _sized(name: str, wanted_um: float, plan: Excitation, clean: Array, seed: int) -> Hidden | None:
    """Return the effect whose difference has an rms, by halving the range of its magnitude."""
    entry = effect(name)
    low, high = entry.ranges[SENSOR]
    low /= 30.0
    form = str(stream(seed, "changed, form").choice(entry.forms))

    def rms_um(magnitude: float) -> tuple[float, Hidden] | None:
        try:
            hidden = entry.hide(form, magnitude, plan.setting, stream(seed, "changed, numbers"))
        except ValueError:
            return None
        added = chain.readings_um(plan.commands, (hidden,))[plan.recorded] - clean
        return (float(np.sqrt(np.mean(added**2))), hidden) if np.all(np.isfinite(added)) else None

    ends = rms_um(low), rms_um(high)
    rises = ends[0] is None or ends[1] is None or ends[1][0] > ends[0][0]
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        found = rms_um(middle)
        if found is not None and abs(math.log(found[0] / wanted_um)) < 0.05:
            return found[1]
        if (found is None or found[0] > wanted_um) == rises:
            high = middle
        else:
            low = middle
    return None
