"""Plants of the tuner's tests: any linear system, exactly sampled, and the learned hysteresis behind a supply lag."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from bender_loop.control.pid import Limits
from bender_loop.control.plant import Plant
from bender_loop.control.sampling import Sampling
from bender_tuner.task.experiment import StepExperiment


class LinearPlant:
    """x' = A x + B u, y = C x + D u + drift t, with A, B, C, D from a transfer function in s."""

    def __init__(self, numerator: ArrayLike, denominator: ArrayLike, drift_um_per_s: float = 0.0) -> None:
        # controllable canonical form, written out so that no signal library is used on this side of a test
        a = np.atleast_1d(np.asarray(denominator, dtype=float))
        b = np.zeros_like(a)
        given = np.atleast_1d(np.asarray(numerator, dtype=float))
        b[b.size - given.size :] = given
        b, a = b / a[0], a / a[0]
        order = a.size - 1
        self.A = np.eye(order, k=1)
        if order:
            self.A[-1] = -a[:0:-1]
        self.B = np.zeros(order)
        if order:
            self.B[-1] = 1.0
        self.D = float(b[0])
        self.C = (b[1:] - self.D * a[1:])[::-1]
        self.drift_um_per_s = drift_um_per_s
        self._exact: dict[float, tuple[NDArray[Any], NDArray[Any]]] = {}
        self.reset()

    def reset(self) -> None:
        self.x = np.zeros(self.B.size)
        self.time_s = 0.0

    def step(self, voltage_V: float, step_s: float) -> float:
        if step_s not in self._exact:
            order = self.B.size
            block = np.zeros((order + 1, order + 1))
            block[:order, :order], block[:order, order] = self.A, self.B
            transition = expm(block * step_s)
            self._exact[step_s] = transition[:order, :order], transition[:order, order]
        phi, gamma = self._exact[step_s]
        self.x = phi @ self.x + gamma * voltage_V
        self.time_s += step_s
        return float(self.C @ self.x) + self.D * voltage_V + self.drift_um_per_s * self.time_s

    def close(self) -> None:
        pass


class RelaxingPlant:
    """Equation (30) of the paper as z = w - 0.818 v behind tau v' = u - v, by the midpoint rule."""

    PARAMETERS: Mapping[str, float] = {"source_resistance.time_constant": 0.02}

    def __init__(self) -> None:
        self.parameters = dict(self.PARAMETERS)
        self.reset()

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        self.parameters.update(parameters)

    def reset(self) -> None:
        self.v = self.z = 0.0
        self.tau = self.parameters["source_resistance.time_constant"]

    def step(self, voltage_V: float, step_s: float) -> float:
        count = math.ceil(step_s / 2e-3 - 1e-9)
        h = step_s / count
        half, whole = math.exp(-0.5 * h / self.tau), math.exp(-h / self.tau)
        v, z = self.v, self.z
        for _ in range(count):
            w = z + 0.818 * v
            w = z + 0.5 * h * self._rate(w, v) + 0.818 * (voltage_V + (v - voltage_V) * half)
            z += h * self._rate(w, voltage_V + (v - voltage_V) * half)
            v = voltage_V + (v - voltage_V) * whole
        self.v, self.z = v, z
        return z + 0.818 * v

    def close(self) -> None:
        pass

    @staticmethod
    def _rate(w: float, v: float) -> float:
        return -0.48 * w + 1.652 * v - 0.22 * abs(w) - 0.124 * w * abs(w)


@pytest.fixture(scope="session")
def linear_plant() -> Callable[..., Plant]:
    return LinearPlant


@pytest.fixture(scope="session")
def relaxing_plant() -> Callable[[], RelaxingPlant]:
    return RelaxingPlant


@pytest.fixture
def lag(linear_plant: Callable[..., Plant]) -> Plant:
    return linear_plant([0.8], [0.02, 1.0])


@pytest.fixture
def experiment(lag: Plant) -> StepExperiment:
    return StepExperiment(lag, Limits(0.0, 50.0), 10.0, Sampling(30.0, 1), 2.0)
