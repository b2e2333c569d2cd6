"""Laws that every method keeps, and the table of methods."""

import math
import subprocess
import sys

import numpy as np
import pytest
from few import few_rows

from bender_loop.errors import InputError
from bender_tuner.optimisers import METHODS, create
from bender_tuner.optimisers.populations.ga import child, mutant

DIMENSION = 3
BOX_METHODS = [name for name, method in METHODS.items() if method.space == "box"]
MINIMUM = np.array([0.62, 0.31, 0.55])

every_method = pytest.mark.parametrize("name", METHODS)
every_box_method = pytest.mark.parametrize("name", BOX_METHODS)


def ill_conditioned(x):
    """A quadratic of condition number 400 in axes turned out of the box's, smallest (0) at MINIMUM."""
    rotation = np.linalg.qr(np.array([[2.0, 1.0, 0.3], [-1.0, 1.5, 0.5], [0.2, -0.6, 1.0]]))[0]
    return float(np.sum(np.array([400.0, 30.0, 1.0]) * (rotation.T @ (x - MINIMUM)) ** 2))


def make(name, seed=0, start=None, budget=151):
    return create(name, DIMENSION, np.random.default_rng(seed), start, budget)


def drive(optimiser, loss, evaluations):
    """Points asked for, shape (evaluations, d), and the best value after each."""
    points, best = [], []
    for _ in range(evaluations):
        x = optimiser.ask()
        optimiser.tell(x, loss(x))
        points.append(x)
        best.append(optimiser.best_f)
    return np.array(points), np.array(best)


@every_method
def test_best_never_rises_and_is_a_point_that_was_told(name):
    optimiser = make(name)
    points, best = drive(optimiser, ill_conditioned, 120)
    assert np.all(np.diff(best) <= 0.0)
    assert optimiser.evaluations == 120
    assert optimiser.best_f == ill_conditioned(optimiser.best_x)
    assert np.any(np.all(points == optimiser.best_x, axis=1))


@every_box_method
@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_every_point_lies_in_the_box_when_the_minimum_does_not(name, corner):
    outside = np.full(DIMENSION, 2.0 * corner - 0.5)
    points, best = drive(make(name), lambda x: float(np.sum((x - outside) ** 2)), 151)
    assert np.all((points >= 0.0) & (points <= 1.0))
    assert best[-1] < best[0]


@every_method
def test_same_seed_same_trace_whatever_the_global_generator_does(name):
    traces = []
    for global_seed in (1, 2):
        np.random.seed(global_seed)
        before = np.random.get_state(legacy=False)["state"]["key"].copy()
        traces.append(drive(make(name, seed=5), ill_conditioned, 130)[0])
        assert np.array_equal(before, np.random.get_state(legacy=False)["state"]["key"])
    assert np.array_equal(*traces)


@pytest.mark.parametrize("name", METHODS)
def test_other_seed_other_trace(name):
    first, second = (drive(make(name, seed=seed), ill_conditioned, 60)[0] for seed in (1, 2))
    assert not np.array_equal(first, second)


@every_method
def test_a_monotone_change_of_scale_is_not_seen_nor_the_unit_by_the_method_that_fits_parabolas(name):
    # A power of two scales every floating-point number exactly.
    bend = (lambda value: 1024.0 * value) if name == "reliable_bas" else (lambda value: math.log1p(value) - 7.0)
    plain = drive(make(name, seed=3), ill_conditioned, 100)[0]
    bent = drive(make(name, seed=3), lambda x: bend(ill_conditioned(x)), 100)[0]
    assert np.array_equal(plain, bent)


