"""The comparison of the methods: its search for the optimum, its figures, and all of it on real FMUs."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from bender_loop.control.pid import Gains
from bender_studies.benchmarks.tuner import heading
from bender_studies.tuning.figures import PlantResult, summarised, targets
from bender_studies.tuning.method_runs import MethodRun, MethodTask
from bender_studies.tuning.optimum import Optimum, SearchEnd, agree, global_tasks, polish_tasks
from bender_studies.tuning.plants import PLANTS, Problem
from bender_tuner.task.search_space import GAIN_NAMES, GainSpace

GUESS = Gains(0.2, 10.0, 0.001)
OPTIMUM = Optimum(2.0, (1.0, 2.0, 3.0), 2.0, 2.0, 20_000, 32, 30)


class Bowl(Problem):
    """A problem without a plant: 1 + a quadratic form of the distance in decades from a known best."""

    def __init__(self, *decades: float) -> None:
        self.guess = GUESS
        self.evaluations = 0
        self.away = np.array(decades)

    def value(self, space: GainSpace, x: ArrayLike) -> float:
        self.evaluations += 1
        try:
            gains = space.to_gains(x)
        except ValueError:
            return math.inf
        pairs = [(getattr(gains, name), getattr(GUESS, name)) for name in GAIN_NAMES]
        if any(value == 0.0 for value, _ in pairs):
            return math.inf
        d = np.array([math.log10(value / start) for value, start in pairs]) - self.away
        return 1.0 + float(d @ d + 1.6 * d[0] * d[1])


def searched(problem: Problem, evaluations: int) -> tuple[Optimum, list[SearchEnd]]:
    tasks = global_tasks(evaluations)
    ends = [task(problem) for task in tasks]
    polishes = polish_tasks(ends, evaluations)
    ends += [task(problem) for task in polishes]
    return agree(ends, sum(task.weight for task in [*tasks, *polishes])), ends


def run(method: str, seed: int, best_um2: float) -> MethodRun:
    return MethodRun(method, seed, best_um2, (1.0, 2.0, 3.0), 0.5, 0.1)


def result(optimum: Optimum, **found: tuple[float, ...]) -> PlantResult:
    runs = [run(name, seed, value) for name, values in found.items() for seed, value in enumerate(values)]
    return summarised(PLANTS[0], (1.0, 2.0, 3.0), 9.0, optimum, runs)


def test_search_finds_a_known_optimum_and_spends_what_it_was_given() -> None:
    problem = Bowl(0.7, -1.0, 0.3)
    optimum, ends = searched(problem, 6000)
    assert optimum.best_um2 == pytest.approx(1.0, abs=1e-7)
    assert optimum.gains == pytest.approx((0.2 * 10**0.7, 1.0, 0.001 * 10**0.3), rel=1e-3)
    assert optimum.evaluations == problem.evaluations >= 6000
    assert optimum.polishes == len([end for end in ends if end.kind == "polish"])
    assert optimum.agreeing == optimum.polishes


@pytest.mark.slow
def test_search_looks_outside_the_box() -> None:
    optimum, _ = searched(Bowl(2.0, 0.0, 0.0), 6000)
    assert optimum.wide_um2 == optimum.best_um2 == pytest.approx(1.0, abs=1e-5)
    # half a decade short in one direction, the best that the other can do: 0.25 (1 - 0.8^2)
    assert optimum.box_um2 == pytest.approx(1.09, abs=1e-4)
    assert "in the box of the methods 1.09)" in heading(result(optimum, pattern_search=(1.09, 1.1)))


@pytest.mark.parametrize("method", ["reliable_bas", "bas_printed"])
def test_run_is_what_its_seed_makes_it(method: str) -> None:
    problem = Bowl(0.5, 0.5, 0.5)
    first, again = (MethodTask(method, 3, 40)(problem) for _ in range(2))
    assert replace(first, time_s=0.0, cpu_s=0.0) == replace(again, time_s=0.0, cpu_s=0.0)
    assert problem.evaluations == 80
    assert first.time_s > 0.0
    assert first.gains is not None


def test_figures_by_hand() -> None:
    found = result(OPTIMUM, random=(2.0, 2.1, 2.4), reliable_bas=(2.0, 2.0, 2.3))
    assert [row.method for row in found.figures] == ["reliable_bas", "random"]
    row = found.figures[1]
    assert (row.median_um2, row.worst_um2) == (2.1, 2.4)
    assert (row.median_ratio, row.worst_ratio) == pytest.approx((1.05, 1.2))
    assert (row.within_5_percent, row.within_10_percent) == pytest.approx((2 / 3, 2 / 3))
    assert row.median_cpu_s == 0.1


def test_method_below_the_optimum_becomes_the_reference() -> None:
    found = result(OPTIMUM, random=(1.9, 2.1))
    assert found.reference_um2 == 1.9
    assert min(row.median_ratio for row in found.figures) >= 1.0


def test_targets_are_judged_on_the_worse_plant() -> None:
    good, bad = result(OPTIMUM, reliable_bas=(2.0, 2.02)), result(OPTIMUM, reliable_bas=(2.05, 3.2))
    assert [target.met for target in targets([good])] == [True, True, True, True]
    assert [target.met for target in targets([good, bad])] == [False, False, False, False]
    assert targets([good, bad])[1].found == pytest.approx(1.6)
    assert targets([result(OPTIMUM, random=(2.0,))]) == []


def bender(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """In a process of its own: FMUs that were loaded leave modules behind."""
    command = [sys.executable, "-m", "bender_cli", "benchmark", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_small_comparison_on_the_real_fmus_is_honest(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = bender(
        "tuner", "--seeds", "2", "--evaluations", "20", "--optimum-evaluations", "64", "--jobs", "1", "--plants", "T2",
        "--methods", "reliable_bas", "bas_printed", "--out", out,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in out.iterdir()) == ["tuner.json"]
    table = json.loads((out / "tuner.json").read_text(encoding="utf-8"))
    assert [plant["plant"]["name"] for plant in table["plants"]] == ["T2"]
    for plant in table["plants"]:
        assert len(plant["runs"]) == 4
        best = min(run["best_um2"] for run in plant["runs"])
        assert plant["reference_um2"] == min(best, plant["optimum"]["best_um2"])
        assert plant["optimum"]["evaluations"] >= 64
        assert all(row["median_ratio"] >= 1.0 for row in plant["figures"])
        assert {row["method"] for row in plant["figures"]} == {"reliable_bas", "bas_printed"}
    assert all(target["met"] is not None and target["what"] in done.stdout for target in table["targets"])


@pytest.mark.slow
def test_speed_measures_all_that_it_promises(tmp_path: Path) -> None:
    done = bender("speed", "--repeats", "1", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    table = json.loads((tmp_path / "speed.json").read_text(encoding="utf-8"))
    assert {figure["at_most"] for figure in table["figures"]} == {25.0, None, 1.3, 1.0, 0.4, 0.3}
    assert all(figure["best"] > 0.0 and figure["median"] > 0.0 for figure in table["figures"])
    assert all(figure["what"] in done.stdout for figure in table["figures"])
