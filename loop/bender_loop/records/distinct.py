"""Records that are given together are different ones."""

from collections.abc import Sequence

import numpy as np

from bender_loop.errors import InputError
from bender_loop.records.record import Record


def refuse_twice_the_same(names: Sequence[str], records: Sequence[Record]) -> None:
    """Refuse a record that is given twice.

    Raises:
        InputError: naming both.
    """
    for k, (name, record) in enumerate(zip(names, records, strict=True)):
        for other, before in zip(names[:k], records[:k], strict=True):
            if np.array_equal(record.displacement_um, before.displacement_um, equal_nan=True):
                raise InputError(
                    f"{name}: found the readings of {other} again, expected another record; they would count twice"
                )
