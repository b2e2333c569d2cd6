"""Setpoints over time, each an equation in its own frozen settings.

Every reference has `sample(times)`, the setpoints in um at an array of times in s, and `value(time_s)` for one time.
A corner at time T counts as reached at T even where k * period falls a rounding error short of it.
"""

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.errors import InputError
from bender_loop.tables.table import ColumnTable, Table, read_table

Array = NDArray[np.float64]
_CORNER_S = 1e-9


class Reference(Protocol):
    """A setpoint over time."""

    def value(self, time_s: float) -> float:
        """Setpoint in um at `time_s`."""
        ...

    def sample(self, times: ArrayLike) -> Array:
        """Setpoints in um at `times` in s, of the same shape."""
        ...


class _Sampled(ABC):
    """`value` from `sample`, so that each equation is written once."""

    __slots__ = ()

    @abstractmethod
    def sample(self, times: ArrayLike) -> Array:
        """Setpoints in um at `times` in s."""

    def value(self, time_s: float) -> float:
        """Setpoint in um at `time_s`."""
        return float(self.sample(time_s))


def _check_finite(owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        for entry in value if isinstance(value, tuple) else (value,):
            if not math.isfinite(entry):
                raise ValueError(f"{name} must be finite, found {entry!r}")


def _check_positive(owner: object, *names: str) -> None:
    _check_finite(owner, *names)
    for name in names:
        value = getattr(owner, name)
        for entry in value if isinstance(value, tuple) else (value,):
            if entry <= 0.0:
                raise ValueError(f"{name} must be > 0, found {entry!r}")


@dataclass(frozen=True, slots=True)
class Step(_Sampled):
    """`initial_um` before `time_s`, `level_um` from then."""

    level_um: float
    time_s: float = 0.0
    initial_um: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "level_um", "time_s", "initial_um")

    def sample(self, times: ArrayLike) -> Array:
        """Setpoints in um at `times` in s."""
        return np.where(np.asarray(times) >= self.time_s - _CORNER_S, self.level_um, self.initial_um)


@dataclass(frozen=True, slots=True)
class Sine(_Sampled):
    """offset + amplitude sin(2 pi f t + phase)."""

    amplitude_um: float
    frequency_Hz: float
    offset_um: float = 0.0
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "amplitude_um", "offset_um", "phase_rad")
        _check_positive(self, "frequency_Hz")

    def sample(self, times: ArrayLike) -> Array:
        """Setpoints in um at `times` in s."""
        angle = 2.0 * math.pi * self.frequency_Hz * np.asarray(times, dtype=float) + self.phase_rad
        return self.offset_um + self.amplitude_um * np.sin(angle)


@dataclass(frozen=True, slots=True)
class Profile(_Sampled):
    """Setpoints from a list: each holds from its time to the next, the first also before."""

    times_s: tuple[float, ...]
    setpoints_um: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "times_s", tuple(self.times_s))
        object.__setattr__(self, "setpoints_um", tuple(self.setpoints_um))
        lengths = len(self.times_s), len(self.setpoints_um)
        if len(set(lengths)) != 1 or not lengths[0]:
            raise ValueError(f"times_s and setpoints_um must be of one length > 0, found {lengths}")
        _check_finite(self, "times_s", "setpoints_um")
        if any(later <= earlier for earlier, later in zip(self.times_s, self.times_s[1:], strict=False)):
            raise ValueError("times_s must increase strictly")

    def sample(self, times: ArrayLike) -> Array:
        """Setpoints in um at `times` in s."""
        index = np.searchsorted(self.times_s, np.asarray(times, dtype=float) + _CORNER_S, side="right") - 1
        return np.asarray(self.setpoints_um, dtype=float)[np.maximum(index, 0)]

    def value(self, time_s: float) -> float:
        """Setpoint in um at `time_s`; without an array, which takes a loop at 1 kHz a twentieth of its time."""
        return self.setpoints_um[max(bisect_right(self.times_s, time_s + _CORNER_S) - 1, 0)]


def read_profile(path: Path) -> Profile:
    """Read a setpoint profile from a CSV file with the columns `time_s` and `setpoint_um`.

    Raises:
        InputError: naming the file, the line, the column, what was found and what was expected.
    """
    return _profile(read_table(path), str(path))


def profile_from_columns(given: Mapping[str, ArrayLike], name: str) -> Profile:
    """Make a setpoint profile of the columns `time_s` and `setpoint_um`, as a DataFrame has them.

    Raises:
        InputError: naming the table, the row (from 0), the column, what was found and what was expected.
    """
    return _profile(ColumnTable(name, given), name)


def _profile(table: Table | ColumnTable, name: str) -> Profile:
    columns = {x: table.numbers(x) for x in ("time_s", "setpoint_um")}
    for column, values in columns.items():
        for row in np.flatnonzero(~np.isfinite(values)):
            raise table.fault(int(row), column, repr(float(values[row])), "a finite number")
    time = columns["time_s"]
    for row in np.flatnonzero(time[1:] <= time[:-1]) + 1:
        raise table.fault(int(row), "time_s", f"{float(time[row])!r}", f"more than {float(time[row - 1])!r} before it")
    try:
        return Profile(tuple(time.tolist()), tuple(columns["setpoint_um"].tolist()))
    except ValueError as error:
        raise InputError(f"{name}: {error}") from error
