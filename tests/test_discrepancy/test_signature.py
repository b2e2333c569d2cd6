"""The pictures of the signatures against closed forms, and every view drawn once."""

import numpy as np
import pytest
from few import few

from bender_discrepancy.effects.catalogue import EFFECTS, FULL_VOLTAGE_V, FULL_STROKE_um
from bender_discrepancy.report.signature.drives import simulate
from bender_discrepancy.report.signature.picture import draw_signature
from bender_discrepancy.report.signature.views import VIEWS, amplitude_spectrum, response

GAIN_um_per_V = FULL_STROKE_um / FULL_VOLTAGE_V


@pytest.mark.parametrize("effect_id", few(EFFECTS, *range(0, 36, 5)))
def test_every_effect_shows_under_its_drive(effect_id: str):
    signature = simulate(EFFECTS[effect_id])
    assert signature.comparison.before.rms_um > signature.drive.noise_um
    if EFFECTS[effect_id].stage == "calibration":
        assert signature.comparison.recalibrated.rms_um < 1e-9
    else:
        assert np.max(np.abs(signature.residual_um)) > 2.0 * signature.drive.noise_um


def test_a_delay_turns_the_phase_and_keeps_the_gain():
    signature = simulate(EFFECTS["transport_delay"])
    frequency_Hz, late = response(signature, signature.with_um, signature.drive.parts[0])
    _, prompt = response(signature, signature.without_um, signature.drive.parts[0])
    turned = np.unwrap(np.angle(late / prompt))
    assert np.allclose(np.abs(late), GAIN_um_per_V, rtol=0.02)
    assert np.allclose(turned, -2.0 * np.pi * frequency_Hz * 0.05, atol=0.06)


def test_a_lag_is_of_first_order():
    signature = simulate(EFFECTS["source_resistance"])
    frequency_Hz, found = response(signature, signature.with_um, signature.drive.parts[0])
    expected = GAIN_um_per_V / (1.0 + 2j * np.pi * frequency_Hz * 0.02)
    assert np.allclose(found, expected, rtol=0.03)


def test_electrostriction_leaves_its_parabola():
    signature = simulate(EFFECTS["electrostriction"])
    coefficient = EFFECTS["electrostriction"].example["coefficient_um_per_V2"]
    difference = signature.with_um - signature.without_um
    assert np.allclose(difference, coefficient * signature.drive.acting_V**2, atol=5e-3)


def test_hum_is_seen_at_its_alias():
    signature = simulate(EFFECTS["periodic_disturbance"])
    frequency_Hz, amplitude_um = amplitude_spectrum(signature.residual_um, signature.drive.time_s)
    assert frequency_Hz[np.argmax(amplitude_um)] == pytest.approx(60.0 - 2.0 * 29.97, abs=0.006)


def test_an_amplitude_spectrum_gives_the_amplitude():
    time_s = np.arange(1000) / 100.0
    frequency_Hz, amplitude_um = amplitude_spectrum(3.0 + 0.7 * np.sin(2.0 * np.pi * 5.0 * time_s), time_s)
    assert frequency_Hz[np.argmax(amplitude_um)] == pytest.approx(5.0)
    assert amplitude_um.max() == pytest.approx(0.7, rel=1e-3)


@pytest.mark.parametrize("view", few(VIEWS, 0))
def test_every_view_is_used_and_drawn(view: str):
    effect = next(effect for effect in EFFECTS.values() if effect.view == view)
    assert draw_signature(effect, simulate(effect)).startswith(b"\x89PNG")
