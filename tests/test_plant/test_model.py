"""Model files: what is read is what is meant, and what cannot be is refused with its place."""

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
import tomli_w

from bender_plant.blocks import BLOCKS, STAGES
from bender_plant.model import BUILT_IN, ModelError, load_model, model_from_table
from bender_plant.parameter import meanings, unit_suffix
from bender_plant.variables import variables


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_model_survives_its_file(name: str, tmp_path: Path) -> None:
    model = load_model(name)
    path = tmp_path / "model.toml"
    path.write_text(tomli_w.dumps(model.to_table()), encoding="utf-8")
    assert load_model(path) == model
    assert model_from_table(tomllib.loads(path.read_text(encoding="utf-8"))) == model


@pytest.mark.parametrize("name", BUILT_IN)
def test_every_number_is_an_fmi_parameter(name: str) -> None:
    model = load_model(name)
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


def bad(**changes: object) -> dict[str, object]:
    return load_model("paper").to_table() | changes


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (bad(gain=1), "gain: unknown key"),
        (bad(format=2), "format: found 2, expected 1"),
        (bad(name=""), "name: found ''"),
        (bad(block=[]), "expected exactly one of"),
        (bad(block="all"), "expected \\[\\[block\\]\\] tables"),
        (bad(block=[{"id": "magnet"}]), "found 'magnet', expected one of"),
        (bad(block=[{"gain": 1}]), "expected a table with the key id"),
        (bad(block=[{"id": "linear_transduction", "gain": 1}]), r"block\[linear_transduction\].gain: unknown key"),
        (
            bad(block=[{"id": "linear_transduction"}, {"id": "dead_zone", "threshold_V": [1.0, 2.0]}]),
            r"block\[dead_zone\].threshold_V: found \[1.0, 2.0\], expected a single value",
        ),
        (
            bad(block=[{"id": "linear_transduction"}, {"id": "saturation", "form": [["knee"]]}]),
            r"block\[saturation\].form: found \[\['knee'\]\], expected a single value",
        ),
        (
            bad(block=[{"id": "sparse_equation", "terms": [["w"]], "coefficients": [1.0]}]),
            r"block\[sparse_equation\].terms: found \[\['w'\]\], expected a list of single values",
        ),
        (bad(block=[{"id": "linear_transduction"}] * 2), "'linear_transduction' twice"),
        (bad(block=[{"id": "linear_transduction"}, {"id": "learned_hysteresis"}]), "expected exactly one of"),
        (bad(block=[{"id": "learned_hysteresis"}, {"id": "bending_modes", "count": 0}]), "whole number from 1 to 20"),
        (
            bad(block=[{"id": "learned_hysteresis"}, {"id": "bending_modes", "count": 3}]),
            "shares = 'unity', expected 1",
        ),
        (bad(beam={"layer": []}), "no layer"),
        (bad(beam={"layer": [{"thickness_m": 1e-4}]}), "missing .*'name'"),
        (bad(beam={"layer": [{"name": "a", "colour": 1}]}), r"beam.layer\[1\].colour: unknown key"),
        (bad(beam={"layer": [{"name": "a", "thickness_m": -1.0}]}), "thickness_m: found -1.0, expected"),
    ],
)
def test_what_cannot_be_is_refused(table: dict[str, object], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        model_from_table(table)


def test_a_model_without_a_beam_says_what_it_lacks() -> None:
    table = bad()
    del table["beam"]
    with pytest.raises(ModelError, match="no \\[beam\\] in the model"):
        model_from_table(table)


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
