"""Whether the columns of a record can be in the units that they are taken for."""

import numpy as np

from bender_loop.errors import InputError
from bender_loop.records.record import Record

MOST_V, MOST_UM, LONGEST_S = 1e5, 1e9, 1e8
"""A hundred kilovolts, a kilometre, three years: beyond these a column has another unit than it is taken for."""


def check_sizes(name: str, record: Record, untimed: bool = False) -> None:
    """Refuse a record whose columns can only be in other units.

    Args:
        name: of the record, for the message.
        record: at least one reading is there.
        untimed: its times are an order only.

    Raises:
        InputError: the duration, a voltage or a displacement is beyond what any actuator sees.
    """
    reading_um = record.displacement_um[np.isfinite(record.displacement_um)]
    found = (
        ("time_s", "spans", 0.0 if untimed else float(record.time_s[-1] - record.time_s[0]), LONGEST_S, "s"),
        ("voltage_V", "reaches", float(np.max(np.abs(record.voltage_V))), MOST_V, "V"),
        ("displacement_um", "reaches", float(np.max(np.abs(reading_um), initial=0.0)), MOST_UM, "um"),
    )
    for column, verb, value, most, unit in found:
        if value > most:
            raise InputError(
                f"{name}: {column} {verb} {value:.3g} {unit}, expected at most {most:g} {unit}; "
                "name the unit of the column with --units"
            )
