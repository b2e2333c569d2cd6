"""Step responses beside the searches: Ziegler and Nichols' rule, gains near a printed response, our tuning."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bender_loop.control.metrics import StepMetrics
from bender_loop.control.pid import Gains
from bender_loop.control.trace import Trace
from bender_loop.errors import RunError
from bender_studies.reproduction.printed import BAS_STEP, ZN_STEP
from bender_studies.reproduction.searches import JUDGED_S
from bender_tuner.optimisers import create
from bender_tuner.rules.ziegler_nichols import Rule
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.judgement import Judgement, judge
from bender_tuner.task.problem import TuningProblem, pose_problem
from bender_tuner.task.search_space import DIMENSION, SearchSpace
from bender_tuner.task.session import open_guarded
from bender_tuner.task.settings import make_settings
from bender_tuner.task.tuning import Ended, run_search, ziegler_nichols_rule

NEAREST_BOX = SearchSpace(Gains(0.1, 3.0, 1e-2, derivative_on_error=True), decades=2.5)
"""Where gains that come near a printed response are looked for: Kp to 30, Ki to 900, Kd to 3."""
GLOBAL_SHARE = 0.6
"""Of these evaluations, the part before the best point is polished."""
HIGH_STEP = {"latency_frames": 2, "exposure_s": 0.004, "noise_um": 0.03, "slew_V_per_s": 225.0, "duration_s": 3.0}
LATE = 10.0
"""A time that is never reached misses the printed one by this factor."""


@dataclass(frozen=True, slots=True)
class Target:
    """A printed step response: times in s, overshoot in percent."""

    rise_s: float
    settling_s: float
    overshoot_percent: float

    def miss(self, found: StepMetrics) -> float:
        """The largest miss of the three: of the times relative, of the overshoot over itself or one percent."""
        overshoot = abs(found.overshoot_percent - self.overshoot_percent) / max(self.overshoot_percent, 1.0)
        times = ((found.rise_time_s, self.rise_s), (found.settling_time_s, self.settling_s))
        misses = [LATE if math.isnan(value) else abs(value / printed - 1.0) for value, printed in times]
        return float(min(max(*misses, overshoot), LATE))


TARGETS = (
    Target(float(BAS_STEP["rise"].text), float(BAS_STEP["settling"].text), 0.0),
    Target(*(float(ZN_STEP[name].text) for name in ("rise", "settling", "overshoot"))),
)
"""The printed steps of BAS-PID and ZN-PID; \"no overshoot\" is 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """Gains and their step on the paper's task, judged over 6 s."""

    gains: Gains
    trace: Trace
    metrics: StepMetrics


@dataclass(frozen=True, slots=True, eq=False)
class PaperLoop:
    """The paper's task beside its searches.

    Attributes:
        rule: Ziegler and Nichols' PID as (21) has it, None where the loop has no ultimate gain.
        rule_says: whether the rule applies, a sentence.
        nearest: gains for each of `TARGETS` that come nearest to it, with the miss.
    """

    rule: Response | None
    rule_says: str
    nearest: tuple[tuple[Response, float], ...]


def run_paper_loop(fmu: Path, evaluations: int, rng: np.random.Generator) -> PaperLoop:
    """Judge the rule's gains and look for gains that give the printed steps."""
    with open_guarded(fmu) as (plant, _):
        problem = pose_problem(plant, make_settings(objective="mse"))
        longer = replace(problem.experiment, duration_s=JUDGED_S)
        zn = ziegler_nichols_rule(problem)
        found = zn.gains.get(Rule.PID)
        printed_form = None if found is None else replace(found, filter_time_s=0.0, derivative_on_error=True)
        rule = None if printed_form is None else _response(longer, printed_form)
        nearest = tuple(_nearest(longer, target, evaluations, rng) for target in TARGETS)
    return PaperLoop(rule, zn.sentence, nearest)


def _nearest(
    experiment: StepExperiment, target: Target, evaluations: int, rng: np.random.Generator
) -> tuple[Response, float]:
    """Differential evolution over the whole box, then a pattern search from its best point."""
    best_x, best_f = None, math.inf
    for method, share in (("differential_evolution", GLOBAL_SHARE), ("pattern_search", 1.0 - GLOBAL_SHARE)):
        budget = max(1, round(share * evaluations))
        optimiser = create(method, DIMENSION, rng, start=best_x, budget=budget)
        for _ in range(budget):
            x = optimiser.ask()
            optimiser.tell(x, target.miss(_response(experiment, NEAREST_BOX.to_gains(x)).metrics))
        optimiser.close()
        if best_x is None or optimiser.best_f < best_f:
            best_x, best_f = optimiser.best_x, optimiser.best_f
    return _response(experiment, NEAREST_BOX.to_gains([0.5] * DIMENSION if best_x is None else best_x)), best_f


def _response(experiment: StepExperiment, gains: Gains) -> Response:
    trace = experiment.run(gains)
    return Response(gains, trace, experiment.metrics(trace))


@dataclass(frozen=True, slots=True, eq=False)
class Tuned:
    """What `bender tune` does for the bench: 30 Hz, one frame of latency, 15 ms of exposure, a supply of 20 ms.

    Attributes:
        ours: the tuned gains, judged between the frames too.
        rule: Ziegler and Nichols' PID there, None where there is none.
        rule_says: whether the rule applies, a sentence.
    """

    ours: Judgement
    rule: Judgement | None
    rule_says: str


def tune_for_the_bench(fmu: Path, evaluations: int, seed: int) -> Tuned:
    """Tune by reliable BAS with the practitioner's objective."""
    with open_guarded(fmu) as (plant, _):
        problem = pose_problem(plant, make_settings(evaluations=evaluations, seed=seed))
        found = _searched(problem)
        zn = ziegler_nichols_rule(problem)
        gains = zn.gains.get(Rule.PID)
        longer = replace(problem, experiment=replace(problem.experiment, duration_s=JUDGED_S))
        return Tuned(judge(longer, found), None if gains is None else judge(longer, gains), zn.sentence)


def tune_for_the_high_step(fmu: Path, setpoint_um: float, evaluations: int, seed: int) -> Gains:
    """Tune as the gains that `bender hil` brings along are tuned: ITAE, two frames of latency, bounded slew, noise."""
    settings = make_settings(objective="itae", setpoint_um=setpoint_um, evaluations=evaluations, seed=seed, **HIGH_STEP)
    with open_guarded(fmu) as (plant, _):
        return _searched(pose_problem(plant, settings))


def _searched(problem: TuningProblem) -> Gains:
    run = run_search(problem, "reliable_bas")
    if run.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    if run.gains is None:
        raise RunError(run.reason or "reliable_bas found no gains under which the loop holds")
    return run.gains
