"""The helper thread that gives scipy's minimisers an ask and a tell."""

import gc
import subprocess
import sys
import threading

import numpy as np
import pytest
from few import few
from scipy.optimize import minimize

from bender_tuner.optimisers import create
from bender_tuner.optimisers.inverted import inverted

THREADED = ["nelder_mead", "differential_evolution"]


def helpers():
    return [thread for thread in threading.enumerate() if thread.name == "bender-optimiser"]


@pytest.fixture(autouse=True)
def _no_thread_is_left():
    gc.collect()
    assert helpers() == []
    yield
    gc.collect()
    assert helpers() == []


def test_asks_for_the_points_that_the_function_evaluates():
    def loss(x):
        return float(np.sum((x - 0.3) ** 2))

    seen = []

    def recorded(x):
        seen.append(x.copy())
        return loss(x)

    def run(objective):
        minimize(objective, np.array([0.6, 0.7]), method="Nelder-Mead")

    run(recorded)
    search = inverted(run)
    asked = [next(search).x]
    for _ in seen[1:]:
        asked.append(search.send(loss(asked[-1])).x)
    assert np.array_equal(asked, seen)
    with pytest.raises(StopIteration):
        search.send(loss(asked[-1]))


@pytest.mark.parametrize("name", THREADED)
def test_close_ends_the_thread(name):
    optimiser = create(name, 3, np.random.default_rng(0))
    optimiser.tell(optimiser.ask(), 1.0)
    optimiser.ask()
    assert len(helpers()) == 1
    optimiser.close()
    assert helpers() == []


@pytest.mark.parametrize("name", THREADED)
def test_dropping_the_optimiser_ends_the_thread(name):
    optimiser = create(name, 3, np.random.default_rng(0))
    optimiser.ask()
    del optimiser
    gc.collect()
    assert helpers() == []


@pytest.mark.parametrize("name", THREADED)
def test_one_thread_at_a_time_across_restarts(name):
    optimiser = create(name, 1, np.random.default_rng(0), budget=5)
    for _ in range(400):
        x = optimiser.ask()
        assert len(helpers()) <= 1
        optimiser.tell(x, float((x[0] - 0.2) ** 2))
    optimiser.close()


def test_an_error_of_the_minimiser_is_raised_where_the_next_point_was_wanted():
    def run(objective):
        objective(np.array([0.5]))
        raise FloatingPointError("diverged")

    search = inverted(run)
    next(search)
    with pytest.raises(FloatingPointError, match="diverged"):
        search.send(1.0)


def test_a_minimiser_that_swallows_everything_is_stopped_all_the_same():
    def run(objective):
        for _ in range(3):
            try:
                objective(np.array([0.5]))
            except BaseException:
                continue

    search = inverted(run)
    next(search)
    search.close()
    assert helpers() == []


def test_points_are_clipped_to_the_box():
    search = inverted(lambda objective: objective(np.array([-1e-17, 1.0 + 1e-15])))
    assert np.array_equal(next(search).x, [0.0, 1.0])
    search.close()


@pytest.mark.parametrize("name", few(THREADED, 0))
def test_an_interpreter_with_an_open_search_exits_cleanly(name):
    code = (
        "import numpy as np\n"
        "from bender_tuner.optimisers import create\n"
        f"optimiser = create({name!r}, 3, np.random.default_rng(0))\n"
        "optimiser.tell(optimiser.ask(), 1.0)\n"
        "optimiser.ask()\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert (run.returncode, run.stderr) == (0, "")
