import io
from typing import Any

import numpy as np
import pytest
from few import few_rows
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
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


@pytest.mark.parametrize(
    ("rows", "offset_um", "height"), few_rows([(3, 0.0, 770), (200, 0.0, 770), (20_000, -120.0, 1100)], 2)
)
def test_picture_is_a_png_of_a_fixed_size_with_something_in_it(rows: int, offset_um: float, height: int):
    overlay = _overlay(rows, offset_um)
    png = draw_overlay(overlay, compare(overlay.measured_um, overlay.simulated_um))
    image = np.asarray(Image.open(io.BytesIO(png)).convert("L"))
    # many swings have a panel more: the worst of them
    assert image.shape == (height, 1320)
    assert 0.005 < (image < 200).mean() < 0.5


@pytest.mark.slow
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


def test_window_shows_all_of_a_short_record_and_the_worst_swings_of_a_long_one():
    rows = np.arange(4_000)
    residual = np.where((rows > 1_500) & (rows < 1_700), 1.0, 0.1)
    assert window(np.sin(rows / 400), residual) == slice(0, 4_000)
    sine = np.sin(rows / 10)
    shown = window(sine, residual)
    assert np.count_nonzero((reversals(sine) >= shown.start) & (reversals(sine) < shown.stop)) == SHOWN_REVERSALS + 1
    assert shown.start <= 1_500
    assert shown.stop >= 1_700


def test_stray_and_lost_readings_do_not_choose_the_swings():
    rows = np.arange(4_000)
    residual = np.where((rows > 1_500) & (rows < 1_700), 1.0, 0.1)
    residual[3_000] = 1e3
    residual[200:900:3] = np.nan
    shown = window(np.sin(rows / 10), residual)
    assert shown.start <= 1_500
    assert shown.stop >= 1_700


@pytest.mark.slow
def test_measured_points_lie_on_top_of_the_model(monkeypatch: pytest.MonkeyPatch):
    drawn: list[Figure] = []
    saved = Figure.savefig

    def keep(figure: Figure, *args: Any, **options: Any) -> None:
        drawn.append(figure)
        saved(figure, *args, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    overlay = _overlay(5_000)
    draw_overlay(overlay, compare(overlay.measured_um, overlay.simulated_um))
    axes = [x for x in drawn[0].axes if x.get_ylabel() == "displacement (µm)"]
    assert len(axes) == 3
    for x in axes:
        points = [line.get_zorder() for line in x.lines if line.get_marker() == "."]
        assert points
        assert min(points) > max(line.get_zorder() for line in x.lines if line.get_marker() != ".")


@given(st.integers(1, 50_000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes(size, seed):
    signal = np.random.default_rng(seed).normal(size=size)
    rows = thinned(signal)
    assert rows.size <= max(MOST_POINTS, 1)
    assert np.all(np.diff(rows) > 0)
    assert (signal[rows].min(), signal[rows].max()) == (signal.min(), signal.max())
