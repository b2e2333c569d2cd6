"""Models without a beam: a measured gain and a measured first mode take the place of the calculated ones."""

from pathlib import Path
from typing import Any

import pytest
import tomli_w

from bender_plant.blocks import BLOCKS
from bender_plant.composite_beam import natural_frequency_Hz, static_gain_um_per_V
from bender_plant.model import ModelError, load_model, model_from_table


def table(sensitivity: Any = 0.46, frequency: Any = 118.0, **modes: Any) -> dict[str, Any]:
    return {
        "format": 1,
        "name": "mine",
        "block": [
            {"id": "linear_transduction", "sensitivity_um_per_V": sensitivity},
            {"id": "bending_modes", "first_frequency_Hz": frequency} | modes,
            {"id": "calibration"},
        ],
    }


def constants(model: Any) -> dict[str, Any]:
    return {x.id: BLOCKS[x.id].constants(x.parameters, model.beam) for x in model.blocks}


def test_given_the_numbers_of_a_beam_the_model_is_that_of_the_beam() -> None:
    beam = load_model("beam")
    assert beam.beam is not None
    gain, first = static_gain_um_per_V(beam.beam), natural_frequency_Hz(beam.beam, 1)
    mine = constants(model_from_table(table(gain, first, count=4, shares="beam")))
    theirs = constants(beam)
    assert mine["linear_transduction"] == pytest.approx(theirs["linear_transduction"], rel=1e-14)
    for own, other in zip(mine["bending_modes"], theirs["bending_modes"], strict=True):
        assert own == pytest.approx(other, rel=1e-12)


def test_it_survives_its_file(tmp_path: Path) -> None:
    model = model_from_table(table())
    path = tmp_path / "mine.toml"
    path.write_text(tomli_w.dumps(model.to_table()), encoding="utf-8")
    assert load_model(path) == model
    assert "beam" not in model.to_table()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (table(sensitivity="much"), "linear_transduction.sensitivity_um_per_V: found 'much'"),
        (table(frequency=0.0), "bending_modes.first_frequency_Hz: found 0.0, expected 0.001 to"),
        (table(frequency=float("nan")), "bending_modes.first_frequency_Hz: found nan"),
    ],
)
def test_what_is_no_number_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        model_from_table(given)


def test_without_beam_and_numbers_both_ways_are_told() -> None:
    for place, key in ((0, "sensitivity_um_per_V"), (1, "first_frequency_Hz")):
        short = table()
        del short["block"][place][key]
        with pytest.raises(ModelError, match=rf"expected one to take .* from, or {key}"):
            model_from_table(short)
