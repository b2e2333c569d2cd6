"""What instruments beside the sensor show of a hidden bench: voltages on the way to the film, the warmth around it.

A lag of the supply lies before its terminals on one bench, in the leads behind them on another. Each instrument is
drawn once for a bench, so that all its records are read with the same ones. Where a form is moved away from every
equation, so are the voltages, by the same part of what the effect does there.
"""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from bender_proving.cases.hidden import Hidden, log_uniform
from bender_proving.chain import terminals_V
from bender_proving.physics import surroundings
from bender_proving.physics.lobatto import Array
from bender_proving.records.excitation import Excitation
from bender_proving.records.meters import FILM_UM_PER_K, Voltmeter, drawn_thermometer, drawn_voltmeter
from bender_proving.records.moved import moved_um

_DRIFT, _LAG = "thermal_drift", "source_resistance"
_IN_THE_LEADS = 0.5
Shown = Callable[[Excitation, tuple[Hidden, ...], float, Generator, Generator], Array]


def supply_voltage_V(
    plan: Excitation, hidden: tuple[Hidden, ...], moved: float, bench: Generator, chance: Generator
) -> Array:
    """What the supply reads back of its terminals, once in every row that is recorded.

    On every second bench, the resistance that makes the film lag is one of the leads: the terminals do not show it.

    Args:
        plan: what is played.
        hidden: what is hidden in the bench.
        moved: rms of what no form of the effect has, over the size of the effect.
        bench: draws what is the same in all records of the bench.
        chance: draws what is not.
    """
    voltmeter = drawn_voltmeter(bench)
    if bench.random() < _IN_THE_LEADS:
        hidden = tuple(x for x in hidden if x.id != _LAG)
    return _shown_V(voltmeter, plan, hidden, moved, bench, chance)


def electrode_voltage_V(
    plan: Excitation, hidden: tuple[Hidden, ...], moved: float, bench: Generator, chance: Generator
) -> Array:
    """What a probe at the electrodes shows, once in every row that is recorded; arguments as for the supply."""
    return _shown_V(drawn_voltmeter(bench), plan, hidden, moved, bench, chance)


def _shown_V(
    voltmeter: Voltmeter,
    plan: Excitation,
    hidden: tuple[Hidden, ...],
    moved: float,
    bench: Generator,
    chance: Generator,
) -> Array:
    rows = plan.recorded
    at_s = voltmeter.instants_s(plan.time_s, chance)
    put_out_V = terminals_V(plan.commands, hidden, at_s)[rows]
    if moved > 0.0:
        following_V = terminals_V(plan.commands, (), at_s)[rows]
        put_out_V = put_out_V + moved * moved_um(put_out_V, following_V, plan, bench)
    return voltmeter.shown_V(put_out_V, chance)


def temperature_C(
    plan: Excitation, hidden: tuple[Hidden, ...], _moved: float, bench: Generator, chance: Generator
) -> Array:
    """What a thermometer near the film shows in every row that is recorded; arguments as for the supply."""
    thermometer = drawn_thermometer(bench)
    um_per_K = float(bench.choice([-1.0, 1.0])) * log_uniform(bench, *FILM_UM_PER_K)
    still = np.zeros(len(plan.time_s))
    drifts = (surroundings.surround(x, still, plan.time_s) for x in hidden if x.id == _DRIFT)
    return thermometer.shown_C(plan.time_s, sum(drifts, start=still) / um_per_K, chance)[plan.recorded]


COLUMNS: dict[str, Shown] = {
    "supply_voltage_V": supply_voltage_V,
    "electrode_voltage_V": electrode_voltage_V,
    "temperature_C": temperature_C,
}
"""Columns of a record that a bench can be asked for."""
