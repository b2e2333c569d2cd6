"""How a camera sees the plant: rate, latency, exposure, noise, quantisation."""

import math
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Sampling:
    """When frames are taken and what becomes of the displacement in them. Frame k is taken at k / rate_Hz.

    Attributes:
        rate_Hz: frames, and so commands, per second.
        latency_frames: the controller at tick k works with the frame of tick k - latency_frames, and with the
            first frame as long as there is none.
        exposure_s: a frame shows the mean over this time, which ends at the instant of the frame; 0 is a snapshot.
        noise_um: standard deviation of the white noise on a frame.
        quantum_um: frames are rounded to multiples of this, after the noise; 0 for none.
        substeps: equal plant steps in a period; with more than one the trace shows the time between the frames,
            and an exposure must span at least two.

    Raises:
        ValueError: a value is out of its range.
    """

    rate_Hz: float
    latency_frames: int = 0
    exposure_s: float = 0.0
    noise_um: float = 0.0
    quantum_um: float = 0.0
    substeps: int = 1

    def __post_init__(self) -> None:
        if not math.isfinite(self.rate_Hz) or self.rate_Hz <= 0.0:
            raise ValueError(f"rate_Hz must be a finite number > 0, found {self.rate_Hz!r}")
        for name in ("exposure_s", "noise_um", "quantum_um"):
            value = getattr(self, name)
            if not math.isfinite(value) or value < 0.0:
                raise ValueError(f"{name} must be a finite number >= 0, found {value!r}")
        for name, least in (("latency_frames", 0), ("substeps", 1)):
            value = getattr(self, name)
            if not isinstance(value, Integral) or value < least:
                raise ValueError(f"{name} must be a whole number >= {least}, found {value!r}")
        self._check_exposure()

    def _check_exposure(self) -> None:
        if self.exposure_s > self.period_s * (1.0 + 1e-12):
            raise ValueError(f"exposure_s must be at most the period {self.period_s:.4g} s, found {self.exposure_s!r}")
        if 0.0 < self.exposure_s < 2.0 * self.plant_step_s * (1.0 - 1e-12):
            least = math.ceil(2.0 * self.period_s / self.exposure_s - 1e-9)
            raise ValueError(
                f"substeps must be at least {least} for exposure_s {self.exposure_s!r}, found {self.substeps}"
            )

    @property
    def period_s(self) -> float:
        """Time from frame to frame."""
        return 1.0 / self.rate_Hz

    @property
    def plant_step_s(self) -> float:
        """Time of one plant step."""
        return self.period_s / self.substeps

    def ticks(self, duration_s: float) -> int:
        """Whole periods in `duration_s`, at least one.

        Raises:
            ValueError: it is shorter than one period.
        """
        ticks = math.floor(duration_s * self.rate_Hz * (1.0 + 1e-12) + 1e-9) if math.isfinite(duration_s) else 0
        if ticks < 1:
            raise ValueError(f"duration_s must be at least the period {self.period_s!r} s, found {duration_s!r}")
        return ticks

    def exposure_weights(self) -> NDArray[np.float64]:
        """Weights (substeps,) of the outputs at the ends of a period's plant steps in the frame that ends it.

        The mean over the exposure of the straight lines between the outputs. In the first step, which may begin
        with a jump because the command acts there, the output counts as constant.
        """
        weights = np.zeros(self.substeps)
        if self.exposure_s == 0.0:
            weights[-1] = 1.0
            return weights
        opened = self.substeps * max(0.0, 1.0 - self.exposure_s * self.rate_Hz)
        for cell in range(math.floor(opened), self.substeps):
            dark = max(opened - cell, 0.0)
            if cell == 0:
                weights[0] += 1.0 - dark
            else:
                weights[cell - 1] += 0.5 * (1.0 - dark) ** 2
                weights[cell] += 0.5 * (1.0 - dark**2)
        return weights / weights.sum()

    def noise(self, count: int, rng: np.random.Generator | None) -> NDArray[np.float64]:
        """Noise of `count` frames in um.

        Raises:
            ValueError: noise_um > 0 without a generator.
        """
        if self.noise_um == 0.0:
            return np.zeros(count)
        if rng is None:
            raise ValueError("noise_um > 0 needs rng, a numpy.random.Generator, found None")
        return rng.normal(0.0, self.noise_um, count)

    def quantised(self, displacement_um: float) -> float:
        """`displacement_um` rounded to the nearest multiple of the quantum."""
        if self.quantum_um == 0.0:
            return displacement_um
        return round(displacement_um / self.quantum_um) * self.quantum_um
