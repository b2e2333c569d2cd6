"""Where a model was learned travels with it, and is said where it is left."""

from dataclasses import replace
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_plant.model import load_model, model_from_table
from bender_plant.parameter import ModelError
from bender_plant.valid_range import ValidRange

LEARNED = ValidRange(0.0, 50.0, 40.0)


@given(st.lists(st.floats(-100.0, 100.0), min_size=1))
def test_only_commands_outside_leave_the_range(volts: list[float]) -> None:
    assert bool(LEARNED.left_by(volts)) == (min(volts) < -5e-5 or max(volts) > 50.0 + 5e-5)


def test_the_range_stands_in_the_file_and_outlives_a_block() -> None:
    model = replace(load_model("paper"), valid=LEARNED)
    assert model_from_table(model.to_table()) == model
    assert model.with_block("transport_delay", delay_s=0.1).valid == LEARNED
    assert "valid" not in load_model("paper").to_table()


@pytest.mark.parametrize(
    ("valid", "told"),
    [
        ({"lowest_V": 1.0, "highest_V": 0.0, "longest_s": 1.0}, "empty range"),
        ({"lowest_V": "low", "highest_V": 0.0, "longest_s": 1.0}, "valid.lowest_V: found 'low'"),
        ({"lowest_V": 0.0, "highest_V": float("inf"), "longest_s": 1.0}, "valid.highest_V: found inf"),
        ({"lowest_V": 0.0}, "valid"),
        ({"lowest_V": 0.0, "highest_V": 1.0, "longest_s": 1.0, "mood": 1.0}, "valid.mood: unknown key"),
        (3, "valid: found 3, expected a table"),
    ],
)
def test_a_range_that_is_none_is_refused(valid: object, told: str) -> None:
    with pytest.raises(ModelError, match=told.replace("(", r"\(")):
        model_from_table(load_model("paper").to_table() | {"valid": valid})


@pytest.mark.parametrize(("top_V", "is_said"), [(40.0, False), (60.0, True)])
def test_compare_says_that_a_record_leaves_it(
    top_V: float, is_said: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, record = tmp_path / "model.toml", tmp_path / "record.csv"
    model.write_text(tomli_w.dumps(replace(load_model("paper"), valid=LEARNED).to_table()), encoding="utf-8")
    record.write_text(f"time_s,voltage_V,displacement_um\n0,0,0\n1,10,4\n2,{top_V},9\n3,0,1\n", encoding="utf-8")
    assert main(["compare", str(record), "--model", str(model), "--out", str(tmp_path / "out")]) == 0
    assert ("is an extrapolation" in capsys.readouterr().out) == is_said
