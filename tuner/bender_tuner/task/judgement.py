"""What a set of gains is worth, by the same yardstick whichever method found it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bender_loop.control.metrics import StepMetrics, step_metrics
from bender_loop.control.pid import Gains
from bender_loop.control.trace import Trace
from bender_tuner.model.monte_carlo import (
    BENDER_PARAMETERS,
    MonteCarloResult,
    ParameterisedPlant,
    Variation,
    run_monte_carlo,
    uniform,
)
from bender_tuner.results.report import RobustnessReport, robustness_report
from bender_tuner.task.experiment import between_frames
from bender_tuner.task.following import Following
from bender_tuner.task.practitioner import PractitionerReport
from bender_tuner.task.problem import TuningProblem

_NOISE_SHARE = 0.01
_LONGER = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """One set of gains judged.

    Attributes:
        gains: the gains.
        value: of the objective that was minimised.
        trace: the nominal step response, with the time between the frames.
        metrics: its figures, between the frames too.
        at_frames: its figures at the frames alone, which is all that a camera shows.
        practitioner: the practitioner's objective and its cases.
        robustness: margins, noise gain, load rejection.
    """

    gains: Gains
    value: float
    trace: Trace
    metrics: StepMetrics
    at_frames: StepMetrics
    practitioner: PractitionerReport
    robustness: RobustnessReport


def judge(problem: TuningProblem, gains: Gains, following: Following | None = None) -> Judgement:
    """Run the step with `gains`, alone or following a model, finely; analyse the loop on the whole ensemble.

    Raises:
        RunError: the plant failed.
    """
    fine = between_frames(problem.experiment)
    trace = fine.run(gains, following)
    report = problem.practitioner.evaluate(gains, following)
    return Judgement(
        gains=gains,
        value=problem.objective(gains) if following is None else report.value,
        trace=trace,
        metrics=fine.metrics(trace),
        at_frames=step_metrics(trace, problem.settings.setpoint_um),
        practitioner=report,
        robustness=robustness_report(gains, problem.ensemble),
    )


def variation_of(problem: TuningProblem, parameter_names: set[str]) -> Variation:
    """How Monte Carlo draws plants for a problem: its gains and latencies, and our own FMU's parameters if there.

    The noise is that of the settings, or 1 % of the setpoint where they have none.
    """
    settings = problem.settings
    factors = [case.gain_factor for case in problem.ensemble.cases]
    latencies = sorted({case.latency_frames for case in problem.ensemble.cases})
    return Variation(
        gain=uniform(min(factors), max(factors)),
        latencies_frames=tuple(latencies),
        noise_um=settings.noise_um or _NOISE_SHARE * abs(settings.setpoint_um),
        parameters=BENDER_PARAMETERS,
    ).only(parameter_names)


def monte_carlo(
    problem: TuningProblem,
    plant: ParameterisedPlant,
    gains: Gains,
    variation: Variation,
    count: int,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> MonteCarloResult:
    """`gains` on `count` plants; the same plants for every set of gains. The plant keeps the last parameters drawn."""
    experiment = replace(problem.experiment, duration_s=_LONGER * problem.experiment.duration_s)
    rng = np.random.default_rng(problem.settings.seed)
    return run_monte_carlo(plant, gains, experiment, variation, count, rng, progress=progress)
