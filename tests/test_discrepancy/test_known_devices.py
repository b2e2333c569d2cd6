"""A real device of which the answer is known: the piezo stack of figure 8 of the paper bends as hysteresis."""

from pathlib import Path

import pytest

from bender_discrepancy.settings import Settings
from bender_discrepancy.workflow import diagnose
from bender_loop.records.record import read_record
from bender_plant.model import load_model

FIGURE_8 = Path(__file__).parents[3] / "shared" / "data" / "paper_fig8.csv"


@pytest.mark.slow
@pytest.mark.skipif(not FIGURE_8.exists(), reason="the record of figure 8 is not part of the repository")
def test_figure_8_is_hysteresis() -> None:
    found = diagnose(load_model("beam"), [read_record(FIGURE_8)], Settings(untimed=True))
    first = found.to_dict()["effects"][0]
    assert first["id"] == "rate_independent_hysteresis"
    assert first["grade"] in ("certain", "likely")
    assert found.gap.after.rms_um <= 0.375
