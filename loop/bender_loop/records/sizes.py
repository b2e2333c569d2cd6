"""Whether the columns of a record can be in the units that they are taken for."""

import numpy as np

from bender_loop.errors import InputError
from bender_loop.records.record import Record
from bender_loop.tables.quantities import MICROMETRE, VOLT

MOST_V, MOST_UM, LONGEST_S = 1e5, 1e9, 1e8
"""A hundred kilovolts, a kilometre, three years: beyond these a column has another unit than it is taken for."""
LEAST_SPAN = 1e-50
"""Of what changes, in any unit: sums of powers of less are lost among the smallest numbers of a computer."""
SHORTEST_STEP_S = 1e-9
"""A nanosecond; the fastest digitisers of such benches take microseconds."""


def check_sizes(name: str, record: Record, untimed: bool = False) -> None:
    """Refuse a record whose columns can only be in other units.

    Args:
        name: of the record, for the message.
        record: at least one reading is there.
        untimed: its times are an order only.

    Raises:
        InputError: the duration, a voltage or a displacement is beyond what any actuator sees.
    """
    _check(name, "time_s", "spans", 0.0 if untimed else float(record.time_s[-1] - record.time_s[0]), LONGEST_S, "s")
    check_readings(name, record)
    steps_s = np.diff(record.time_s)
    if not untimed and float(np.min(steps_s)) < SHORTEST_STEP_S:
        row = int(np.argmin(steps_s))
        raise InputError(
            f"{name}: time_s grows by {steps_s[row]:.3g} s from row {row + 1} to the next, expected at least "
            f"{SHORTEST_STEP_S:g} s; name the unit of the column with --units"
        )


def check_readings(name: str, record: Record) -> None:
    """Refuse a record whose voltage or displacement is beyond what any actuator sees; InputError says which.

    Of another quantity nobody knows what is too much; what can hardly be computed with is too little of any.
    """
    reading_um = record.displacement_um[np.isfinite(record.displacement_um)]
    for column, values in (("voltage_V", record.voltage_V), ("displacement_um", reading_um)):
        span = float(np.ptp(values)) if values.size else 0.0
        if 0.0 < span < LEAST_SPAN:
            raise InputError(
                f"{name}: {column} moves by {span:.3g} in all, expected no movement or at least {LEAST_SPAN:g}; name "
                "the unit of the column with --units"
            )
    if record.quantities.command == VOLT:
        _check(name, "voltage_V", "reaches", float(np.max(np.abs(record.voltage_V))), MOST_V, "V")
    if record.quantities.reading == MICROMETRE:
        _check(name, "displacement_um", "reaches", float(np.max(np.abs(reading_um), initial=0.0)), MOST_UM, "µm")


def _check(name: str, column: str, verb: str, value: float, most: float, unit: str) -> None:
    if value > most:
        raise InputError(
            f"{name}: {column} {verb} {value:.3g} {unit}, expected at most {most:g} {unit}; "
            "name the unit of the column with --units"
        )


def check_work(name: str, duration_s: float, longest_sub_step_s: float, most_sub_steps: float) -> None:
    """Refuse a record over which the model would be computed for too long, or for want of memory never.

    Args:
        name: of the record or records, for the message.
        duration_s: from their first rows to their last.
        longest_sub_step_s: in which the model is computed between two jumps of the command; inf for one at rest.
        most_sub_steps: that are thought bearable.

    Raises:
        InputError: it takes more.
    """
    longest_s = most_sub_steps * longest_sub_step_s
    if duration_s > longest_s:
        raise InputError(
            f"{name}: time_s spans {duration_s:.4g} s, over which the model takes "
            f"{duration_s / longest_sub_step_s:.2g} sub-steps, expected at most {longest_s:.2g} s; give a part of it, "
            "name the unit of the column with --units, or say --untimed where every row is a settled pair"
        )
