"""Matrices of few states, and systems of python-control, against the pulse response they come from."""

import sys

import numpy as np
import pytest

from bender_loop.control.pid import Gains
from bender_loop.errors import InputError
from bender_tuner.model.loop_transfer import DelayedPlant, controller_response
from bender_tuner.model.margins import margins
from bender_tuner.model.python_control import controller_polynomials, to_control
from bender_tuner.model.sampled_model import SampledModel
from bender_tuner.model.state_space import TOLERANCE, realise

PERIOD_S = 0.02
SAMPLES = np.arange(300)
SWINGING = 0.1 * 0.9**SAMPLES * np.cos(0.7 * SAMPLES) + 0.3 * 0.8**SAMPLES
GAINS = Gains(0.4, 5.0, 0.01, 0.05)


@pytest.mark.parametrize(
    ("pulse", "ratio", "latency", "states"),
    [
        (SWINGING, 0.0, 0, 3),
        (SWINGING, 0.0, 2, 5),
        (SWINGING[:30] + 0.01 * 0.99 ** SAMPLES[:30], 0.99, 0, 31),
        (0.2 * 0.8 ** SAMPLES[:60] + 0.1, 1.0, 0, 2),
        (0.3 * 0.5 ** SAMPLES[:20], 0.5, 1, 2),
        (np.concatenate((SWINGING, np.zeros(300))), 0.0, 0, 3),
    ],
    ids=["modes", "late", "slow tail", "integrating", "quick tail", "long"],
)
def test_few_states_give_the_same_step(pulse: np.ndarray, ratio: float, latency: int, states: int):
    model = SampledModel(PERIOD_S, pulse, ratio)
    found = realise(model, latency)
    assert found.error <= TOLERANCE
    assert found.A.shape[0] <= states
    assert np.max(np.abs(np.linalg.eigvals(found.A))) <= 1.0 + 1e-9
    x, readings = np.zeros((found.A.shape[0], 1)), []
    for _ in range(120):
        readings.append(float((found.C @ x)[0, 0]))
        x = found.A @ x + found.B
    wanted = np.concatenate((np.zeros(latency), model.step_response(120)))[:120]
    assert readings == pytest.approx(wanted, abs=2e-3 * float(np.max(np.abs(wanted))))


@pytest.mark.parametrize(
    "gains", [GAINS, Gains(0.4, 0.0, 0.01, 0.05), Gains(0.4, 5.0), Gains(0.0, 5.0), Gains(0.4, 0.0)]
)
def test_the_polynomials_are_the_controller(gains: Gains):
    omega = np.pi / PERIOD_S * np.array([0.01, 0.3, 0.9])
    numerator, denominator = controller_polynomials(gains, PERIOD_S)
    z = np.exp(1j * omega * PERIOD_S)
    assert np.polyval(numerator, z) / np.polyval(denominator, z) == pytest.approx(
        controller_response(gains, PERIOD_S, omega)
    )


def test_without_python_control_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(InputError, match=r"not installed; install it with: python -m pip install control"):
        to_control(GAINS, DelayedPlant(SampledModel(PERIOD_S, SWINGING), 1))


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")
def test_python_control_finds_our_margins():
    control = pytest.importorskip("control", reason="needs the extra control")
    plant = DelayedPlant(SampledModel(PERIOD_S, SWINGING), 1)
    systems = to_control(GAINS, plant)
    ours = margins(GAINS, plant)
    # over frequency: the roots of its polynomials lose a crossing on some processors
    omega = np.geomspace(0.05, 0.999 * np.pi / PERIOD_S, 2000)
    gain_margin, phase_deg, modulus, *_ = control.stability_margins(control.FRD(systems.loop, omega, smooth=True))
    assert gain_margin == pytest.approx(ours.gain_margin, rel=1e-2)
    assert phase_deg == pytest.approx(ours.phase_margin_deg, rel=1e-2)
    assert 1.0 / modulus == pytest.approx(ours.sensitivity_peak, rel=1e-2)
