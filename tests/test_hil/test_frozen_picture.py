"""A frozen picture is told by the content around the wire; a still one is not taken for it. Both with statistics."""

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from few import few
from present import present

from bender_emulator.microscope.scene import Scene
from bender_emulator.microscope.settings import SceneSettings
from bender_hil.runner.picture_checks import FROZEN_READING, AnswerCheck, FrozenCheck
from bender_hil.runner.program import Decision
from bender_hil.runner.tip_camera import Sight
from bender_loop.shell.opencv import import_cv2
from bender_vision.scale import Calibration
from bender_vision.settings import TrackerSettings
from bender_vision.stillness import Image, Stillness, equal_shares
from bender_vision.tracker import Tracker

pytest.importorskip("cv2")

SETTINGS, CALIBRATION = TrackerSettings(), Calibration.of_scale(1.5)
WIDTH_PX = SETTINGS.wire_um / CALIBRATION.um_per_px
SCENES = {
    "usual": SceneSettings(),
    "little noise": SceneSettings(noise_levels=0.6),
    "much noise": SceneSettings(noise_levels=8.0),
    "compressed": SceneSettings(jpeg_quality=80),
}
Mask = Callable[[Image, int], Image]


def _still(name: str, seed: int) -> Iterator[Image]:
    scene = Scene(SCENES[name], np.random.default_rng(seed))
    while True:
        yield scene.render(12.0)


def _watch(images: Iterator[Image], turned: str = "left") -> tuple[Stillness, Tracker]:
    settings = TrackerSettings(enters_from=turned)
    first = [next(images) for _ in range(15)]
    height, width = first[0].shape
    tracker = Tracker(settings, Calibration.of_scale(1.5, width, height))
    tracker.zero(first)
    stillness = Stillness(settings, WIDTH_PX)
    stillness.learn(first)
    return stillness, tracker


def _counts(stillness: Stillness, tracker: Tracker, images: Iterator[Image], number: int) -> list[int]:
    counts = []
    for _ in range(number):
        image = next(images)
        tip = tracker.locate(image)
        counts.append(stillness.add(image, tip.along_px, tip.across_px))
    return counts


@pytest.mark.parametrize("name", few(SCENES, 0))
def test_a_wire_that_stands_still_is_never_frozen(name: str):
    images = _still(name, 3)
    counts = _counts(*_watch(images), images, 300)
    # the emulated noise repeats itself once in 9216 pictures, a real one never; three in a row end a run
    assert max(counts) <= 1
    assert sum(counts) <= 1


def _overlay(image: Image, number: int) -> Image:
    cv2 = import_cv2()
    shown = image.copy()
    cv2.putText(shown, f"{number:08d}", (10, 460), cv2.FONT_HERSHEY_SIMPLEX, 1.2, 255, 3)
    return shown


def _flicker(image: Image, number: int) -> Image:
    shown = image.copy()
    shown[number % 480, (7 * number) % 640] ^= 255
    return shown


def _overlay_across_the_wire(image: Image, number: int) -> Image:
    cv2 = import_cv2()
    shown = image.copy()
    cv2.putText(shown, f"{number:08d}", (290, 200), cv2.FONT_HERSHEY_SIMPLEX, 0.7, 255, 2)
    return shown


def _torn(image: Image, number: int) -> Image:
    shown = image.copy()
    shown[:200] = np.random.default_rng(number).integers(0, 255, (200, 640), np.uint8)
    return shown


@pytest.mark.parametrize("name", few(SCENES, 0))
@pytest.mark.parametrize("mask", few([_flicker, _overlay, _overlay_across_the_wire, _torn], 2, 3))
def test_a_frozen_picture_is_found_in_three_frames_whatever_moves_elsewhere(name: str, mask: Mask):
    for seed in range(8):
        images = _still(name, seed)
        stillness, tracker = _watch(images)
        assert _counts(stillness, tracker, images, 3)[-1] == 0
        last = next(images)
        frozen = (mask(last, number) for number in range(100))
        # the first of the repeated pictures may be a live one
        assert _counts(stillness, tracker, frozen, 4)[-1] >= 3


@pytest.mark.parametrize("border", ["left", "right", "top", "bottom"])
def test_the_wire_is_looked_at_wherever_it_enters(border: str):
    def turned() -> Iterator[Image]:
        for image in _still("usual", 5):
            picture = image.T if border in ("top", "bottom") else image
            flipped = picture[::-1] if border == "bottom" else picture[:, ::-1] if border == "right" else picture
            yield np.ascontiguousarray(flipped)

    images = turned()
    stillness, tracker = _watch(images, border)
    assert max(_counts(stillness, tracker, images, 20)) == 0
    last = next(images)
    far = {"left": np.s_[:, 560:], "right": np.s_[:, :80], "top": np.s_[560:], "bottom": np.s_[:80]}[border]
    rng = np.random.default_rng(0)
    for _ in range(4):
        shown = last.copy()
        shown[far] = rng.integers(100, 255, shown[far].shape, np.uint8)
        tip = tracker.locate(last)
        stillness.add(shown, tip.along_px, tip.across_px)
    assert stillness.count >= 3


@pytest.mark.parametrize("name", SCENES)
def test_a_live_picture_is_not_dead(name: str):
    stillness, _ = _watch(_still(name, 2))
    assert not stillness.is_dead(400.0, 240.0)
    assert not stillness.is_dead(math.nan, math.nan)


