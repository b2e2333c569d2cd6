"""The noise floor is that of the noise, whatever part of the readings was lost."""

import numpy as np
import pytest

from bender_discrepancy.records.noise import from_spectrum, noise_floor_um


def lost_at_random(share: float, rng: np.random.Generator) -> np.ndarray:
    return rng.random(4000) >= share


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.9])
def test_lost_readings_do_not_lower_the_floor(share: float):
    rng = np.random.default_rng(5)
    noise_um = 0.06 * rng.standard_normal(4000)
    usable = lost_at_random(share, rng)
    assert from_spectrum(noise_um, usable) == pytest.approx(0.06, rel=0.15)
    assert noise_floor_um(np.where(usable, noise_um, 0.0), usable) == pytest.approx(0.06, rel=0.2)


def test_readings_of_the_beginning_alone_have_the_floor_of_their_noise():
    noise_um = 0.06 * np.random.default_rng(6).standard_normal(4000)
    usable = np.arange(4000) < 400
    assert noise_floor_um(np.where(usable, noise_um, 0.0), usable) == pytest.approx(0.06, rel=0.25)


def test_smooth_structure_hardly_raises_it_and_scale_scales_it():
    rng = np.random.default_rng(7)
    rows, usable = np.arange(4000), lost_at_random(0.3, rng)
    left_um = 0.06 * rng.standard_normal(4000) + 2.0 * np.sin(rows / 300.0)
    floor_um = noise_floor_um(left_um, usable)
    assert floor_um == pytest.approx(0.06, rel=0.2)
    assert noise_floor_um(1000.0 * left_um, usable) == pytest.approx(1000.0 * floor_um, rel=1e-9)


def test_too_few_rows_are_refused():
    with pytest.raises(ValueError, match="fewer than 16 rows"):
        noise_floor_um(np.zeros(40), np.arange(40) < 12)