@pytest.mark.parametrize(
    ("name", "evaluations", "gap"),
    few_rows(
        [
            ("bas", 300, 3.0),
            ("reliable_bas", 151, 1e-4),
            ("random", 2000, 1.0),
            ("differential_evolution", 600, 1e-3),
            ("nelder_mead", 151, 1e-4),
            ("pattern_search", 400, 1e-3),
            ("pso", 1000, 1e-2),
            ("ga", 1500, 1e-1),
        ],
        0,
        3,
        6,
    ),
)
def test_finds_the_minimum_of_an_ill_conditioned_quadratic(name, evaluations, gap):
    for seed in range(3):
        optimiser = make(name, seed, start=np.array([0.2, 0.8, 0.2]), budget=evaluations)
        drive(optimiser, ill_conditioned, evaluations)
        assert optimiser.best_f < gap, seed


@every_method
@pytest.mark.parametrize("bad", [math.inf, math.nan])
def test_failed_evaluations_are_the_worst_there_is(name, bad):
    def loss(x):
        return bad if x[0] > 0.6 or x[0] < 0.0 else float(np.sum(x**2))

    optimiser = make(name, start=np.array([0.5, 0.5, 0.5]))
    drive(optimiser, loss, 100)
    assert math.isfinite(optimiser.best_f)
    assert 0.0 <= optimiser.best_x[0] <= 0.6


@every_method
@pytest.mark.parametrize("value", [0.0, 577.0, math.inf])
def test_a_plateau_everywhere_is_survived(name, value):
    optimiser = make(name)
    points = drive(optimiser, lambda _: value, 200)[0]
    assert np.all(np.isfinite(points))
    assert optimiser.best_f == value
    assert np.array_equal(optimiser.best_x, points[0])


@every_box_method
def test_asking_goes_on_long_after_convergence(name):
    optimiser = make(name, budget=20)
    points, _ = drive(optimiser, lambda x: float(np.sum((x - MINIMUM) ** 2)), 800)
    assert np.all((points >= 0.0) & (points <= 1.0))
    assert len(np.unique(points[-50:], axis=0)) > 1


@pytest.mark.parametrize("name", METHODS)
def test_the_start_is_the_first_point_or_one_of_the_first_generation(name):
    start = np.array([0.4, 0.3, 0.7])
    points, _ = drive(make(name, start=start), ill_conditioned, 20)
    assert np.any(np.all(points == start, axis=1))


@every_method
def test_ask_repeats_itself_until_told_and_hands_out_copies(name):
    optimiser = make(name)
    first = optimiser.ask()
    kept = first.copy()
    first[:] = np.nan
    assert np.array_equal(optimiser.ask(), kept)
    optimiser.tell(kept, 1.0)
    best = optimiser.best_x
    best[:] = np.nan
    assert np.array_equal(optimiser.best_x, kept)


def test_tell_must_answer_the_last_ask():
    optimiser = make("random")
    with pytest.raises(ValueError, match="expected a call of ask first"):
        optimiser.tell(np.zeros(DIMENSION), 1.0)
    x = optimiser.ask()
    with pytest.raises(ValueError, match="expected the point"):
        optimiser.tell(x + 0.1, 1.0)
    assert optimiser.evaluations == 0


def test_before_the_first_value_there_is_no_best_point_and_nan_is_infinitely_bad():
    optimiser = make("random")
    assert np.all(np.isnan(optimiser.best_x))
    assert optimiser.best_f == math.inf
    optimiser.tell(optimiser.ask(), math.nan)
    assert optimiser.best_f == math.inf
    x = optimiser.ask()
    optimiser.tell(x, 3.0)
    assert optimiser.best_f == 3.0
    assert np.array_equal(optimiser.best_x, x)


def test_closed_optimiser_keeps_its_best_point_but_searches_no_more():
    optimiser = make("nelder_mead")
    drive(optimiser, ill_conditioned, 10)
    best = optimiser.best_f
    optimiser.close()
    optimiser.close()
    assert optimiser.best_f == best
    with pytest.raises(RuntimeError, match="create a new one"):
        optimiser.ask()


@every_method
@pytest.mark.parametrize("dimension", [1, 4])
def test_other_dimensions(name, dimension):
    optimiser = create(name, dimension, np.random.default_rng(0))
    points, _ = drive(optimiser, lambda x: float(np.sum((x - 0.4) ** 2)), 60)
    assert points.shape == (60, dimension)


