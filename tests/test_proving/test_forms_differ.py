"""A hidden saturation is none that the catalogue has: the nearest of its forms misses the curve."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from bender_plant.blocks.saturation import FORMS, flattened
from bender_proving.cases.effects import INSIDE
from bender_proving.physics.material import _flattened

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
