"""Model files: what is read is what is meant, measured numbers, the range in which a model was learned."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from few import few_rows
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_plant.blocks import BLOCKS, STAGES, electrostriction, rate_independent_hysteresis
from bender_plant.composite_beam import natural_frequency_Hz, static_gain_um_per_V
from bender_plant.kernels.curve import bent
from bender_plant.model import BUILT_IN, load_model, model_from_table
from bender_plant.parameter import ModelError, meanings, unit_suffix
from bender_plant.valid_range import ValidRange
from bender_plant.variables import variables


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_model_survives_its_file_and_its_fmi_parameters(name: str, tmp_path: Path) -> None:
    model = load_model(name)
    path = tmp_path / "model.toml"
    path.write_text(tomli_w.dumps(model.to_table()), encoding="utf-8")
    assert load_model(path) == model
    table = {x.name: x.start for x in variables(model) if x.causality == "parameter"}
    assert table == model.values()
    assert model.with_values(model.values()) == model


def test_numbers_change_by_their_fmi_names() -> None:
    model = load_model("paper").with_values(
        {"beam.length": 0.02, "beam.layer[2].thickness": 40e-6, "calibration.offset": 3}
    )
    assert model.beam is not None
    assert model.beam.length_m == 0.02
    assert model.beam.layers[1].thickness_m == 40e-6
    assert model.values()["calibration.offset"] == 3.0
    with pytest.raises(ModelError, match=r"found 'beam.lenght', expected one of"):
        model.with_values({"beam.lenght": 1.0})
    with pytest.raises(ModelError, match=r"bending_modes.damping_ratio: found nan"):
        model.with_values({"bending_modes.damping_ratio": math.nan})


def test_blocks_act_in_the_order_of_the_physics() -> None:
    table = load_model("bench").to_table()
    table["block"].reverse()
    ids = [x.id for x in model_from_table(table).blocks]
    assert ids == ["source_resistance", "learned_hysteresis", "bending_modes", "calibration"]
    stages = [STAGES.index(block.stage) for block in BLOCKS.values()]
    assert stages == sorted(stages)


def test_every_parameter_is_documented_and_bears_its_unit() -> None:
    for block in BLOCKS.values():
        for name, meaning in meanings(block.parameters).items():
            assert name.endswith(unit_suffix(meaning.unit)), (block.id, name)
            assert meaning.text
            assert meaning.low < meaning.high


def test_bad_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"nowhere.toml: No such file.*expected a model file"):
        load_model(tmp_path / "nowhere.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("format = = 1", encoding="utf-8")
    with pytest.raises(ModelError, match=r"broken.toml: .*line 1"):
        load_model(broken)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match="not UTF-8 text"):
        load_model(broken)


@pytest.mark.parametrize("name", ["\udcfe", "a\nb", "\x01", "a\u2028b"])
def test_a_name_that_is_no_text_can_be_written_anywhere(name: str):
    model = replace(load_model("beam"), name=name)
    assert "?" in model.name
    assert model.name.isprintable()
    model.name.encode()
    assert replace(model, name="µ gain é").name == "µ gain é"


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


def paper(**changes: object) -> dict[str, Any]:
    return load_model("paper").to_table() | changes


def paper_of(*block: dict[str, Any]) -> dict[str, Any]:
    return paper(block=[{"id": "linear_transduction"}, *block])


def without(table: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in table.items() if name != key}


def short_of(place: int, key: str) -> dict[str, Any]:
    short = table()
    del short["block"][place][key]
    return short


def beam_of(**layer: Any) -> dict[str, Any]:
    return paper(beam={"layer": [layer]})


def valid(low: Any = 0.0, high: Any = 1.0, **more: Any) -> dict[str, Any]:
    return paper(valid={"lowest_V": low, "highest_V": high, "longest_s": 1.0} | more)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (paper(gain=1), "gain: unknown key"),
        (paper(format=2), "format: found 2, expected 1"),
        (paper(name=""), "name: found ''"),
        (paper(block="all"), r"expected \[\[block\]\] tables"),
        (paper_of({"id": "magnet"}), "found 'magnet', expected one of"),
        (paper_of({"id": "plant_lagg"}), "found 'plant_lagg', expected the id of a block, as plant_lag"),
        (paper_of({"gain": 1}), "expected a table with the key id"),
        (
            paper_of({"id": "dead_zone", "threshold_V": [1.0, 2.0]}),
            r"block\[dead_zone\].threshold_V: found \[1.0, 2.0\], expected a single value",
        ),
        (
            paper(block=[{"id": "sparse_equation", "terms": [["w"]], "coefficients": [1.0]}]),
            r"block\[sparse_equation\].terms: found \[\['w'\]\], expected a list of single values",
        ),
        (paper_of({"id": "linear_transduction"}), "'linear_transduction' twice"),
        (paper_of({"id": "learned_hysteresis"}), "expected exactly one of"),
        (paper_of({"id": "bending_modes", "count": 0}), "whole number from 1 to 20"),
        (paper_of({"id": "bending_modes", "count": 3}), "shares = 'unity', expected 1"),
        (
            paper_of({"id": "electrostriction", "straight_below_V": 3.0, "straight_above_V": 3.0}),
            "straight_below_V",
        ),
        (paper(beam={"layer": []}), "no layer"),
        (beam_of(thickness_m=1e-4), "missing .*'name'"),
        (beam_of(name="a", colour=1), r"beam.layer\[1\].colour: unknown key"),
        (without(paper(), "beam"), r"no \[beam\] in the model"),
        (table(sensitivity="much"), "linear_transduction.sensitivity_um_per_V: found 'much'"),
        (table(frequency=0.0), "bending_modes.first_frequency_Hz: found 0.0, expected 0.001 to"),
        (short_of(0, "sensitivity_um_per_V"), r"expected one to take .* from, or sensitivity_um_per_V"),
        (short_of(1, "first_frequency_Hz"), r"expected one to take .* from, or first_frequency_Hz"),
        (valid(low=1.0, high=0.0), "empty range"),
        (valid(low="low"), "valid.lowest_V: found 'low'"),
        (valid(mood=1.0), "valid.mood: unknown key"),
        (paper(valid={"lowest_V": 0.0}), "valid"),
        (paper(valid=3), "valid: found 3, expected a table"),
    ],
)
def test_a_model_file_that_cannot_be_is_refused_with_the_key(table: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        model_from_table(table)


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


LEARNED = ValidRange(0.0, 50.0, 40.0)


@given(st.lists(st.floats(-100.0, 100.0), min_size=1))
def test_only_commands_outside_leave_the_range(volts: list[float]) -> None:
    assert bool(LEARNED.left_by(volts)) == (min(volts) < -5e-5 or max(volts) > 50.0 + 5e-5)


def test_the_range_stands_in_the_file_and_outlives_a_block() -> None:
    model = replace(load_model("paper"), valid=LEARNED)
    assert model_from_table(model.to_table()) == model
    assert model.with_block("transport_delay", delay_s=0.1).valid == LEARNED
    assert "valid" not in load_model("paper").to_table()


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