def test_pictures_without_noise_are_dead_and_say_nothing():
    image = next(_still("usual", 1))
    stillness = Stillness(SETTINGS, WIDTH_PX)
    stillness.learn([_flicker(image, number) for number in range(15)])
    assert stillness.is_dead(400.0, 240.0)
    stillness.learn([image] * 15)
    assert [stillness.add(image, 400.0, 240.0) for _ in range(5)] == [0] * 5
    stillness.learn([])
    assert stillness.add(image, 400.0, 240.0) == 0


def test_a_lost_tip_or_another_size_says_nothing():
    images = _still("usual", 1)
    stillness, _ = _watch(images)
    image = next(images)
    stillness.add(image, 400.0, 240.0)
    assert stillness.add(image, 400.0, 240.0) == 1
    assert stillness.add(image, math.nan, math.nan) == 0
    assert stillness.add(image[:, :320], 400.0, 240.0) == 0


def test_shares_are_those_of_the_pixels():
    rng = np.random.default_rng(0)
    one, other = (rng.integers(0, 3, (40, 70), np.uint8) for _ in range(2))
    shares = equal_shares(one, other)
    assert shares.shape == (2, 4)
    assert shares[1, 2] == np.mean(one[16:32, 32:48] == other[16:32, 32:48])


def _sight(time_s: float, tip_um: float | None, frozen: int = 0) -> Sight:
    return Sight(0, time_s, 0, tip_um, 1.0, None, np.zeros((2, 2), np.uint8), frozen)


def test_more_than_the_allowed_frozen_frames_end_the_run():
    check = FrozenCheck(2)
    assert check.see(_sight(0.0, 1.0, 2), Decision(0.0, None)) is None
    assert present(check.see(_sight(0.0, 1.0, 3), Decision(0.0, None))).code == "frozen"
    of_sensor = present(FrozenCheck(2, FROZEN_READING).see(_sight(0.0, 1.0, 3), Decision(0.0, None)))
    assert "reading" in of_sensor.sentence
    assert "picture" not in of_sensor.sentence


def _answers(tips: list[float | None], volts: list[float], noise_um: float = 0.05) -> int | None:
    check = AnswerCheck(0.2, 10.0, lambda: noise_um)
    for k, (tip_um, voltage_V) in enumerate(zip(tips, volts, strict=True)):
        trip = check.see(_sight(k / 30.0, tip_um), Decision(voltage_V, None))
        if trip is not None:
            assert trip.code == "unanswered"
            return k
    return None


@pytest.mark.parametrize("seed", range(20))
def test_a_still_command_expects_nothing(seed: int):
    rng = np.random.default_rng(seed)
    level_V = float(rng.uniform(0.0, 50.0))
    rise = np.minimum(np.arange(3600) * 3.0, level_V)
    tips = 0.4 * np.concatenate([[0.0] * 3, rise[:-3]]) + 0.05 * rng.standard_normal(3600)
    assert _answers(list(tips), list(rise)) is None


@pytest.mark.parametrize("seed", range(20))
def test_a_recording_with_noise_of_its_own_is_found_when_the_loop_winds_up(seed: int):
    rng = np.random.default_rng(seed)
    level_V, rate = float(rng.uniform(5.0, 20.0)), float(rng.uniform(1.0, 60.0))
    volts = np.minimum(level_V + rate * np.maximum(0.0, np.arange(1800) / 30.0 - 2.0), 50.0)
    tips = 0.4 * level_V + 0.05 * rng.standard_normal(1800)
    found = present(_answers(list(tips), list(volts)))
    # 13 V beyond where the tip last moved, and half a second
    assert found / 30.0 <= 2.0 + 14.0 / rate + 0.6


@pytest.mark.parametrize("hidden", ["dead zone", "play", "delay", "lag", "small gain", "slow supply", "saturation"])
def test_what_a_real_bench_may_hide_is_no_silence(hidden: str):
    rng = np.random.default_rng(1)
    times = np.arange(1800) / 30.0
    volts = 25.0 - 25.0 * np.cos(2.0 * math.pi * 0.1 * times)
    tip, place, lagged, supply = [], 0.0, 0.0, 0.0
    for k, voltage_V in enumerate(volts):
        seen_V = volts[max(0, k - 9)] if hidden == "delay" else voltage_V
        supply += float(np.clip(seen_V - supply, -5.0 / 30.0, 5.0 / 30.0))
        seen_V = supply if hidden == "slow supply" else seen_V
        seen_V = max(seen_V - 10.0, 0.0) if hidden == "dead zone" else seen_V
        seen_V = 20.0 * math.tanh(seen_V / 20.0) if hidden == "saturation" else seen_V
        moved = (0.04 if hidden == "small gain" else 0.4) * seen_V
        lagged += (moved - lagged) / 30.0
        place = min(max(place, moved - 2.0), moved + 2.0)
        tip.append(place if hidden == "play" else lagged if hidden == "lag" else moved)
    assert _answers(list(np.array(tip) + 0.05 * rng.standard_normal(1800)), list(volts)) is None


def test_a_tip_that_is_lost_or_a_command_to_and_fro_expects_nothing():
    volts = [0.0 if k % 10 < 5 else 40.0 for k in range(300)]
    assert _answers([0.0] * 300, volts) is None
    assert _answers([None] * 300, [30.0] * 300) is None
    assert _answers([0.0] * 300, [30.0] * 300) == 15
