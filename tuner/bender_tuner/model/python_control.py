"""Plant and controller as systems of python-control, where that is installed."""

from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from bender_loop.control.pid import Gains
from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.state_space import realise


class ControlSystems(NamedTuple):
    """Discrete-time systems of python-control.

    Attributes:
        plant: from the command in V to the reading in µm, with its frames of latency; a `StateSpace`.
        controller: from the error in µm to the command in V, away from its limits; a `TransferFunction`.
        error: of the plant's frequency response, as a share of its largest value; 1e-4 or less where 60 states will do.
    """

    plant: Any
    controller: Any
    error: float

    @property
    def loop(self) -> Any:
        """The open loop L."""
        return self.plant * self.controller


def to_control(gains: Gains, plant: DelayedPlant) -> ControlSystems:
    """Return plant and controller; a derivative on the measurement is in the loop, as in `DelayedPlant.loop`.

    Raises:
        InputError: python-control is not installed.
    """
    try:
        control: Any = import_module("control")
    except ImportError as error:
        raise InputError(f"python-control is not installed; install it with: {install_command('control')}") from error
    states = realise(plant.model, plant.latency_frames)
    numerator, denominator = controller_polynomials(gains, states.period_s)
    return ControlSystems(
        control.ss(states.A, states.B, states.C, 0.0, states.period_s),
        control.tf(numerator, denominator, states.period_s),
        states.error,
    )


def controller_polynomials(gains: Gains, period_s: float) -> tuple[list[float], list[float]]:
    """Return numerator (V/µm) and denominator of the controller, highest power of z first."""
    integrator, lag = np.array([1.0, -1.0]), np.array([gains.filter_time_s + period_s, -gains.filter_time_s])
    with_integral, with_derivative = gains.integral_V_per_um_s > 0.0, gains.derivative_V_s_per_um > 0.0
    left = integrator if with_integral else np.ones(1)
    right = lag if with_derivative else np.ones(1)
    numerator = gains.proportional_V_per_um * np.convolve(left, right)
    if with_integral:
        numerator = numerator + np.convolve([gains.integral_V_per_um_s * period_s, 0.0], right)
    if with_derivative:
        numerator = numerator + gains.derivative_V_s_per_um * np.convolve(integrator, left)
    return numerator.tolist(), np.convolve(left, right).tolist()
