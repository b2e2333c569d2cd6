"""Where a model was learned travels with it, and is said where it is left."""

from dataclasses import replace
from pathlib import Path

import pytest
import tomli_w
from few import few_rows
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_plant.blocks import electrostriction, rate_independent_hysteresis
from bender_plant.kernels.curve import bent
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


@pytest.mark.parametrize(("top_V", "is_said"), few_rows([(40.0, False), (60.0, True)], 1))
def test_compare_says_that_a_record_leaves_it(
    top_V: float, is_said: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, record = tmp_path / "model.toml", tmp_path / "record.csv"
    model.write_text(tomli_w.dumps(replace(load_model("paper"), valid=LEARNED).to_table()), encoding="utf-8")
    record.write_text(f"time_s,voltage_V,displacement_um\n0,0,0\n1,10,4\n2,{top_V},9\n3,0,1\n", encoding="utf-8")
    assert main(["compare", str(record), "--model", str(model), "--out", str(tmp_path / "out")]) == 0
    assert ("is an extrapolation" in capsys.readouterr().out) == is_said


@pytest.mark.parametrize("v", [-40.0, -10.0, -3.0, 0.0, 12.0, 20.0, 33.0])
def test_a_curve_runs_straight_beyond_what_it_was_learned_from(v: float) -> None:
    """Inside it is the power law; outside, the line from the origin through its end."""
    low, high = -10.0, 20.0

    def cubic(x: float, ends: tuple[float, float] = (-1e12, 1e12)) -> float:
        return rate_independent_hysteresis.reversible(x, 0.3, -0.02, 0.001, *ends)

    def square(x: float, ends: tuple[float, float] = (-1e12, 1e12)) -> float:
        return electrostriction.parabola(x, 0.01, 0.002, 0.0, *ends)

    def reading(x: float, ends: tuple[float, float] = (-1e12, 1e12)) -> float:
        return bent(x, 0.02, -1e-3, 1e-5, 1e-6, *ends)

    for law in (cubic, square, reading):
        end = min(max(v, low), high)
        expected = law(end) * v / end if end else 0.0
        assert law(v, (low, high)) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_the_ends_of_a_curve_lie_apart() -> None:
    with pytest.raises(ModelError, match="straight_below_V"):
        electrostriction.Parameters(0.1, straight_below_V=3.0, straight_above_V=3.0)
