"""The voltage that was read back, of the supply or at the electrodes, held against what its effects would leave there.

When a read-back was taken is known to a row: at any time between the row's reading and the next one's. Under an
effect the terminals pass through some voltages in that time: a read-back is as likely as they are, the noise of the
meter included, and off by as much as it lies outside of their range. The meter may have a gain and an offset of its
own, which are solved for. Its noise is at least what read-backs of a voltage that has long been held differ by from
row to row, and its resolution.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_effects.form import Form
from bender_loop.records.initial_motion import reflected, starts_at_rest
from bender_loop.records.record import Record
from bender_plant.blocks import BLOCKS
from bender_plant.model import BlockSettings, Model

Array = NDArray[np.float64]

SUPPLY, ELECTRODES = "supply_voltage_V", "electrode_voltage_V"
"""Columns of a record: what the supply reads back at its terminals, what a probe reads at the electrodes."""
FEWEST_ROWS = 30
MOST_ROWS = 3000
LONG_HELD = 5
"""Rows: what a supply does after a change is over by then, as a rule."""
MOST_OFF = 0.1
"""A meter whose gain is off by more than this is none."""
LEAST_NOISE_V = 0.001
UNKNOWN = 0.1
"""Part of a record that begins in motion in which the supply may still answer to what came before."""
TURNS = 6
PARTS = 8
"""Of a row, in each of which the voltage runs straight."""
NOISIER = (1.0, 1.5, 2.5, 5.0, 10.0, 30.0, 100.0, 300.0)
"""Noise of the meter that is tried, in multiples of the least; the likeliest of these counts."""
STRAY = 1e-6
"""Part of read-backs that are wrong altogether."""
_TO_NORMAL = 1.4826
_GAIN = BLOCKS["linear_transduction"].parameters(sensitivity_um_per_V=1.0)
_TERMINALS = Model("terminals", None, (BlockSettings("linear_transduction", _GAIN),))


@dataclass(frozen=True, slots=True, eq=False)
class ReadBack:
    """The read-backs of one record that count, shapes (n,).

    Attributes:
        simulator: of the voltage at the instants between which read-backs were taken.
        places: (n, PARTS + 1) places of the instants of each row among those of the simulator.
        read_V: what was read back.
        noise_V: of a read-back.
        span_V: of the commands.
        command_V: of the rows.
    """

    simulator: Simulator
    places: NDArray[np.intp]
    read_V: Array
    noise_V: float
    span_V: float
    command_V: Array

    def left_by_steps_V2(self, steps_V: Array) -> Array:
        """Return the sum of squares that rounding the commands to steps leaves, for each step: a first look."""
        rounded = np.round(self.command_V / steps_V[:, None]) * steps_V[:, None]
        spread, level = rounded - rounded.mean(axis=1, keepdims=True), self.read_V - self.read_V.mean()
        power = np.maximum(np.sum(spread**2, axis=1), 1e-12)
        gain = np.clip(spread @ level / power, 1.0 - MOST_OFF, 1.0 + MOST_OFF)
        return np.sum((level - gain[:, None] * spread) ** 2, axis=1)

    def residual_V(self, form: Form | None = None, value: float = 0.0) -> Array:
        """Return how far the read-backs lie outside of what the terminals have during their rows under an effect.

        Args:
            form: of the effect; None for terminals that follow the command.
            value: of its one free number.
        """
        return self._held_against(form, value)[0]

    def unlikelihood(self, form: Form | None = None, value: float = 0.0) -> float:
        """Return twice the negative log-likelihood of the read-backs under an effect, as in `residual_V`."""
        _, voltage_V, gain, offset = self._held_against(form, value)
        begin, end = gain * voltage_V[:, :-1] + offset, gain * voltage_V[:, 1:] + offset
        middle, spread = 0.5 * (begin + end), (end - begin) ** 2 / 12.0
        off = (self.read_V[:, None] - middle) ** 2
        stray = STRAY / self.span_V

        def cost(noise_V: float) -> float:
            variance = noise_V**2 + spread
            density = np.exp(-0.5 * off / variance) / np.sqrt(2.0 * math.pi * variance)
            return -2.0 * float(np.sum(np.log(density.mean(axis=1) + stray)))

        return min(cost(self.noise_V * times) for times in NOISIER)

    def _held_against(self, form: Form | None, value: float) -> tuple[Array, Array, float, float]:
        """Return the residual, the voltages (n, PARTS + 1) of every row, and the meter's gain and offset."""
        model = _TERMINALS if form is None else form.apply(_TERMINALS, (value,))
        voltage_V = self.simulator.run(model).reading_um[self.places]
        least, most = voltage_V.min(axis=1), voltage_V.max(axis=1)
        gain, offset = 1.0, float(np.median(self.read_V - 0.5 * (least + most)))
        for _ in range(TURNS):
            seen = np.clip((self.read_V - offset) / gain, least, most)
            spread = seen - seen.mean()
            power = float(spread @ spread)
            if power > 0.0:
                gain = float(np.clip(float(spread @ self.read_V) / power, 1.0 - MOST_OFF, 1.0 + MOST_OFF))
            offset = float(np.mean(self.read_V - gain * seen))
        left = self.read_V - gain * np.clip((self.read_V - offset) / gain, least, most) - offset
        return left, voltage_V, gain, offset


