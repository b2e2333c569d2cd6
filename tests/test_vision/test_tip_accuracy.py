"""The tip against pictures drawn by an oracle that shares nothing with the emulated microscope."""

import math

import numpy as np
import pytest
from drawn_wire import HEIGHT, SCALE, WIDTH, draw, picture, tracker
from few import few, few_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_vision import Tracker, TrackerSettings
from bender_vision.scale import Calibration

pytest.importorskip("cv2", reason="needs the extra bench")


@pytest.mark.parametrize("blur_px", few([0.8, 1.2, 2.5], 1))
def test_error_is_a_few_hundredths_of_a_pixel(blur_px: float):
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(6):
        x, y, angle = rng.uniform(180, 220), rng.uniform(60, 180), rng.uniform(-0.1, 0.1)
        tip = tracker().locate(picture(draw(x, y, angle, blur_px=blur_px), rng))
        assert tip.lost is None
        assert tip.confidence > 0.8
        assert math.isnan(tip.displacement_um), "there is no rest position yet"
        errors.append((tip.across_px - y, tip.along_px - x))
    across, along = np.sqrt(np.mean(np.square(errors), axis=0))
    assert across < 0.05
    assert along < 0.1


def test_displacement_is_the_way_across_the_rest_direction():
    rng = np.random.default_rng(2)
    angle, moved_um = math.radians(4.0), 30.0
    eye = tracker()
    eye.zero([picture(draw(200.3, 120.6, angle), rng) for _ in range(3)])
    way = moved_um / SCALE
    moved = draw(200.3 - way * math.sin(angle), 120.6 + way * math.cos(angle), angle + 0.02)
    tip = eye.locate(picture(moved, rng))
    assert tip.lost is None
    assert tip.displacement_um == pytest.approx(moved_um, abs=0.1)


@pytest.mark.parametrize(
    ("border", "positive", "turn"),
    few_rows(
        [
            ("left", "down", lambda image: image),
            ("left", "up", lambda image: image),
            ("right", "down", lambda image: image[:, ::-1]),
            ("right", "up", lambda image: image[:, ::-1]),
            ("top", "right", lambda image: image.T),
            ("top", "left", lambda image: image.T),
            ("bottom", "right", lambda image: image.T[::-1]),
            ("bottom", "left", lambda image: image.T[::-1]),
        ],
        0,
        3,
        5,
        6,
    ),
)
@pytest.mark.parametrize("bright", few([False, True], 0))
def test_wire_may_enter_anywhere(border, positive, turn, bright):
    rng = np.random.default_rng(3)
    rest, moved = (turn(picture(draw(200.0, 110.0 + by, 0.03), rng)) for by in (0.0, 12.0))
    if bright:
        rest, moved = 255 - rest, 255 - moved
    height, width = rest.shape
    settings_ = TrackerSettings(enters_from=border, positive=positive, bright=bright)
    eye = Tracker(settings_, Calibration.of_scale(SCALE, width, height))
    eye.zero([rest])
    tip = eye.locate(np.ascontiguousarray(moved))
    assert tip.lost is None
    expected_um = 12.0 * SCALE * math.cos(0.03) * (1 if positive in ("down", "right") else -1)
    assert tip.displacement_um == pytest.approx(expected_um, abs=0.15)
    assert tip.across_px == pytest.approx(122.0, abs=0.1)


@settings(max_examples=12, deadline=None)
@given(gain=st.floats(0.5, 1.2), slope=st.floats(-0.3, 0.3), step=st.integers(-40, 40), seed=st.integers(0, 1000))
def test_light_and_whole_pixels_change_nothing_but_the_place(gain: float, slope: float, step: int, seed: int):
    rng = np.random.default_rng(seed)
    light = gain * (1.0 + slope * np.linspace(-0.5, 0.5, WIDTH)[None, :])
    levels = draw(200.0, 120.4, 0.02)
    here = tracker().locate(picture(levels * light, rng))
    there = tracker().locate(picture(np.roll(levels, step, axis=0) * light, rng))
    assert here.lost is None
    assert there.lost is None
    assert there.across_px - here.across_px == pytest.approx(step, abs=0.15)


def test_distortion_is_taken_out():
    rng = np.random.default_rng(4)
    bent = Calibration(SCALE, 0.0, 0.05, WIDTH, HEIGHT, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    eye = Tracker(TrackerSettings(), bent)
    eye.zero([picture(draw(200.0, 120.0, 0.0), rng)])
    tip = eye.locate(picture(draw(200.0, 190.0, 0.0), rng))
    assert tip.lost is None
    expected_um = bent.to_um(200.0, 190.0)[1] - bent.to_um(200.0, 120.0)[1]
    assert tip.displacement_um == pytest.approx(expected_um, abs=0.15)
    assert abs(tip.displacement_um - 70.0 * SCALE) > 0.5


def test_extreme_point_sits_on_the_corner_and_is_believed():
    rng = np.random.default_rng(5)
    eye = tracker(method="extreme")
    tip = eye.locate(picture(draw(200.0, 120.0, 0.05), rng))
    assert tip.lost is None
    assert tip.confidence == 1.0
    assert (tip.along_px, tip.across_px) == (round(tip.along_px), round(tip.across_px))
    assert abs(tip.across_px - 120.0) < 7.0
