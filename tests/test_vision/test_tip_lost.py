"""Whatever is wrong with a picture: the tip is right or declared lost, never wrong in silence."""

import math

import numpy as np
import pytest
from drawn_wire import HEIGHT, WIDTH, draw, picture, tracker
from few import few
from hypothesis import given, settings
from hypothesis import strategies as st
from present import present
from silent_failures import count_silent_failures, sum_of

from bender_loop.errors import RunError
from bender_vision import TrackerSettings

pytest.importorskip("cv2", reason="needs the extra bench")

WIRE = draw(200.0, 120.0, 0.03)
LIGHT = np.full((HEIGHT, WIDTH), 190.0)


def _reason(levels: np.ndarray) -> str | None:
    tip = tracker().locate(picture(levels, np.random.default_rng(1)))
    if tip.lost is not None:
        assert tip.confidence == 0.0
        assert math.isnan(tip.along_px)
        assert math.isnan(tip.across_px)
        assert math.isnan(tip.displacement_um)
    return tip.lost


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        (np.full((HEIGHT, WIDTH), 3.0), "black"),
        (np.full((HEIGHT, WIDTH), 300.0), "white"),
        (LIGHT, "no wire"),
        (np.minimum(WIRE, draw(220.0, 60.0, 0.0)), "2 wires"),
        (draw(400.0, 120.0, 0.0), "out of view"),
        (draw(200.0, 3.0, 0.0), "wire|thick|view"),
        (draw(200.0, 120.0, 0.03, width_px=3.0), "wire"),
        (draw(200.0, 120.0, 0.03, width_px=24.0), "thick|wire"),
        (draw(25.0, 120.0, 0.03), "wire"),
        (draw(200.0, 150.0, 0.75), "steep|wire"),
        (190.0 - 0.1 * (190.0 - WIRE), "no wire"),
        (np.roll(WIRE, 60, axis=1), "no wire|wire"),
    ],
)
def test_reason_is_given(levels: np.ndarray, expected: str):
    reason = present(_reason(levels))
    assert any(word in reason for word in expected.split("|")), reason


@pytest.mark.parametrize(
    ("levels", "lost"),
    [
        (
            np.where((np.arange(WIDTH) >= 100) & (np.arange(WIDTH) < 130), 190.0, WIRE),
            "the end of the wire is not where it was",
        ),
        (draw(200.0, 120.0, 0.03, width_px=12.0), "the wire is not as thick as it was"),
    ],
)
def test_a_wire_that_is_not_as_it_was_at_rest_is_lost(levels: np.ndarray, lost: str):
    rng = np.random.default_rng(2)
    eye = tracker()
    eye.zero([picture(WIRE, rng)])
    assert eye.locate(picture(WIRE, rng)).lost is None
    assert eye.locate(picture(levels, rng)).lost == lost


@pytest.mark.parametrize("share", few([0.1, 0.3, 0.45], 1))
def test_wire_that_jumps_while_the_shutter_is_open_is_lost(share: float):
    found = tracker()
    found.zero([picture(WIRE, np.random.default_rng(k)) for k in range(5)])
    there = draw(200.0, 160.0, 0.03)
    twice = (1.0 - share) * WIRE + share * there
    assert found.locate(picture(twice, np.random.default_rng(9))).lost is not None
    smeared = np.mean([draw(200.0, 120.0 + y, 0.03) for y in np.linspace(0.0, 4.0, 17)], axis=0)
    tip = found.locate(picture(smeared, np.random.default_rng(9)))
    assert tip.lost is None


def test_picture_of_another_size_is_refused_by_name():
    tip = tracker().locate(np.full((100, 100), 190, np.uint8))
    assert tip.lost is not None
    assert "100 x 100" in tip.lost
    assert f"{WIDTH} x {HEIGHT}" in tip.lost


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), kind=st.integers(0, 3))
def test_any_bytes_are_survived(seed: int, kind: int):
    rng = np.random.default_rng(seed)
    shape = (HEIGHT, WIDTH)
    image = [
        rng.integers(0, 256, shape),
        rng.integers(0, 2, shape) * 255,
        np.tile(rng.integers(0, 256, shape[1]), (shape[0], 1)),
        np.tile(rng.integers(0, 256, shape[0])[:, None], (1, shape[1])),
    ][kind].astype(np.uint8)
    assert tracker().locate(image).lost is not None


def test_rest_needs_the_tip_in_half_of_the_pictures():
    rng = np.random.default_rng(4)
    good, bad = picture(WIRE, rng), picture(LIGHT, rng)
    eye = tracker()
    eye.zero([good, bad])
    assert eye.rest is not None
    with pytest.raises(RunError, match=r"found in 1 of 3 pictures \(no wire enters\)"):
        eye.zero([good, bad, bad])
    assert eye.rest is None
    with pytest.raises(RunError, match="there was no picture"):
        eye.zero([])


@pytest.mark.parametrize(
    "frames", [90, pytest.param(300, marks=pytest.mark.slow), pytest.param(10_000, marks=pytest.mark.trial)]
)
def test_no_silent_failure_among_bad_frames(frames: int):
    tallies, silent = count_silent_failures(frames, 20, "line")
    total = sum_of(tallies.values())
    assert total.frames == frames
    assert total.silent == len(silent) == 0
    assert total.right > frames // 6
    assert tallies["sound"].lost <= 0.2 * tallies["sound"].frames


def test_extreme_point_fails_in_silence():
    # The count can count: the paper's way is believed where there is no wire.
    tallies, silent = count_silent_failures(60, 20, "extreme")
    assert sum_of(tallies.values()).silent == len(silent) > 0


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"method": "guess"}, "method"),
        ({"enters_from": "above"}, "enters_from"),
        ({"positive": "left"}, "positive"),
        ({"enters_from": "top", "positive": "down"}, "positive"),
        ({"wire_um": 0.0}, "wire_um"),
        ({"wire_um": math.nan}, "wire_um"),
        ({"fit_widths": 1.0}, "fit_widths"),
        ({"least_contrast": 1.0}, "least_contrast"),
        ({"least_confidence": True}, "least_confidence"),
        ({"bright": 1}, "bright"),
        ({"end_tolerance_um": "wide"}, "end_tolerance_um"),
    ],
)
def test_bad_settings_are_named(change: dict, named: str):
    with pytest.raises(ValueError, match=f"^{named}: found"):
        TrackerSettings(**change)
