"""Roots of a frequency response, against transfer functions whose roots are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import TransferFunction, freqresp

from bender_identify.first_model.frequency_start import frequency_starts, rational, response
from bender_identify.first_model.structures import Structure
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_loop.records.record import Record

OMEGA = np.linspace(0.5, 200.0, 300)


def two_modes(frequencies_Hz: tuple[float, float], damping: tuple[float, float], share: float) -> TransferFunction:
    parts = []
    for f, zeta, part in zip(frequencies_Hz, damping, (1.0 - share, share), strict=True):
        w = 2.0 * np.pi * f
        parts.append((np.array([part * w**2]), np.array([1.0, 2.0 * zeta * w, w**2])))
    (b1, a1), (b2, a2) = parts
    return TransferFunction(np.polyadd(np.polymul(b1, a2), np.polymul(b2, a1)), np.polymul(a1, a2))


@settings(deadline=None, max_examples=30)
@given(
    low=st.floats(2.0, 8.0),
    apart=st.floats(1.5, 3.0),
    damping=st.tuples(st.floats(0.01, 0.5), st.floats(0.01, 0.5)),
    share=st.floats(0.1, 0.9),
)
def test_the_roots_of_two_modes_come_back(low: float, apart: float, damping: tuple[float, float], share: float):
    frequencies = low, low * apart
    _, found = freqresp(two_modes(frequencies, damping, share), OMEGA)
    left, roots = rational(OMEGA, found, np.ones(OMEGA.size), 2, 4)
    pairs = sorted((x for x in roots if x.imag > 0.0), key=abs)
    assert left < 1e-12
    assert [abs(x) / (2.0 * np.pi) for x in pairs] == pytest.approx(frequencies, rel=1e-4)
    assert [-x.real / abs(x) for x in pairs] == pytest.approx(damping, rel=1e-3)


def test_a_start_has_lag_and_mode_of_a_record_and_its_delay():
    """The record is computed by another integrator: a lag of 0.2 s, a mode of 3 Hz, and thirty rows of delay."""
    from scipy.signal import lsim

    rows, row_s, late = 3000, 0.02, 30
    omega, zeta, tau_s = 2.0 * np.pi * 3.0, 0.1, 0.2
    volts = np.repeat(np.random.default_rng(1).uniform(-10.0, 10.0, rows // 10), 10)
    fine = np.repeat(volts, 20)
    system = TransferFunction([omega**2], np.polymul([tau_s, 1.0], [1.0, 2.0 * zeta * omega, omega**2]))
    read = lsim(system, fine, np.arange(fine.size) * row_s / 20, interp=False)[1][::20]
    read = np.concatenate([np.zeros(late), read])[:rows]
    experiment = experiment_of(Record(np.arange(rows, dtype=np.float64) * row_s, volts, read), "first", Settings())
    structure = Structure(lags=1, modes=1, delay=True)
    starts = list(frequency_starts(structure, experiment, np.arange(0.4, 0.8, row_s / 2)))
    nearest = min(starts, key=lambda x: abs(x[-1] - late * row_s))
    assert nearest == pytest.approx((tau_s, 3.0, zeta, late * row_s), rel=0.1)


def test_a_short_record_has_no_response_and_a_gain_no_roots():
    short = Record(0.02 * np.arange(100.0), np.arange(100.0), np.arange(100.0))
    experiment = experiment_of(short, "first", Settings())
    assert response(experiment) is None
    assert list(frequency_starts(Structure(lags=1), experiment, np.zeros(1))) == []
    assert list(frequency_starts(Structure(), experiment, np.zeros(1))) == []
