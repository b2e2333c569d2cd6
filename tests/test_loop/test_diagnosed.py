"""What a diagnosis says of the model beside it, in the units of the rig."""

import json
from pathlib import Path

import pytest

from bender_loop.fmu.diagnosed import NOTHING, Diagnosed, diagnosed

TOLD = {"model": "model.toml", "fmu": "model.fmu", "unit": "K", "input_unit": "W", "gap": {"after": {"rms": 0.3}}}


@pytest.mark.parametrize("name", ["model.toml", "model.fmu"])
def test_the_model_of_a_diagnosis_has_its_units_and_what_it_misses(tmp_path: Path, name: str):
    (tmp_path / "diagnosis.json").write_text(json.dumps(TOLD))
    assert diagnosed(tmp_path / name) == Diagnosed(0.3, ("W", "K"))


@pytest.mark.parametrize("text", [json.dumps(TOLD), json.dumps(TOLD | {"gap": None}), "[]", "{", ""])
def test_another_model_and_what_is_no_diagnosis_say_nothing(tmp_path: Path, text: str):
    (tmp_path / "diagnosis.json").write_text(text)
    assert diagnosed(tmp_path / ("other.toml" if "0.3" in text else "model.toml")) == NOTHING
    assert diagnosed("paper") == diagnosed(None) == NOTHING
