"""The smallest visible size of an effect: what is larger shows in such a record, what is far smaller does not."""

import json
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of, told

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.smallest_visible import Smallest, smallest_visible
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.report.visible_section import NEVER, visible_rows
from bender_discrepancy.search.result import SearchResult
from bender_discrepancy.workflow import candidate_forms, search_records
from bender_loop.records.record import Record
from bender_plant.model import load_model

QUIET = ("no_gap", "recalibrated")


def with_forms(search: SearchResult) -> SearchResult:
    return replace(search, candidates=candidate_forms(search.base, search.problem.observations))


@cache
def of_a_quiet_record() -> dict[str, Smallest]:
    return smallest_visible(with_forms(told([record_of("beam", voltage_V=levels(40.0))], base=load_model("beam"))))


def settings_of(entry: Smallest, factor: float) -> dict[str, Any]:
    """The block's parameters, so many times as far from no effect as what just shows."""
    assert entry.value is not None
    neutral = {"damping_ratio": 0.02, "frequency_ratio": 1.0}.get(entry.parameter, 0.0)
    own = entry.value / factor if entry.below else neutral + factor * (entry.value - neutral)
    found: dict[str, Any] = {}
    for name, value in [(entry.parameter, own), *((x, y) for x, y, _ in entry.beside)]:
        field, bracket, _ = name.partition("[")
        found[field] = (value,) if bracket else value
    return found


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["dead_zone", "creep", "thermal_drift", "structural_damping", "saturation"])
def test_what_is_larger_shows_and_what_is_far_smaller_does_not(effect: str) -> None:
    entry, base, volts = of_a_quiet_record()[effect], load_model("beam"), levels(40.0)

    def diagnosed(factor: float) -> SearchResult:
        record = record_of("beam", {effect: settings_of(entry, factor)}, voltage_V=volts, seed=11)
        return search_records(base, [record])

    assert diagnosed(0.25).verdict.word in QUIET
    assert effect in diagnosed(2.5).best.hypothesis.effects


def record_with_noise(factor: float) -> Record:
    clean = record_of("beam", voltage_V=levels(40.0))
    volts, time_s = levels(40.0), FRAME_S * np.arange(levels(40.0).size, dtype=np.float64)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(load_model("beam")).reading_um
    return replace(clean, displacement_um=reading_um + factor * (clean.displacement_um - reading_um))


@pytest.mark.slow
def test_twice_the_noise_hides_twice_as_much() -> None:
    def sizes(factor: float) -> dict[str, Smallest]:
        search = with_forms(told([record_with_noise(factor)], base=load_model("beam")))
        return smallest_visible(
            replace(search, found=replace(search.found, archive=replace(search.archive, noise_um=factor * NOISE_um)))
        )

    once, twice = sizes(1.0), sizes(2.0)
    for effect in ("electrostriction", "thermal_drift", "creep", "lens_distortion", "charge_leakage", "dead_zone"):
        small, large = once[effect].value, twice[effect].value
        assert small is not None
        assert large is not None
        assert large / small == pytest.approx(2.0, rel=0.15), effect
    assert twice["offset"].value == pytest.approx(2.0 * (once["offset"].value or 0.0))


def test_what_no_command_would_show_is_said_to_be_invisible() -> None:
    time_s = FRAME_S * np.arange(900, dtype=np.float64)
    slow_V = 4.0 - 4.0 * np.cos(2.0 * math.pi * 0.05 * time_s)
    search = with_forms(told([record_of("beam", voltage_V=slow_V)], base=load_model("beam")))
    found = smallest_visible(search)["slew_limit"]
    assert found.value is None
    assert found.to_dict()["value"] is None
    (row,) = visible_rows({"slew_limit": found.to_dict()})
    assert row["size"] == NEVER


@pytest.mark.slow
def test_an_effect_that_was_found_is_sized_beside_the_others() -> None:
    base = load_model("beam")
    hidden = {"creep": {"gains": (0.06,), "time_constants_s": (1.5,)}}
    found = search_records(base, [record_of("beam", hidden, voltage_V=levels(40.0))])
    assert found.best.hypothesis.effects == ("creep",)
    size = smallest_visible(found)["creep"].value
    assert size is not None
    assert 0.0 < size < 0.06


def test_every_effect_of_the_catalogue_has_a_size_that_can_be_told() -> None:
    found = of_a_quiet_record()
    sought = {x.id for x in EFFECTS.values() if x.is_sought_in(piezo_bender=True)} - {"second_mode"}
    assert sought <= found.keys()
    for name, entry in found.items():
        written = json.loads(json.dumps(entry.to_dict(), allow_nan=False))
        assert written["unit"] == EFFECTS[name].parameters[written["parameter"].partition("[")[0]].unit
        assert written["shown"] == ("below" if name in ("slew_limit", "saturation") else "above")
    rows = visible_rows({name: x.to_dict() for name, x in found.items()})
    assert [x["title"] for x in rows] == [EFFECTS[name].title for name in found]
    assert next(x["size"] for x in rows if x["parameter"] == "frequency_ratio") != "1"
