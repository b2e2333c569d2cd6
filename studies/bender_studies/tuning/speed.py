"""What an evaluation costs, as ratios within one run wherever that is possible.

Everything is repeated. The best of the repeats is what the code costs and what the targets are judged by, since other
programs on the machine only ever add to a time; the median says how busy the machine was. What is put in relation is
measured in turns, so that both sides see the same machine.
"""

import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import Gains
from bender_loop.control.references import Step
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_studies.tuning.bare_fmu import BareFmu, mse_by_simulate_fmu
from bender_studies.tuning.plants import LIMITS, PLANTS, Problem
from bender_tuner.optimisers import DEFAULT_BUDGET, create
from bender_tuner.optimisers.search import Point
from bender_tuner.task.search_space import DIMENSION

PLANT = PLANTS[0]
METHOD = "bas"
COMPARED = 16
"""Evaluations of a tuning that are done by `simulate_fmu` too."""
_SAME = 1e-9
IMPORT_COMMAND = (
    sys.executable,
    "-P",
    "-c",
    "import time; began = time.perf_counter(); import piezo_bender; print(time.perf_counter() - began)",
)

Report = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class SpeedSettings:
    """How often everything is repeated.

    Attributes:
        step_runs: runs of 200 steps, through the loop and bare.
        tunings: whole tunings.
        tuning_evaluations: of one tuning; 151 are 50 iterations of a beetle.
        simulations: of each of the first evaluations of the tuning, with and without `simulate_fmu`.
        starts: of the command line.

    Raises:
        ValueError: a number is below 1.
    """

    step_runs: int = 200
    tunings: int = 7
    tuning_evaluations: int = DEFAULT_BUDGET
    simulations: int = 7
    starts: int = 9

    def __post_init__(self) -> None:
        for name in ("step_runs", "tunings", "tuning_evaluations", "simulations", "starts"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, found {getattr(self, name)!r}")


@dataclass(frozen=True, slots=True)
class Figure:
    """One line of the result.

    Attributes:
        what: was measured.
        unit: of the figures, "1" for ratios.
        best: of the repeats; ratios are between the best of both sides.
        median: of the repeats; ratios are between the medians.
        at_most: target, or None.
        at_least: target, or None.
    """

    what: str
    unit: str
    best: float
    median: float
    at_most: float | None = None
    at_least: float | None = None

    @property
    def target(self) -> str | None:
        """The target, written out."""
        if self.at_most is not None:
            return f"<= {self.at_most:g}"
        return f">= {self.at_least:g}" if self.at_least is not None else None

    @property
    def met(self) -> bool | None:
        """Whether the best keeps the target; None without one."""
        if self.at_most is not None:
            return self.best <= self.at_most
        return self.best >= self.at_least if self.at_least is not None else None


def measure_speed(
    fmu: Path, help_command: Sequence[str], settings: SpeedSettings, report: Report
) -> tuple[list[Figure], list[str]]:
    """Measure everything on the loop of 100 Hz, a run of 2 s.

    Args:
        fmu: plant FMU of the paper's model.
        help_command: that prints the help of the command line.
        settings: how often.
        report: told (done, in all, what) before each part.

    Returns:
        The figures and sentences that say what was compared.

    Raises:
        InputError: the FMU file is missing or does not fit.
        RunError: the FMU or the command fails, or two ways to the same response disagree.
    """
    parts = 4
    problem = Problem(PLANT, fmu)
    try:
        with BareFmu(fmu) as bare:
            report(0, parts, "steps")
            figures = _step_figures(problem.guess, fmu, bare, settings)
            report(1, parts, "tunings")
            tunings = [_tune(problem, settings.tuning_evaluations) for _ in range(settings.tunings)]
            durations = [tuning.time_s for tuning in tunings]
            iterations = (settings.tuning_evaluations - 1) // 3
            what = f"{iterations} BAS iterations ({settings.tuning_evaluations} evaluations)"
            figures.append(Figure(what, "s", min(durations), statistics.median(durations), at_most=1.0))
            report(2, parts, "simulate_fmu")
            figures += _against_simulate_fmu(tunings[0], fmu, bare, problem, settings.simulations)
    finally:
        problem.close()
    report(3, parts, "command line")
    figures.append(_start_figure("bender --help, wall time", help_command, settings.starts, at_most=0.4))
    figures.append(_import_figure(settings.starts))
    return figures, _explanations(settings)


def _step_figures(gains: Gains, fmu: Path, bare: BareFmu, settings: SpeedSettings) -> list[Figure]:
    """One step of the closed loop against the bare calls with the very same voltages."""
    with FmuPlant(fmu) as plant:
        pairs = [_timed_pair(plant, bare, gains) for _ in range(settings.step_runs)]
    step, round_trip = (_microseconds(times) for times in zip(*pairs, strict=True))
    return [
        Figure("bare fmpy round trip (setReal, doStep, getReal)", "us", *round_trip, at_most=25.0),
        Figure("closed-loop step through FmuPlant, PID included", "us", *step),
        Figure("closed-loop step over round trip", "1", *_ratios(step, round_trip), at_most=1.3),
    ]


def _timed_pair(plant: FmuPlant, bare: BareFmu, gains: Gains) -> tuple[float, float]:
    """Seconds per step of one run in the closed loop and of the bare calls after it."""
    sampling = PLANT.sampling
    began = time.perf_counter()
    trace = simulate(plant, gains, LIMITS, Step(PLANT.setpoint_um), sampling, PLANT.duration_s)
    loop_s = time.perf_counter() - began
    steps = trace.time_s.size - 1
    bare_s, last_um = bare.round_trips_s(trace.voltage_V[:-1].tolist(), sampling.period_s)
    _must_agree("the last displacement in µm", float(trace.displacement_um[-1]), last_um)
    return loop_s / steps, bare_s / steps


@dataclass(frozen=True, slots=True)
class _Tuning:
    time_s: float
    points: tuple[Point, ...]
    values: tuple[float, ...]


def _tune(problem: Problem, evaluations: int) -> _Tuning:
    """A beetle's search, and the points that it tried."""
    space = problem.box()
    points, values = [], []
    began = time.perf_counter()
    optimiser = create(METHOD, DIMENSION, np.random.default_rng(0), np.full(DIMENSION, 0.5), evaluations)
    for _ in range(evaluations):
        x = optimiser.ask()
        value = problem.value(space, x)
        optimiser.tell(x, value)
        points.append(x)
        values.append(value)
    elapsed = time.perf_counter() - began
    optimiser.close()
    return _Tuning(elapsed, tuple(points), tuple(values))


def _against_simulate_fmu(tuning: _Tuning, fmu: Path, bare: BareFmu, problem: Problem, repeats: int) -> list[Figure]:
    """The first evaluations of the tuning once more, as they were and each by one call of `simulate_fmu`, in turns."""
    space = problem.box()
    ways: tuple[Callable[[Point], float], ...] = (
        lambda x: problem.value(space, x),
        lambda x: mse_by_simulate_fmu(fmu, PLANT, space.to_gains(x), bare, reuse=False),
        lambda x: mse_by_simulate_fmu(fmu, PLANT, space.to_gains(x), bare, reuse=True),
    )
    pairs = list(zip(tuning.points, tuning.values, strict=True))[:COMPARED]
    times_ms = np.empty((len(ways), len(pairs), repeats))
    for repeat in range(repeats):
        for k, (x, expected) in enumerate(pairs):
            for way, evaluate in enumerate(ways):
                began = time.perf_counter()
                value = evaluate(x)
                times_ms[way, k, repeat] = 1e3 * (time.perf_counter() - began)
                _must_agree("the MSE in µm²", expected, value)
    best, median = times_ms.min(axis=2).mean(axis=1).tolist(), np.median(times_ms, axis=2).mean(axis=1).tolist()
    ours, whole, kept = zip(best, median, strict=True)
    return [
        Figure("one evaluation of that tuning", "ms", *ours),
        Figure("the same by simulate_fmu(file)", "ms", *whole),
        Figure("the same by simulate_fmu, one instance kept", "ms", *kept),
        Figure("faster than simulate_fmu(file)", "1", *_ratios(whole, ours), at_least=5.0),
        Figure("faster than simulate_fmu, one instance kept", "1", *_ratios(kept, ours)),
    ]


def _start_figure(what: str, command: Sequence[str], starts: int, at_most: float | None = None) -> Figure:
    times: list[float] = []
    for _ in range(starts):
        began = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        times.append(time.perf_counter() - began)
        if done.returncode != 0:
            raise RunError(f"{' '.join(command)} ended with status {done.returncode}, expected 0: {done.stderr[-300:]}")
    return Figure(what, "s", min(times), statistics.median(times), at_most)


def _import_figure(starts: int) -> Figure:
    """What `import piezo_bender` adds to a start of Python, as the process itself sees it."""
    times: list[float] = []
    for _ in range(starts):
        done = subprocess.run(IMPORT_COMMAND, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RunError(f"import piezo_bender ended with status {done.returncode}: {done.stderr[-300:]}")
        times.append(float(done.stdout))
    return Figure("import piezo_bender", "s", min(times), statistics.median(times), at_most=0.3)


def _must_agree(what: str, ours: float, theirs: float) -> None:
    if abs(ours - theirs) > _SAME * max(abs(ours), 1.0):
        raise RunError(f"{what} differs between the closed loop and fmpy: {ours!r} and {theirs!r}; no times are given")


def _microseconds(times_s: Sequence[float]) -> tuple[float, float]:
    return 1e6 * min(times_s), 1e6 * statistics.median(times_s)


def _ratios(above: tuple[float, float], below: tuple[float, float]) -> tuple[float, float]:
    return above[0] / below[0], above[1] / below[1]


def _explanations(settings: SpeedSettings) -> list[str]:
    return [
        f"Plant: the paper's model, {PLANT.rate_Hz:g} Hz, {PLANT.duration_s:g} s, step of {PLANT.setpoint_um:g} µm. "
        "Targets are judged by the best of the repeats; the medians show how busy the machine was.",
        f"Steps: {settings.step_runs} runs each, in turns, with the same voltages. The closed-loop step counts reset, "
        "PID block, setpoints and the finished trace; the round trip counts fmpy's three calls alone.",
        f"simulate_fmu: the first {COMPARED} evaluations of the same tuning, {settings.simulations} times each and in "
        "turns, the same PID block in its step_finished callback, the same MSE to 1e-9. With a file name it unpacks, "
        "reads and instantiates each time; with one instance kept it only resets.",
    ]


def scaled(settings: SpeedSettings, repeats: int) -> SpeedSettings:
    """The same with `repeats` runs of everything that is repeated."""
    return replace(settings, step_runs=repeats, tunings=repeats, simulations=repeats, starts=repeats)
