"""One run of one method with one seed."""

import time
from dataclasses import dataclass

import numpy as np

from bender_studies.tuning.plants import Problem
from bender_tuner.optimisers import METHODS, create
from bender_tuner.task.search_space import DIMENSION, GAIN_NAMES, GainSpace, RawSpace


@dataclass(frozen=True, slots=True)
class MethodRun:
    """What a run found.

    Attributes:
        method: key of METHODS.
        seed: of its generator.
        best_um2: smallest MSE credited; inf if none was finite.
        gains: Kp, Ki, Kd in V/um, V/(um s), V s/um where it was found, None where nothing was.
        time_s: wall time of the run; it grows with whatever else the machine does.
        cpu_s: processor time of the run, evaluations included.
    """

    method: str
    seed: int
    best_um2: float
    gains: tuple[float, float, float] | None
    time_s: float
    cpu_s: float


@dataclass(frozen=True, slots=True)
class MethodTask:
    """A run to be done: call it with the problem."""

    method: str
    seed: int
    evaluations: int

    @property
    def weight(self) -> int:
        """Evaluations that it takes."""
        return self.evaluations

    def __call__(self, problem: Problem) -> MethodRun:
        """Run the method for its evaluations.

        Searches in the box begin at its centre, the SIMC guess, where they use a start. A method of raw gains gets
        the paper's space, unit scale and a random start.
        """
        raw = METHODS[self.method].space == "raw"
        space: GainSpace = RawSpace() if raw else problem.box()
        start = None if raw else np.full(DIMENSION, 0.5)
        began, began_cpu = time.perf_counter(), time.process_time()
        optimiser = create(self.method, DIMENSION, np.random.default_rng(self.seed), start, self.evaluations)
        try:
            for _ in range(self.evaluations):
                x = optimiser.ask()
                optimiser.tell(x, problem.value(space, x))
        finally:
            optimiser.close()
        elapsed, cpu = time.perf_counter() - began, time.process_time() - began_cpu
        best = optimiser.best_f
        gains = gain_values(space, optimiser.best_x) if np.isfinite(best) else None
        return MethodRun(self.method, self.seed, best, gains, elapsed, cpu)


def gain_values(space: GainSpace, x: np.ndarray) -> tuple[float, float, float]:
    """(Kp, Ki, Kd) at a point that stands for gains."""
    gains = space.to_gains(x)
    proportional, integral, derivative = (getattr(gains, name) for name in GAIN_NAMES)
    return proportional, integral, derivative
