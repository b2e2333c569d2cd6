import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from bender_loop.records.compare import compare
from bender_report.chart import MOST_POINTS, thinned
from bender_report.record_overlay import SHOWN_REVERSALS, Overlay, draw_overlay, reversals, window


def _overlay(rows: int, offset_um: float = 0.0) -> Overlay:
    time_s = np.arange(rows) / 30
    voltage_V = 25 + 25 * np.sin(time_s)
    measured_um = 0.47 * voltage_V + offset_um
    if rows > 10:
        measured_um[4] = np.nan
    return Overlay("record over model", time_s, "time (s)", voltage_V, measured_um, 0.5 * voltage_V)


@pytest.mark.parametrize(("rows", "offset_um"), [(3, 0.0), (200, 0.0), (20_000, -120.0)])
def test_picture_is_a_png_of_a_fixed_size_with_something_in_it(rows: int, offset_um: float):
    overlay = _overlay(rows, offset_um)
    png = draw_overlay(overlay, compare(overlay.measured_um, overlay.simulated_um))
    image = np.asarray(Image.open(io.BytesIO(png)).convert("L"))
    assert image.shape == (770, 1320)
    assert 0.005 < (image < 200).mean() < 0.5


def test_constant_signals_can_be_drawn():
    flat = np.zeros(5)
    overlay = Overlay("still", np.arange(5.0), "row", flat, flat, flat)
    assert draw_overlay(overlay, compare(flat, flat)).startswith(b"\x89PNG")


def test_reversals_of_a_triangle_are_its_corners():
    triangle = np.concatenate([np.arange(0, 10), np.arange(10, 0, -1), np.arange(0, 11)]).astype(float)
    assert reversals(triangle).tolist() == [10, 20]


@given(st.floats(-100, 100), st.floats(0.01, 100), st.booleans())
def test_reversals_do_not_depend_on_shift_scale_or_sign(shift, scale, mirrored):
    signal = np.random.default_rng(5).normal(size=50).cumsum()
    bent = shift + (-scale if mirrored else scale) * signal
    assert reversals(bent).tolist() == reversals(signal).tolist()


def test_window_shows_all_of_a_short_record_and_the_end_of_a_long_one():
    rows = np.arange(4_000)
    assert window(np.sin(rows / 400)) == slice(0, 4_000)
    sine = np.sin(rows / 10)
    shown = window(sine)
    assert shown.stop == 4_000
    assert reversals(sine)[-SHOWN_REVERSALS] == shown.start


@given(st.integers(1, 50_000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes(size, seed):
    signal = np.random.default_rng(seed).normal(size=size)
    rows = thinned(signal)
    assert rows.size <= max(MOST_POINTS, 1)
    assert np.all(np.diff(rows) > 0)
    assert (signal[rows].min(), signal[rows].max()) == (signal.min(), signal.max())
