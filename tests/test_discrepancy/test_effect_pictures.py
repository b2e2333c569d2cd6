"""The picture of each effect: what it adds, and what the readings are without it."""

import numpy as np
import pytest
from reported_diagnosis import NOISE_um, hypothesis, record_of, told

from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.report.effect_pictures import components
from bender_plant.model import load_model

PAPER = load_model("paper")


@pytest.mark.parametrize("gain", [1.0, 0.8])
def test_what_is_left_beside_what_an_effect_adds_is_noise(gain: float) -> None:
    effects = {"source_resistance": {"time_constant_s": 0.06}, "backlash": {"half_width_um": 1.5}}
    record = record_of(effects=effects, gain=gain, offset_um=2.0)
    best = hypothesis(PAPER, [record], ("source_resistance", (0.06,)), ("backlash", (1.5,)))
    found = components(find(told([record], best)), 0)
    assert [x.id for x in found] == ["source_resistance", "backlash"]
    for x in found:
        left = x.left_um - x.added_um
        assert np.std(left[np.isfinite(left)]) == pytest.approx(NOISE_um, rel=0.15)
        np.testing.assert_allclose(x.without_um + x.added_um, found[0].without_um + found[0].added_um, atol=1e-9)
        assert np.std(x.added_um) > 3.0 * NOISE_um