def read_back(record: Record, linear: bool = False, column: str = SUPPLY) -> ReadBack | None:
    """Return the read-backs of a record that count; None where there are too few, or none of a held voltage."""
    read = record.columns().get(column)
    if read is None:
        return None
    rows = np.flatnonzero(np.isfinite(read))
    volts = record.voltage_V
    if not starts_at_rest(volts):  # what was commanded before is not known
        rows = rows[rows >= UNKNOWN * min(len(record), MOST_ROWS)]
    noise_V = meter_noise(volts[rows], read[rows], LEAST_NOISE_V)
    rows = _around_changes(rows, volts)
    span_V = float(np.ptp(volts))
    if rows.size < FEWEST_ROWS or span_V == 0.0:
        return None
    start_s = record.time_s[0]
    time_s = record.time_s - start_s
    acting_s = time_s if record.command_time_s is None else record.command_time_s - start_s
    ends_s = np.append(time_s[1:], 2.0 * time_s[-1] - time_s[-2])
    inside_s = time_s[:, None] + (ends_s - time_s)[:, None] * np.linspace(0.0, 1.0, PARTS + 1)
    inside_s[:, -1] = ends_s
    instants_s = np.unique(inside_s[rows])
    if not starts_at_rest(volts):
        lead_s, lead_V = reflected(acting_s, volts)
        acting_s, volts = np.concatenate([lead_s, acting_s]), np.concatenate([lead_V, volts])
    if not linear:  # a command that is given again changes nothing
        new = np.concatenate([[True], np.diff(volts) != 0.0])
        acting_s, volts = acting_s[new], volts[new]
    simulator = Simulator(Drive(instants_s, acting_s, volts, linear))
    return ReadBack(
        simulator, np.searchsorted(instants_s, inside_s[rows]), read[rows], noise_V, span_V, record.voltage_V[rows]
    )


def _around_changes(rows: NDArray[np.intp], volts: Array) -> NDArray[np.intp]:
    """Return at most `MOST_ROWS` of some rows: those around changes of the command, which show how it is followed."""
    if rows.size <= MOST_ROWS:
        return rows
    changes = np.flatnonzero(np.diff(volts) != 0.0) + 1
    each = max(MOST_ROWS // max(changes.size, 1), LONG_HELD)
    near = np.zeros(volts.size + each, dtype=np.bool_)
    for change in changes:
        near[change - 1 : change - 1 + each] = True
    return rows[near[rows]][:MOST_ROWS]


def meter_noise(commands_V: Array, read: Array, least: float) -> float:
    """Return the noise of a meter: that of readings of a held voltage from row to row, and its resolution.

    Args:
        commands_V: (n,) of the rows.
        read: (n,) what the meter showed, in its own unit.
        least: that is returned, in the same unit.
    """
    changed = np.flatnonzero(np.concatenate([[True], np.diff(commands_V) != 0.0]))
    begun = changed[np.searchsorted(changed, np.arange(commands_V.size), side="right") - 1]
    held = np.arange(commands_V.size) - begun > LONG_HELD
    steps = np.diff(read)[held[1:]]
    spread = _TO_NORMAL * float(np.median(np.abs(steps))) / np.sqrt(2.0) if steps.size >= FEWEST_ROWS // 2 else 0.0
    levels = np.diff(np.unique(np.round(read / least, 6) * least))
    resolution = float(np.min(levels)) if levels.size else 0.0
    return max(float(np.hypot(spread, resolution / np.sqrt(12.0))), least)
