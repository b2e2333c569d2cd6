"""A linear plant as the controller's samples see it: its pulse response and what remains of it.

y[k] = sum_{j >= 1} h[j] u[k-j], with h[N+m] = h[N] r^m after the last recorded sample (a relaxation that is still
going on; r = 1 is an integrating plant). h[0] = 0, because a sample is read before the voltage of its instant acts.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

_TAIL_SHARE = 0.25
_TAIL_MISFIT = 0.05
_TAIL_NEGLIGIBLE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class SampledModel:
    """Pulse response at one sampling period.

    Attributes:
        period_s: the sampling period Ts.
        pulse_um_per_V: h[1..N], shape (N,): the response to 1 V held for one period.
        tail_ratio: r in [0, 1], by which the response falls per sample after the last one.

    Raises:
        ValueError: a period that is not positive, an empty or non-finite response, a ratio outside [0, 1].
    """

    period_s: float
    pulse_um_per_V: NDArray[np.float64]
    tail_ratio: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period_s) and self.period_s > 0.0):
            raise ValueError(f"period_s must be a finite number > 0, found {self.period_s!r}")
        pulse = np.array(self.pulse_um_per_V, dtype=float)
        if pulse.ndim != 1 or pulse.size == 0 or not np.all(np.isfinite(pulse)):
            raise ValueError(f"pulse_um_per_V must be a finite array of shape (N,), found shape {pulse.shape}")
        if not 0.0 <= self.tail_ratio <= 1.0:
            raise ValueError(f"tail_ratio must lie in [0, 1], found {self.tail_ratio!r}")
        pulse.setflags(write=False)
        object.__setattr__(self, "pulse_um_per_V", pulse)

    @property
    def dc_gain_um_per_V(self) -> float:
        """Displacement per volt after everything has settled; infinite for an integrating plant."""
        last = float(self.pulse_um_per_V[-1])
        total = float(np.sum(self.pulse_um_per_V))
        if self.tail_ratio == 0.0 or last == 0.0:
            return total
        if self.tail_ratio == 1.0:
            return math.copysign(math.inf, last)
        return total + last * self.tail_ratio / (1.0 - self.tail_ratio)

    def frequency_response(self, omega_rad_per_s: ArrayLike) -> NDArray[np.complex128]:
        """G(exp(j omega Ts)) in um/V, of the shape of `omega_rad_per_s` (0 < omega <= pi/Ts)."""
        inverse_z = np.exp(-1j * np.asarray(omega_rad_per_s, dtype=float) * self.period_s)
        polynomial = np.polynomial.polynomial.polyval(inverse_z, np.append(0.0, self.pulse_um_per_V))
        return polynomial + self._tail_response(inverse_z)

    def uniform_response(self, intervals: int) -> NDArray[np.complex128]:
        """The same at omega = pi/Ts * i/intervals for i = 0..intervals, by FFT; entry 0 is the DC gain.

        Raises:
            ValueError: fewer intervals than half the samples of the response.
        """
        if 2 * intervals <= self.pulse_um_per_V.size:
            raise ValueError(f"intervals must exceed {self.pulse_um_per_V.size // 2}, found {intervals}")
        spectrum = np.fft.rfft(np.append(0.0, self.pulse_um_per_V), 2 * intervals)
        inverse_z = np.exp(-1j * np.pi * np.arange(1, intervals + 1) / intervals)
        spectrum[1:] += self._tail_response(inverse_z)
        spectrum[0] = self.dc_gain_um_per_V
        return spectrum

    def step_response(self, count: int) -> NDArray[np.float64]:
        """Displacement per volt at samples 0..count-1 after a unit step at sample 0, shape (count,)."""
        extra = max(0, count - 1 - self.pulse_um_per_V.size)
        tail = self.pulse_um_per_V[-1] * self.tail_ratio ** np.arange(1, extra + 1)
        pulse = np.concatenate(([0.0], self.pulse_um_per_V, tail))[:count]
        return np.cumsum(pulse)

    def scaled(self, factor: float) -> "SampledModel":
        """The plant with its reading multiplied by `factor`."""
        return replace(self, pulse_um_per_V=self.pulse_um_per_V * factor)

    def _tail_response(self, inverse_z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        if self.tail_ratio == 0.0:
            return np.zeros_like(inverse_z)
        start = self.pulse_um_per_V[-1] * inverse_z ** (self.pulse_um_per_V.size + 1)
        return start * self.tail_ratio / (1.0 - self.tail_ratio * inverse_z)


def model_from_step(period_s: float, step_um_per_V: ArrayLike) -> SampledModel:
    """The model behind a unit step response s[0..N], shape (N+1,), s[0] read as the step starts."""
    pulse = np.diff(np.asarray(step_um_per_V, dtype=float))
    return SampledModel(period_s, pulse, _tail_ratio(pulse))


def _tail_ratio(pulse: NDArray[np.float64]) -> float:
    """The ratio of the last quarter's geometric decay; 0 where it has died out or is not geometric."""
    tail = pulse[-max(4, int(_TAIL_SHARE * pulse.size)) :]
    energy = float(np.dot(tail[:-1], tail[:-1]))
    if tail.size < 4 or math.sqrt(energy) <= _TAIL_NEGLIGIBLE * float(np.max(np.abs(pulse))):
        return 0.0
    ratio = float(np.dot(tail[:-1], tail[1:])) / energy
    misfit = float(np.linalg.norm(tail[1:] - ratio * tail[:-1]))
    if not ratio > 0.0 or misfit > _TAIL_MISFIT * math.sqrt(energy):
        return 0.0
    return min(ratio, 1.0)
