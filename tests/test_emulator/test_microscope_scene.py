"""What the emulated microscope draws: against an oracle, and by its laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_wire import draw
from few import few
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_emulator.microscope import Scene, SceneSettings, Stamp, read_stamp
from bender_emulator.microscope.optics import bar, step
from bender_emulator.microscope.stamp import HEIGHT_PX, WIDTH_PX, write_stamp

pytest.importorskip("cv2", reason="needs the extra bench")

PLAIN = SceneSettings(
    width_px=320, height_px=240, rest_x_px=200.0, rest_y_px=120.0, light_levels=190.0, light_slope=0.0, vignette=0.0,
    opacity=130.0 / 190.0, halo=0.0, glint=0.0, dust=0, specks=0, noise_levels=0.0,
)  # fmt: skip


def _scene(**changes: object) -> Scene:
    return Scene(replace(PLAIN, **changes), np.random.default_rng(1))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("tip_um", few([0.0, 31.7, -60.0], 0))
@pytest.mark.parametrize("blur_px", [0.9, 2.5])
def test_wire_is_where_the_oracle_draws_it(tip_um: float, blur_px: float):
    scene = _scene(blur_px=blur_px, rest_angle_deg=2.0)
    x, y = scene.tip_px(tip_um)
    angle = math.radians(2.0) + PLAIN.rotation_rad_per_um * tip_um
    expected = draw(x, y, angle, blur_px=blur_px)
    # the scene takes a pixel's width for a little more blur, which tells at sharp edges, and the same on both sides
    off = scene.clean(tip_um) - expected
    assert np.abs(off).max() < 3.5
    assert np.sqrt(np.mean(off**2)) < 0.25
    assert abs(off.mean()) < 1e-3
    assert np.abs(scene.render(tip_um) - scene.clean(tip_um)).max() <= 0.51


def test_tip_moves_across_the_wire_by_the_scale():
    scene = _scene(rest_angle_deg=10.0)
    rest, moved = np.array(scene.tip_px(0.0)), np.array(scene.tip_px(30.0))
    assert np.hypot(*(moved - rest)) == pytest.approx(20.0)
    assert (moved - rest) @ (math.cos(math.radians(10.0)), math.sin(math.radians(10.0))) == pytest.approx(0.0, abs=1e-9)


def test_smear_is_the_mean_over_the_exposure():
    scene = _scene(rotation_rad_per_um=0.0)
    smear_px = 6.0
    places_um = (np.arange(200) + 0.5) / 200 * smear_px * PLAIN.um_per_px - smear_px * PLAIN.um_per_px / 2
    expected = np.mean([scene.clean(place) for place in places_um], axis=0)
    assert np.abs(scene.clean(0.0, smear_px) - expected).max() < 0.5


def test_distortion_bends_the_picture_and_not_the_truth():
    straight, bent = _scene(), _scene(distortion=0.05)
    x_um, y_um = bent.object_um()
    row, column = 200, 40
    factor = 1.0 + 0.05 * ((column - 159.5) ** 2 + (row - 119.5) ** 2) / (160**2 + 120**2)
    assert x_um[row, column] == pytest.approx(1.5 * factor * (column - 159.5))
    assert y_um[row, column] == pytest.approx(1.5 * factor * (row - 119.5))
    assert bent.tip_px(40.0) == straight.tip_px(40.0)
    assert np.abs(bent.clean(40.0) - straight.clean(40.0)).max() > 20.0


def test_far_away_tip_leaves_the_picture_empty():
    scene = _scene()
    assert np.array_equal(scene.clean(1e5), scene.light)
    assert np.array_equal(scene.clean(-1e5), scene.light)


def test_noise_has_the_size_asked_for_and_never_repeats():
    scene = _scene(noise_levels=5.0)
    first, second = scene.render(1e5).astype(float), scene.render(1e5).astype(float)
    assert np.std(first - 190.0) == pytest.approx(5.0, rel=0.03)
    assert np.std(first - second) == pytest.approx(5.0 * math.sqrt(2.0), rel=0.03)


def test_same_seed_same_pictures():
    one, two = (Scene(SceneSettings(fibres=2, jpeg_quality=80), np.random.default_rng(7)) for _ in range(2))
    assert all(np.array_equal(one.render(tip), two.render(tip)) for tip in (0.0, 10.0))


@given(width=st.floats(0.5, 30.0), blur=st.floats(0.1, 5.0), smear=st.floats(0.0, 30.0))
def test_bar_keeps_its_light(width: float, blur: float, smear: float):
    place = np.arange(-150.0, 150.0, 0.05)
    profile = bar(place, width, blur, smear)
    assert profile.sum() * 0.05 == pytest.approx(width, rel=1e-3)
    assert -1e-9 <= profile.min() <= profile.max() <= 1.0 + 1e-9
    assert np.allclose(bar(-place, width, blur, smear), profile, atol=1e-9)
    rising = step(place, blur, smear)
    assert np.all(np.diff(rising) >= -1e-12)
    assert rising[0] == pytest.approx(0.0, abs=1e-9)
    assert rising[-1] == pytest.approx(1.0)


@settings(max_examples=50)
@given(
    number=st.integers(0, 2**32 - 1), taken_ns=st.integers(0, 2**64 - 1), tip_nm=st.integers(-(2**31), 2**31 - 1),
    seed=st.integers(0, 100),
)  # fmt: skip
def test_stamp_comes_back(number: int, taken_ns: int, tip_nm: int, seed: int):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (HEIGHT_PX + 5, WIDTH_PX + 9), np.uint8)
    before = image.copy()
    stamp = Stamp(number, taken_ns, tip_nm)
    write_stamp(image, stamp)
    assert read_stamp(image) == stamp
    assert np.array_equal(image[:5], before[:5])
    assert np.array_equal(image[:, :9], before[:, :9])


def test_damaged_or_missing_stamp_is_none():
    image = np.full((HEIGHT_PX, WIDTH_PX), 128, np.uint8)
    assert read_stamp(image) is None
    write_stamp(image, Stamp(1, 2, 3))
    image[:4, :4] = 255 - image[:4, :4]
    assert read_stamp(image) is None
    assert read_stamp(image[:10]) is None
    with pytest.raises(ValueError, match="image: found"):
        write_stamp(image[:10], Stamp(1, 2, 3))
    with pytest.raises(ValueError, match="does not fit"):
        write_stamp(image, Stamp(-1, 2, 3))


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ({"um_per_px": 0}, "um_per_px"),
        ({"width_px": 640.5}, "width_px"),
        ({"dust": -1}, "dust"),
        ({"opacity": 1.5}, "opacity"),
        ({"jpeg_quality": 101}, "jpeg_quality"),
        ({"blur_px": "much"}, "blur_px"),
        ({"colour": 1}, "colour"),
        ({"noise_levels": math.inf}, "noise_levels"),
    ],
)
def test_bad_settings_are_named(table: dict, named: str):
    with pytest.raises(ValueError, match=f"^{named}: "):
        SceneSettings.from_table(table)
