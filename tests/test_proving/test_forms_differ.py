"""What is hidden has none of the catalogue's forms: the nearest of these misses the curve."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from bender_plant.blocks.electrostriction import parabola
from bender_plant.blocks.saturation import FORMS, flattened
from bender_plant.kernels.vibration_mode import cubic_at
from bender_proving.cases.effects import INSIDE
from bender_proving.cases.hidden import Hidden, Setting
from bender_proving.cases.nominal import FULL_STROKE_UM
from bender_proving.physics import nonlinear_mode
from bender_proving.physics.grid import build_grid
from bender_proving.physics.material import _flattened, after
from bender_proving.records.excitation import RATE_HZ

VOLTS = np.linspace(0.0, 50.0, 101)
SCALE_V = 30.0


@pytest.mark.parametrize("hidden", INSIDE["saturation"].forms)
@pytest.mark.parametrize("known", range(len(FORMS)), ids=FORMS)
def test_no_form_of_the_catalogue_is_a_hidden_one(hidden: str, known: int) -> None:
    curve = SCALE_V * np.asarray(_flattened(hidden, VOLTS / SCALE_V))

    def missed(x: np.ndarray) -> np.ndarray:
        s, n, c = np.exp(x[0]), np.exp(x[1]), 1.0 / (1.0 + np.exp(-x[2]))
        return np.array([flattened(float(v), float(s), float(known), float(n), float(c)) for v in VOLTS]) - curve

    starts = ([np.log(30.0), np.log(2.0), 3.0], [np.log(60.0), np.log(1.5), 0.0])
    nearest = min((least_squares(missed, x) for x in starts), key=lambda found: found.cost)
    assert np.max(np.abs(nearest.fun)) > 1e-3


def drawn(name: str, form: str, seed: int) -> Hidden:
    entry = INSIDE[name]
    sensor = next(iter(entry.ranges))
    sizes = entry.ranges[sensor]
    size = 0.02 if form == "sine" else (sizes[0] * sizes[1]) ** 0.5
    return entry.hide(form, size, Setting(sensor, RATE_HZ[sensor], 170.0), np.random.default_rng(seed))


def missed_by_multiples(curve: np.ndarray, known: np.ndarray) -> float:
    """Return by which part of a curve the nearest multiple of a known one misses it."""
    nearest = known * float(curve @ known) / float(known @ known)
    return float(np.max(np.abs(curve - nearest)) / np.max(np.abs(curve)))


@pytest.mark.parametrize("form", INSIDE["electrostriction"].forms)
@pytest.mark.parametrize("seed", range(4))
def test_no_hidden_electrostriction_is_a_square_or_a_bent_one_of_the_catalogue(form: str, seed: int) -> None:
    """A few hundred-thousandths of the curve apart: whatever bends a parabola by hundredths is nearly alike."""
    hidden = drawn("electrostriction", form, seed)
    curve = after(hidden, np.zeros_like(VOLTS), VOLTS, build_grid(np.array([0.0, 1.0]), np.array([0.5]), 0.0, 1.0))
    most = float(np.max(np.abs(curve)))
    assert missed_by_multiples(curve, VOLTS**2) > 1e-3

    def missed(x: np.ndarray) -> np.ndarray:
        c, flattening, growth = x[0] * most / 2500.0, max(x[1], 0.0) / 2500.0, max(-x[1], 0.0) / 2500.0
        return np.array([parabola(float(v), c, flattening, growth, -1e12, 1e12) for v in VOLTS]) / most - curve / most

    nearest = min((least_squares(missed, [1.0, bend], xtol=1e-14) for bend in (0.1, -0.1)), key=lambda x: x.cost)
    assert np.max(np.abs(nearest.fun)) > 2e-6


@pytest.mark.parametrize("form", INSIDE["stiffening"].forms)
@pytest.mark.parametrize("seed", range(4))
def test_no_hidden_stiffening_is_a_cubic_or_a_bent_one_of_the_catalogue(form: str, seed: int) -> None:
    """Some millionths of the force apart: whatever bends a cubic by hundredths is nearly alike."""
    hidden = drawn("stiffening", form, seed)
    furthest = 2.0 * FULL_STROKE_UM
    q_um = np.linspace(-furthest, furthest, 101)
    kind = nonlinear_mode.SINE if form == "sine" else nonlinear_mode.CUBIC
    excess = np.array([nonlinear_mode._excess(kind, x, hidden["k3_per_um2"], hidden["quintic_per_um2"]) for x in q_um])
    most = float(np.max(np.abs(excess)))
    assert missed_by_multiples(excess, q_um**3) > 1e-3

    def missed(x: np.ndarray) -> np.ndarray:
        bent = [cubic_at(float(q), x[0] * hidden["k3_per_um2"], x[1] / furthest**2) * q**3 for q in q_um]
        return (np.array(bent) - excess) / most

    nearest = min((least_squares(missed, [1.0, bend], xtol=1e-14) for bend in (0.01, -0.01)), key=lambda x: x.cost)
    assert np.max(np.abs(nearest.fun)) > 1e-7


@pytest.mark.parametrize("form", INSIDE["sensor_lag"].forms)
@pytest.mark.parametrize("seed", range(4))
def test_no_hidden_sensor_lag_has_a_single_pole_or_two(form: str, seed: int) -> None:
    hidden = drawn("sensor_lag", form, seed)
    assert hidden["second_tau_s"] > 1e-3 * hidden["tau_s"]
    assert hidden["third_tau_s"] > 5e-3 * hidden["second_tau_s"]
    poles = hidden["tau_s"] + hidden["second_tau_s"] + hidden["third_tau_s"]
    assert poles == pytest.approx(abs(hidden.magnitude))
