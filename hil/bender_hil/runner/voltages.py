"""Voltages over time for open-loop runs: the staircase and the sine of the paper, or a file."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_loop.control.references import Profile, read_profile
from bender_loop.errors import InputError
from bender_loop.shell.files import read_text_file
from bender_loop.tables.table import Table, read_table

BUILT_IN = ("staircase", "sine")
STAIR_V, STAIR_TOP_V, STAIR_DWELL_S = 1.0, 50.0, 0.2
SINE_V, SINE_HZ, SINE_OFFSET_V, SINE_CYCLES = 10.0, 0.5, 10.0, 5
_SINE_RATE_HZ = 50.0
_CORNER_S = 1e-9
LONGEST_S = 1e6
"""Of a run: eleven days."""
_MOST_BYTES = 1 << 26


@dataclass(frozen=True, slots=True)
class Voltages:
    """Levels that hold from their time on, the first also before.

    Attributes:
        times_s: strictly increasing.
        levels_V: of the same length, finite.
        duration_s: length of a run with them.

    Raises:
        ValueError: a rule is broken.
    """

    times_s: tuple[float, ...]
    levels_V: tuple[float, ...]
    duration_s: float

    def __post_init__(self) -> None:
        if not self.times_s or len(self.times_s) != len(self.levels_V):
            raise ValueError(
                f"times_s and levels_V must be of one length > 0, found {len(self.times_s)} and {len(self.levels_V)}"
            )
        if any(later <= earlier for earlier, later in zip(self.times_s, self.times_s[1:], strict=False)):
            raise ValueError("times_s must increase strictly")
        for level in self.levels_V:
            if not math.isfinite(level):
                raise ValueError(f"levels_V must be finite, found {level!r}")
        if not self.duration_s > 0.0:
            raise ValueError(f"duration_s must be > 0, found {self.duration_s!r}")

    def at(self, time_s: float) -> float:
        """The level at `time_s`."""
        return self.levels_V[max(bisect_right(self.times_s, time_s + _CORNER_S) - 1, 0)]


def staircase(top_V: float = STAIR_TOP_V, dwell_s: float = STAIR_DWELL_S) -> Voltages:
    """0 V to the top and back in equal steps, as for Figure 8 of the paper."""
    count = round(top_V / STAIR_V)
    levels = [STAIR_V * k for k in [*range(count + 1), *range(count - 1, -1, -1)]]
    times = [dwell_s * k for k in range(len(levels))]
    return Voltages(tuple(times), tuple(levels), dwell_s * len(levels))


def sine(*, both_polarities: bool = False) -> Voltages:
    """The sine of Figure 5, 10 V at 0.5 Hz, from 0 V on.

    Args:
        both_polarities: around 0 V, as a function generator gives it; else raised by 10 V, for a supply.
    """
    count = round(SINE_CYCLES / SINE_HZ * _SINE_RATE_HZ)
    times = np.arange(count) / _SINE_RATE_HZ
    angle = 2.0 * math.pi * SINE_HZ * times
    levels = SINE_V * np.sin(angle) if both_polarities else SINE_OFFSET_V - SINE_V * np.cos(angle)
    return Voltages(tuple(times.tolist()), tuple(levels.tolist()), count / _SINE_RATE_HZ)


def read_profile_file(name: str, *, both_polarities: bool = False) -> Voltages | Profile:
    """A built-in profile, or a CSV file with `time_s` and either `voltage_V` (open loop) or `setpoint_um`.

    Args:
        name: of the profile or path of the file.
        both_polarities: whether the source can go below 0 V, for the built-in sine.

    Raises:
        InputError: naming the file, the line, the column, what was found and what was expected.
    """
    path = Path(name)
    if name in BUILT_IN and not path.exists():
        return staircase() if name == "staircase" else sine(both_polarities=both_polarities)
    read_text_file(path, _MOST_BYTES, "a profile (CSV) with time_s and voltage_V or setpoint_um")
    table = read_table(path)
    if "voltage_V" in table:
        return _voltages(path, table)
    profile = read_profile(path)
    _check_length(path, profile.times_s)
    return profile


def _check_length(path: Path, times_s: Sequence[float]) -> None:
    length_s = times_s[-1] - min(times_s[0], 0.0)
    if not length_s <= LONGEST_S:
        raise InputError(f"{path}: time_s spans {length_s:.3g} s, expected at most {LONGEST_S:g} s")


def _voltages(path: Path, table: Table) -> Voltages:
    time, level = table.numbers("time_s"), table.numbers("voltage_V")
    for column, values in (("time_s", time), ("voltage_V", level)):
        for row in np.flatnonzero(~np.isfinite(values)):
            raise table.fault(int(row), column, repr(float(values[row])), "a finite number")
    for row in np.flatnonzero(time[1:] <= time[:-1]) + 1:
        raise table.fault(int(row), "time_s", f"{float(time[row])!r}", f"more than {float(time[row - 1])!r} before it")
    if not len(time):
        raise InputError(f"{path}: found no rows below the header, expected at least 1")
    _check_length(path, time.tolist())
    last_s = float(time[-1] - time[-2]) if len(time) > 1 else 1.0
    start_s = float(time[0])
    times = (time - start_s).tolist()
    return Voltages(tuple(times), tuple(level.tolist()), float(time[-1]) - start_s + last_s)
