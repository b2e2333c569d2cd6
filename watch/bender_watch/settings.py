"""How a device is watched."""

import math
import re
from dataclasses import dataclass

from bender_loop.errors import InputError

UNITS_S = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}
LEAST_ROWS, MOST_ROWS = 100.0, 1e12


@dataclass(frozen=True, slots=True)
class Settings:
    """How a device is watched.

    Attributes:
        rows_between_false_alarms: mean, of all tests together.
        learn_rows: of the watched record, where there is no training record.
        linear: the command runs straight from row to row.
        diagnose: an alarm is followed by a diagnosis of the rows since the change.
        adopt: the corrected model of a diagnosis takes the place of the old one.
        explain_rows: a diagnosis waits for so many rows in which all of the change is there, or the end.
        tolerance: of the stroke, as a part of it, that a trend may take up.

    Raises:
        InputError: a setting is out of its range.
    """

    rows_between_false_alarms: float = 1e6
    learn_rows: int = 2000
    linear: bool = False
    diagnose: bool = True
    adopt: bool = True
    explain_rows: int = 1000
    tolerance: float = 0.05

    def __post_init__(self) -> None:
        if not LEAST_ROWS <= self.rows_between_false_alarms <= MOST_ROWS:
            raise InputError(
                f"between false alarms: found {self.rows_between_false_alarms:g} rows, expected {LEAST_ROWS:g} to "
                f"{MOST_ROWS:g}"
            )
        if not 200 <= self.learn_rows <= 40_000:
            raise InputError(f"learn: found {self.learn_rows} rows, expected 200 to 40000")
        if not 64 <= self.explain_rows <= 20_000:
            raise InputError(f"explain after: found {self.explain_rows} rows, expected 64 to 20000")
        if not (math.isfinite(self.tolerance) and 0.0 < self.tolerance < 1.0):
            raise InputError(f"tolerance: found {100.0 * self.tolerance:g} %, expected between 0 and 100 %")


def rows_of(text: str, interval_s: float | None = None) -> float:
    """Return how many rows a word says: "1e6", or "30d" at so many seconds from row to row.

    Raises:
        InputError: it is neither, or a time where the interval is not known yet.
    """
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(s|min|h|d|w|)\s*", text)
    try:
        number = float(found[1]) if found else math.nan
    except ValueError:
        number = math.nan
    if found is None or not number > 0.0:
        raise InputError(f"found {text!r}, expected rows as 1e6, or a time as 30d (s, min, h, d, w)")
    if not found[2]:
        return number
    if interval_s is None:
        raise InputError(f"found {text!r}, expected rows, or --training beside it: the time between rows is not known")
    return number * UNITS_S[found[2]] / interval_s
