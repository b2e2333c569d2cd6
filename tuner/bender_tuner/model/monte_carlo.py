"""One set of gains on many plants drawn at random: how many are unstable, how fast the others settle.

Gain (a factor on the reading) and latency vary for any plant; parameters of the FMU vary by their names.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from scipy.signal import detrend

from bender_loop.control.metrics import StepMetrics
from bender_loop.control.pid import Gains
from bender_loop.control.plant import Plant
from bender_loop.control.trace import Trace
from bender_tuner.model.scaled_plant import ScaledPlant
from bender_tuner.task.experiment import StepExperiment

Sampler = Callable[[np.random.Generator], float]

_JUDGED_SHARE = 0.25
_OSCILLATION_SHARE = 0.1
_NOISE_ALLOWANCE = 10.0


class ParameterisedPlant(Plant, Protocol):
    """A plant whose parameters can be set by name; they act from the next reset."""

    def set_parameters(self, parameters: Mapping[str, float], /) -> None:
        """Set parameters in the units of the FMU."""
        ...


def uniform(lower: float, upper: float) -> Sampler:
    """Sampler of the uniform distribution; ValueError where the bounds cross."""
    if not lower <= upper:
        raise ValueError(f"lower must be <= upper, found {lower!r} and {upper!r}")
    return lambda rng: float(rng.uniform(lower, upper))


@dataclass(frozen=True, slots=True)
class Variation:
    """How plants are drawn.

    Attributes:
        gain: sampler of the factor on the reading.
        latencies_frames: latencies, drawn with equal chance.
        noise_um: standard deviation of the measurement noise.
        parameters: FMU parameter name to sampler.

    Raises:
        ValueError: no latency, a negative one, or a negative noise.
    """

    gain: Sampler = field(default_factory=lambda: uniform(0.7, 1.3))
    latencies_frames: tuple[int, ...] = (1, 2)
    noise_um: float = 0.1
    parameters: Mapping[str, Sampler] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.latencies_frames or min(self.latencies_frames) < 0:
            raise ValueError(f"latencies_frames must be whole numbers >= 0, found {self.latencies_frames!r}")
        if not (math.isfinite(self.noise_um) and self.noise_um >= 0.0):
            raise ValueError(f"noise_um must be a finite number >= 0, found {self.noise_um!r}")

    def only(self, names: Collection[str]) -> "Variation":
        """The same without the parameters that a plant does not have."""
        return replace(self, parameters={name: self.parameters[name] for name in self.parameters if name in names})


BENDER_PARAMETERS: Mapping[str, Sampler] = {
    "source_resistance.time_constant": uniform(0.010, 0.100),
    "bending_modes.frequency_factor": uniform(0.8, 1.4),
    "bending_modes.damping_ratio": uniform(0.01, 0.08),
}
"""Of our own FMU: supply lag 10..100 ms, first resonance -20..+40 %, damping ratio 0.01..0.08."""


@dataclass(frozen=True, slots=True)
class Draw:
    """One plant: gain factor, latency, parameters, seed of its noise."""

    gain_factor: float
    latency_frames: int
    parameters: Mapping[str, float]
    seed: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """What happened on one plant."""

    draw: Draw
    unstable: bool
    metrics: StepMetrics


@dataclass(frozen=True, slots=True)
class MonteCarloResult:
    """All outcomes, in the order of drawing."""

    outcomes: tuple[Outcome, ...]

    @property
    def unstable(self) -> int:
        """Number of unstable plants."""
        return sum(outcome.unstable for outcome in self.outcomes)

    def quantile(self, figure: str, share: float) -> float:
        """Quantile of one field of `StepMetrics`; NaN (never reached) counts as infinite."""
        values = np.array([getattr(outcome.metrics, figure) for outcome in self.outcomes], dtype=float)
        return float(np.quantile(np.where(np.isnan(values), math.inf, values), share, method="higher"))


def draw_plants(variation: Variation, count: int, rng: np.random.Generator) -> list[Draw]:
    """`count` plants; ValueError where the count is not positive."""
    if count < 1:
        raise ValueError(f"count must be >= 1, found {count!r}")
    return [
        Draw(
            gain_factor=variation.gain(rng),
            latency_frames=int(rng.choice(variation.latencies_frames)),
            parameters={name: sample(rng) for name, sample in variation.parameters.items()},
            seed=int(rng.integers(1 << 32)),
        )
        for _ in range(count)
    ]


def run_monte_carlo(
    plant: ParameterisedPlant,
    gains: Gains,
    experiment: StepExperiment,
    variation: Variation,
    count: int,
    rng: np.random.Generator,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> MonteCarloResult:
    """Run the step of `experiment` with `gains` on `count` plants drawn from `variation`.

    Args:
        plant: its parameters are left as the last draw set them.
        gains: of the controller.
        experiment: the step; its plant, latency, noise and seed are replaced. The run must be long enough for an
            oscillation to show: three times the settling time or more.
        variation: how plants are drawn.
        count: how many.
        rng: source of all draws.
        progress: called with (done, count) after each plant.

    Raises:
        InputError: the plant does not have one of the parameters.
    """
    outcomes = []
    for draw in draw_plants(variation, count, rng):
        outcomes.append(_outcome(plant, gains, experiment, variation.noise_um, draw))
        if progress is not None:
            progress(len(outcomes), count)
    return MonteCarloResult(tuple(outcomes))


def is_unstable(trace: Trace, setpoint_um: float, noise_um: float) -> bool:
    """Whether a run has run away, or still oscillates in its last quarter.

    Between limits an unstable loop ends in a limit cycle. Judged is the peak-to-peak displacement about its straight
    trend (a slow approach is not an oscillation): more than 10 % of the setpoint and 10 times the noise.
    """
    if trace.diverged:
        return True
    displacement = trace.displacement_um if trace.fine_displacement_um is None else trace.fine_displacement_um
    tail = displacement[-max(4, int(_JUDGED_SHARE * displacement.size)) :]
    swing = float(np.ptp(detrend(tail)))
    return swing > max(_OSCILLATION_SHARE * abs(setpoint_um), _NOISE_ALLOWANCE * noise_um)


def _outcome(
    plant: ParameterisedPlant, gains: Gains, experiment: StepExperiment, noise_um: float, draw: Draw
) -> Outcome:
    if draw.parameters:
        plant.set_parameters(draw.parameters)
    sampling = replace(experiment.sampling, noise_um=noise_um)
    varied = replace(experiment, sampling=sampling, seed=draw.seed)
    varied = varied.with_plant(ScaledPlant(plant, draw.gain_factor), draw.latency_frames)
    trace = varied.run(gains)
    return Outcome(draw, is_unstable(trace, experiment.setpoint_um, noise_um), varied.metrics(trace))
