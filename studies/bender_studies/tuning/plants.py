"""The two closed loops on which the methods are compared, each around the FMU of a built-in model."""

from dataclasses import dataclass, replace
from pathlib import Path

from numpy.typing import ArrayLike

from bender_loop.control.pid import Gains, Limits
from bender_loop.control.sampling import Sampling
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.model.linear_model import linearise_at
from bender_tuner.model.reduced_model import reduce_model
from bender_tuner.rules.simc import first_guess
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.objectives import at_point, mean_squared_error
from bender_tuner.task.search_space import GainSpace, SearchSpace

LIMITS = Limits(0.0, 50.0)


@dataclass(frozen=True, slots=True)
class BenchmarkPlant:
    """One loop: a step from rest, judged by equation (28).

    Attributes:
        name: short, as T1.
        title: a few words.
        model: built-in model whose FMU is the plant.
        rate_Hz: of the camera and the controller.
        latency_frames: between a frame and its use.
        setpoint_um: level of the step.
        duration_s: length of a run.
    """

    name: str
    title: str
    model: str
    rate_Hz: float
    latency_frames: int
    setpoint_um: float = 10.0
    duration_s: float = 2.0

    def __post_init__(self) -> None:
        self.sampling.ticks(self.duration_s)

    @property
    def sampling(self) -> Sampling:
        """How the camera sees the plant."""
        return Sampling(self.rate_Hz, self.latency_frames)


PLANTS = (
    BenchmarkPlant("T1", "100 Hz, no latency, the paper's model with its beam", "paper", 100.0, 0),
    BenchmarkPlant("T2", "30 Hz, one frame of latency, behind a supply of 20 ms", "bench", 30.0, 1),
)


class Problem:
    """The objective on one of the plants, from gains to um^2, through its FMU.

    Args:
        plant: which loop.
        fmu: the FMU file of `plant.model`.

    Attributes:
        guess: SIMC first guess at the setpoint, the centre of the searches.
        evaluations: how many values were asked for.
    """

    def __init__(self, plant: BenchmarkPlant, fmu: Path) -> None:
        sampling = plant.sampling
        self._plant = FmuPlant(fmu)
        model = linearise_at(self._plant, plant.setpoint_um, sampling, LIMITS).model
        self.guess: Gains = first_guess(reduce_model(model, plant.latency_frames), sampling.period_s)
        experiment = StepExperiment(self._plant, LIMITS, plant.setpoint_um, sampling, plant.duration_s)
        self._objective = mean_squared_error(experiment)
        self.evaluations = 0

    def box(self, widening: float = 1.0) -> SearchSpace:
        """The box that every tuning here searches, or one with so many times its decades."""
        box = SearchSpace(self.guess)
        return replace(box, decades=widening * box.decades)

    def value(self, space: GainSpace, x: ArrayLike) -> float:
        """MSE in um^2 at a point of `space`; inf where it stands for no gains or the loop runs away."""
        self.evaluations += 1
        return at_point(self._objective, space, x)

    def close(self) -> None:
        """Close the FMU."""
        self._plant.close()
