"""How a record begins is a hypothesis: from rest, in the middle of a motion, or at a place on a loop.

A first guess is made with the model as given. The search weighs it against the others with the effects that it finds.
A start in motion gives the drive a lead-in.

One sine at one amplitude has been running before as it runs in the record. Of anything else nobody knows what was
commanded: either the command is continued backwards by reflection, after it stood at its mean for long beside the
record, or it stood at one voltage until the first row. That voltage is fitted: what a plant remembers at the first row
is often one number. Neither tells how the mode passed the first row, so there are no readings until that has rung out.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from bender_compiled.simulation import Drive, Simulator
from bender_inference.records.excitation import one_sine, sine_frequency_Hz
from bender_inference.records.observations import Array, Observations, Start
from bender_inference.records.ringing import rung_out
from bender_loop.records.compare import recalibrate
from bender_loop.records.initial_motion import clearly_better, reflected, starts_at_rest
from bender_loop.records.record import Record
from bender_plant.model import Model, ModelError

STOOD_PER_DURATION = 10.0
LONGEST_STAND_S, LEAST_DURATIONS = 300.0, 3.0
"""A plant stood for so long, and for so many times the record at least: what relaxes more slowly moves in neither."""
COARSER = 8.0
# rows of the beginning that are simulated: what comes later says little of it
MOST_ROWS = 200_000
# rows, once the mode has rung out, that tell at what voltage the plant stood; fewer than three tell nothing
STOOD_ROWS, FEWEST_ROWS = 20_000, 3
# part of the range: a voltage that is nearer is no other place
AWAY = 0.1
# voltages that the plant may have stood at, tried before the best one is sought around the best of them
STOOD_AT = 9
STOOD_WITHIN = 1e-3
# of the mean square that is left
NO_DIFFERENCE = 1e-6


def started(base: Model, record: Record, seen: Observations) -> Observations:
    """Return the observations of a record with a lead-in, where the model as given meets its start better then."""
    if starts_at_rest(record.voltage_V):
        return seen
    beginning = _beginning(record)
    try:
        from_rest = _simulated(base, _until(seen.drive, beginning))
        met = _in_motion(base, seen, beginning)
    except (ModelError, ArithmeticError):
        return seen
    if not any(clearly_better(beginning, y, from_rest) for x, y in met if x.rest_before_V is None or _is_away(x)):
        return seen
    return _nearest(met)


def moving(base: Model, record: Record, seen: Observations) -> Observations:
    """Return the observations of a record that begins in motion, with the lead-in that a model meets better."""
    try:
        return _nearest(_in_motion(base, seen, _beginning(record)))
    except (ModelError, ArithmeticError):
        return in_motion_from(seen, base)


_Met = tuple[Observations, Array]


def _in_motion(base: Model, seen: Observations, beginning: Record) -> list[_Met]:
    """Return the observations of a record with each lead-in of a start in motion, and what a model reads then."""
    stood = standing_before(base, seen)
    others = [in_motion_from(seen, base), *([stood] if stood is not None else [])]
    return [(x, _simulated(base, _until(x.drive, beginning))) for x in others]


def _nearest(met: Sequence[_Met]) -> Observations:
    return min(met, key=lambda x: _left_um2(*x))[0]


def _is_away(stood: Observations) -> bool:
    """Return whether the voltage that a plant stood at until the first row is no way near 0."""
    volts = stood.drive.voltage_V
    return abs(float(volts[0])) > AWAY * float(np.max(np.abs(volts)))


def _beginning(record: Record) -> Record:
    early = slice(0, MOST_ROWS)
    return Record(record.time_s[early], record.voltage_V[early], record.displacement_um[early])


def _simulated(model: Model, drive: Drive) -> Array:
    return Simulator(drive, coarser=COARSER).run(model).reading_um


def _left_um2(seen: Observations, simulated_um: Array) -> float:
    """Return the mean square that recalibrated readings of the beginning leave on rows of fits; inf without any."""
    rows = np.flatnonzero(seen.training[: simulated_um.size])
    if rows.size < FEWEST_ROWS:
        return math.inf
    measured, simulated = seen.measured_um[rows], simulated_um[rows]
    return float(np.mean(np.square(measured - recalibrate(measured, simulated).apply(simulated))))


def _until(drive: Drive, beginning: Record) -> Drive:
    """Return a drive until the last row of the beginning of a record."""
    rows = len(beginning)
    commands = drive.voltage_V.size - drive.row_time_s.size + rows
    return replace(
        drive,
        row_time_s=drive.row_time_s[:rows],
        command_time_s=drive.command_time_s[:commands],
        voltage_V=drive.voltage_V[:commands],
    )


def in_motion_from(seen: Observations, model: Model) -> Observations:
    """Return the observations of a record with a lead-in: the motion went on before as it goes on in the record."""
    led = replace(seen, drive=_with_lead_in(seen.drive), start="motion")
    return led if one_sine(seen.time_s, seen.command_V) else rung_out(led, model)


def standing_before(model: Model, seen: Observations) -> Observations | None:
    """Return the observations of a record with the voltage that a plant stood at until its first row.

    It is the one from which a model leaves least. None where the model cannot be simulated, and where one sine has been
    running.

    Args:
        model: with the effects that are known of.
        seen: the observations of a record, from rest.
    """
    if one_sine(seen.time_s, seen.command_V):
        return None
    heard = rung_out(seen, model)
    rows = min(int(np.argmax(heard.training)) + STOOD_ROWS, seen.measured_um.size)
    beginning = Record(seen.time_s[:rows], seen.command_V[:rows], seen.measured_um[:rows])

    def left_um2(volts: float) -> float:
        try:
            return _left_um2(heard, _simulated(model, _until(_standing(seen.drive, volts), beginning)))
        except (ModelError, ArithmeticError):
            return math.inf

    low, high = min(0.0, float(np.min(seen.command_V))), max(0.0, float(np.max(seen.command_V)))
    left, volts = min(_lowest(left_um2, np.linspace(low, high, STOOD_AT)), default=(math.inf, 0.0))
    if not math.isfinite(left):
        return None
    return replace(heard, drive=_standing(seen.drive, volts), start="from_voltage")


def _lowest(of: Callable[[float], float], places: Array) -> Iterator[tuple[float, float]]:
    """Return every minimum of a function among places in order, each as its value and where it is.

    There may be several: equation (30) remembers the same after two voltages.
    """
    values = [math.inf, *(of(float(x)) for x in places), math.inf]
    for k, place in enumerate(places):
        # what makes no difference has one minimum
        if values[k + 1] >= values[k] * (1.0 - NO_DIFFERENCE) or values[k + 1] > values[k + 2]:
            continue
        yield values[k + 1], float(place)
        around = (float(places[max(k - 1, 0)]), float(places[min(k + 1, places.size - 1)]))
        near = minimize_scalar(of, bounds=around, method="bounded", options={"xatol": STOOD_WITHIN * np.ptp(places)})
        yield float(near.fun), float(near.x)


def beginnings(seen: Observations, model: Model) -> tuple[Observations, ...]:
    """Return the observations of a record with each beginning that it may have, rest first.

    Args:
        seen: the observations of the record, from rest.
        model: with the effects that are known of. It tells how long the mode rings from before the record, and at what
            voltage the plant stood.
    """
    volts = seen.command_V
    ends: tuple[tuple[Start, float], ...] = (("from_above", float(np.max(volts))), ("from_below", float(np.min(volts))))
    placed = [
        rung_out(replace(seen, drive=_coming_from(seen.drive, end), start=name), model)
        for name, end in ends
        if abs(end - float(volts[0])) > AWAY * float(np.ptp(volts))
    ]
    stood = standing_before(model, seen)
    return (seen, in_motion_from(seen, model), *placed, *([stood] if stood is not None else []))


def _standing(drive: Drive, volts: float) -> Drive:
    """Return a drive that stood at one voltage for long, until the first command of the record."""
    first_s = float(drive.command_time_s[0])
    command_s = np.concatenate([[first_s - _rest_before_s(drive)], drive.command_time_s])
    return replace(drive, command_time_s=command_s, voltage_V=np.concatenate([[volts], drive.voltage_V]))


def _rest_before_s(drive: Drive) -> float:
    duration_s = float(drive.row_time_s[-1] - drive.row_time_s[0])
    return min(STOOD_PER_DURATION * duration_s, max(LONGEST_STAND_S, LEAST_DURATIONS * duration_s))


def _coming_from(drive: Drive, volts: float) -> Drive:
    """Return a drive that stood at one voltage, then at that of the first row, both for long."""
    voltage_V, stood_s = drive.voltage_V, _rest_before_s(drive)
    first_s = float(drive.command_time_s[0])
    before_s = np.array([first_s - 2.0 * stood_s, first_s - stood_s])
    command_s = np.concatenate([before_s, drive.command_time_s])
    return replace(drive, command_time_s=command_s, voltage_V=np.concatenate([[volts, voltage_V[0]], voltage_V]))


def _with_lead_in(drive: Drive) -> Drive:
    time_s, voltage_V = drive.row_time_s, drive.voltage_V
    lead_s, lead_V = reflected(time_s, voltage_V)
    if one_sine(time_s, voltage_V):
        lead_V = _continued(time_s, voltage_V, lead_s)
    before_s = np.concatenate([[lead_s[0] - _rest_before_s(drive)], lead_s])
    before_V = np.concatenate([[float(voltage_V.mean())], lead_V])
    command_s = np.concatenate([before_s, drive.command_time_s])
    return replace(drive, command_time_s=command_s, voltage_V=np.concatenate([before_V, voltage_V]))


def _continued(time_s: Array, voltage_V: Array, lead_s: Array) -> Array:
    """Return the commands of a periodic record before its first row, whole periods earlier."""
    period_s = 1.0 / sine_frequency_Hz(time_s, voltage_V)
    later = lead_s + period_s * np.ceil((time_s[0] - lead_s) / period_s)
    return np.interp(later, time_s, voltage_V)
