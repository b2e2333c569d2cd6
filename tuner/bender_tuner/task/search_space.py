"""Where an optimiser's point in the unit cube becomes a set of gains.

The three optimal gains of a bending actuator lie four decades apart (Ki : Kp : Kd is about 1e4 : 2e2 : 1), so a
search in raw gains with one step size stands still in two of them. `SearchSpace` therefore spans the same number of
decades around a first guess in each direction; `RawSpace` is the paper's own choice.
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.control.pid import Gains

GAIN_NAMES = ("proportional_V_per_um", "integral_V_per_um_s", "derivative_V_s_per_um")
SHORT_NAMES = ("Kp", "Ki", "Kd")
DIMENSION = len(GAIN_NAMES)
_EDGE_TOLERANCE = 1e-9
_NEAR_EDGE = 1e-3
"""Of the width of the box: with 1.5 decades either side less than one per cent of the gain."""


class GainSpace(Protocol):
    """A map between optimiser points of shape (3,) and gains."""

    def to_gains(self, x: ArrayLike) -> Gains:
        """The gains at `x`; ValueError where `x` stands for none."""
        ...

    def from_gains(self, gains: Gains) -> NDArray[np.float64]:
        """The point of shape (3,) that stands for `gains`."""
        ...


@dataclass(frozen=True, slots=True)
class SearchSpace:
    """Log-scaled box around a first guess: x = 0.5 is the guess, x = 0 and 1 lie `decades` below and above.

    Attributes:
        center: the first guess, all three gains above zero; its filter and derivative settings are kept.
        decades: half width of the box in powers of ten.
        bounds: lowest and highest value of a gain where the box shall have them in place of its decades, None for
            the others.

    Raises:
        ValueError: a gain of the centre is zero, `decades` is not a positive number, or bounds are not 0 < low < high.
    """

    center: Gains
    decades: float = 1.5
    bounds: tuple[tuple[float, float] | None, ...] = (None, None, None)

    def __post_init__(self) -> None:
        for name, value in zip(GAIN_NAMES, _as_tuple(self.center), strict=True):
            if not value > 0.0:
                raise ValueError(f"center.{name} must be > 0 on a logarithmic scale, found {value!r}")
        if not (math.isfinite(self.decades) and self.decades > 0.0):
            raise ValueError(f"decades must be a finite number > 0, found {self.decades!r}")
        for name, ends in zip(SHORT_NAMES, self.bounds, strict=True):
            if ends is not None and not 0.0 < ends[0] < ends[1] < math.inf:
                raise ValueError(f"bounds of {name} must be 0 < low < high, found {ends[0]!r} and {ends[1]!r}")

    def to_gains(self, x: ArrayLike) -> Gains:
        """Gains at `x`, shape (3,), each coordinate in [0, 1]; ValueError outside."""
        point = _checked(x)
        if np.any(point < -_EDGE_TOLERANCE) or np.any(point > 1.0 + _EDGE_TOLERANCE):
            raise ValueError(f"x must lie in [0, 1]^3, found {point.tolist()}")
        inside = np.clip(point, 0.0, 1.0)
        values = np.array(_as_tuple(self.center)) * 10.0 ** (self.decades * (2.0 * inside - 1.0))
        for k, ends in enumerate(self.bounds):
            if ends is not None:
                values[k] = min(max(ends[0] * (ends[1] / ends[0]) ** inside[k], ends[0]), ends[1])
        return _with_values(self.center, values)

    def from_gains(self, gains: Gains) -> NDArray[np.float64]:
        """Point of shape (3,) for `gains`; -inf for a gain of zero, outside [0, 1] for gains outside the box."""
        values = np.array(_as_tuple(gains))
        with np.errstate(divide="ignore"):
            point = 0.5 * (np.log10(values / np.array(_as_tuple(self.center))) / self.decades + 1.0)
            for k, ends in enumerate(self.bounds):
                if ends is not None:
                    point[k] = np.log(values[k] / ends[0]) / np.log(ends[1] / ends[0])
        return point

    def start(self) -> NDArray[np.float64]:
        """Point of shape (3,) where a search begins: the first guess, moved into the bounds where it lies outside."""
        return np.clip(self.from_gains(self.center), 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class RawSpace:
    """The paper's space: the point times one scale per gain, without bounds above.

    A coordinate below zero stands for no gains (ValueError). The derivative acts on the error and is not filtered,
    as in equation (21).

    Attributes:
        scale: Kp, Ki, Kd in V/um, V/(um s), V s/um at x = (1, 1, 1).

    Raises:
        ValueError: a scale is not a positive number.
    """

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        if len(self.scale) != DIMENSION or not all(math.isfinite(s) and s > 0.0 for s in self.scale):
            raise ValueError(f"scale must be three finite numbers > 0, found {self.scale!r}")

    def to_gains(self, x: ArrayLike) -> Gains:
        """Gains at `x`, shape (3,); ValueError where a coordinate is negative."""
        paper = Gains(0.0, 0.0, derivative_on_error=True)
        return _with_values(paper, _checked(x) * np.array(self.scale))

    def from_gains(self, gains: Gains) -> NDArray[np.float64]:
        """Point of shape (3,) for `gains`."""
        return np.array(_as_tuple(gains)) / np.array(self.scale)


def edges(space: SearchSpace, gains: Gains) -> tuple[list[str], list[str]]:
    """Return the gains on the edge of the box of decades, then those on bounds that were given.

    Each says which gain and which edge: `Kp on the lower edge`, `Kp on its lower bound`.
    """
    found: tuple[list[str], list[str]] = ([], [])
    for name, x, ends in zip(SHORT_NAMES, space.from_gains(gains).tolist(), space.bounds, strict=True):
        if x <= _NEAR_EDGE or x >= 1.0 - _NEAR_EDGE:
            side = "lower" if x <= _NEAR_EDGE else "upper"
            if ends is None:
                found[0].append(f"{name} on the {side} edge")
            else:
                found[1].append(f"{name} on its {side} bound, {ends[0] if side == 'lower' else ends[1]:g}")
    return found


def _as_tuple(gains: Gains) -> tuple[float, float, float]:
    return gains.proportional_V_per_um, gains.integral_V_per_um_s, gains.derivative_V_s_per_um


def _with_values(gains: Gains, values: NDArray[np.float64]) -> Gains:
    return replace(gains, **{name: float(value) for name, value in zip(GAIN_NAMES, values, strict=True)})


def _checked(x: ArrayLike) -> NDArray[np.float64]:
    point = np.asarray(x, dtype=float)
    if point.shape != (DIMENSION,):
        raise ValueError(f"x must have shape ({DIMENSION},), found {point.shape}")
    if not np.all(np.isfinite(point)):
        raise ValueError(f"x must be finite, found {point.tolist()}")
    return point
