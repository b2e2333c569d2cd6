"""The noise of a training record: outlying readings are none of it."""

import numpy as np
import pytest

from bender_watch.baseline.noise import fit_noise


@pytest.mark.parametrize("rows", [1000, 4000])
@pytest.mark.parametrize("phi", [0.0, 0.7])
def test_outlying_readings_are_no_noise(rows: int, phi: float) -> None:
    rng = np.random.default_rng(rows)
    noise = 0.05 * rng.standard_normal(rows)
    for k in range(1, rows):
        noise[k] += phi * noise[k - 1]
    outlying = rng.random(rows) < 0.01
    found, kept = fit_noise(noise + outlying, np.ones(rows, bool), np.ones(rows), 1e-9)
    assert not np.any(kept & outlying)
    assert kept.mean() > 0.95
    assert found.spreads_um[-1] == pytest.approx(0.05, rel=0.08)
    assert found.spreads_um[0] == pytest.approx(0.05 / np.sqrt(1.0 - phi**2), rel=0.12)