def test_bad_arguments_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="'simplex' is unknown: choose one of bas_printed"):
        create("simplex", 3, rng)
    with pytest.raises(ValueError, match="dimension must be >= 1, found 0"):
        create("bas", 0, rng)
    with pytest.raises(ValueError, match="budget must be >= 1, found 0"):
        create("bas", 3, rng, budget=0)
    with pytest.raises(ValueError, match=r"start must have shape \(3,\), found \(2,\)"):
        create("bas", 3, rng, start=[0.5, 0.5])
    with pytest.raises(ValueError, match="start must be finite"):
        create("bas", 3, rng, start=[0.5, math.nan, 0.5])
    with pytest.raises(ValueError, match=r"start must lie in \[0, 1\]\^3"):
        create("bas", 3, rng, start=[0.5, 0.5, 1.5])


@every_method
def test_every_row_of_the_table_says_what_and_whence(name):
    method = METHODS[name]
    assert method.name == name
    assert method.description
    assert method.source
    assert method.library
    assert method.space in ("box", "raw")


def test_listing_the_methods_loads_no_numerics():
    heavy = "{'numpy', 'scipy', 'pymoo'}"
    code = f"import sys; from bender_tuner.optimisers import METHODS; sys.exit(bool({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_pattern_search_asks_for_the_points_that_pymoo_asks_for():
    """In one dimension, where the random order of coordinates is void."""
    from pymoo.algorithms.soo.nonconvex.pattern import PatternSearch
    from pymoo.optimize import minimize
    from pymoo.problems.functional import FunctionalProblem

    def loss(x):
        return float((x[0] - 0.137) ** 2)

    def recorded(x):
        theirs.append(x.copy())
        return loss(x)

    theirs: list[np.ndarray] = []
    start = np.array([0.8])
    minimize(FunctionalProblem(1, recorded, xl=0.0, xu=1.0), PatternSearch(x0=start), ("n_eval", 40))
    ours = drive(create("pattern_search", 1, np.random.default_rng(0), start), loss, 40)[0]
    assert ours == pytest.approx(np.array(theirs[:40]), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pso", "ga"])
def test_a_rival_is_no_straw_man_beside_the_same_method_of_pymoo(name):
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.algorithms.soo.nonconvex.pso import PSO
    from pymoo.config import Config
    from pymoo.optimize import minimize
    from pymoo.problems.functional import FunctionalProblem

    Config.warnings["not_compiled"] = False
    method, budget = {"pso": PSO, "ga": GA}[name], 300
    problem = FunctionalProblem(DIMENSION, ill_conditioned, xl=0.0, xu=1.0)
    ours, theirs = [], []
    for seed in range(20):
        ours.append(drive(make(name, seed=seed), ill_conditioned, budget)[1][-1])
        population = method(pop_size=math.isqrt(151))
        theirs.append(float(minimize(problem, population, ("n_eval", budget), seed=seed).F[0]))
    assert np.median(ours) <= 2.0 * np.median(theirs)


def test_children_lie_about_their_parents_and_mutants_in_the_box():
    rng = np.random.default_rng(1)
    a, b = np.array([0.3, 0.5, 0.9]), np.array([0.4, 0.5, 0.2])
    children = np.array([child(a, b, rng) for _ in range(20_000)])
    assert np.all((children >= 0.0) & (children <= 1.0))
    assert np.all(children[:, 1] == 0.5)
    # crossed coordinates lie alike around both parents, the others are those of the first
    assert children[:, 0].mean() == pytest.approx(0.3 + 0.45 * 0.05, abs=0.002)
    for x in (np.zeros(3), np.ones(3), a):
        mutants = np.array([mutant(x, rng) for _ in range(5000)])
        assert np.all((mutants >= 0.0) & (mutants <= 1.0))
        assert np.mean(mutants != x) == pytest.approx(1.0 / 3.0, abs=0.2)
