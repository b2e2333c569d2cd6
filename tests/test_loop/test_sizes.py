import numpy as np
import pytest

from bender_loop.errors import InputError
from bender_loop.records.record import Record
from bender_loop.records.sizes import LONGEST_S, MOST_UM, MOST_V, check_sizes

STEPS = np.linspace(0.0, 1.0, 5)


def test_the_largest_sizes_are_taken() -> None:
    check_sizes("a", Record(LONGEST_S * STEPS, -MOST_V * STEPS, -MOST_UM * STEPS))
    check_sizes("a", Record(STEPS, STEPS, np.full(5, np.nan)))
    check_sizes("a", Record(1e12 * STEPS, STEPS, STEPS), untimed=True)


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (Record(1e9 * STEPS, STEPS, STEPS), r"a: time_s spans 1e\+09 s, expected at most 1e\+08 s"),
        (Record(STEPS, -1e6 * STEPS, STEPS), r"a: voltage_V reaches 1e\+06 V, expected at most 100000 V"),
        (Record(STEPS, STEPS, -1e300 * STEPS), r"a: displacement_um reaches 1e\+300 µm, expected at most 1e\+09 µm"),
    ],
)
def test_other_units_are_told(record: Record, says: str) -> None:
    with pytest.raises(InputError, match=says):
        check_sizes("a", record)
