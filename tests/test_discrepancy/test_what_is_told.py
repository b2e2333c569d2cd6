"""What a report leaves out because it would tell nothing, and how numbers stand in its text."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reported_diagnosis import hypothesis, record_of, told

from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.localise import residual_ranges
from bender_discrepancy.conclusion.notes import warnings
from bender_discrepancy.report.visible_section import never_visible, visible_rows
from bender_effects.catalogue import EFFECTS
from bender_inference.experiment.design import Experiment
from bender_inference.records.observations import observe
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_report.wording import chance, percent, plain, shown_in, unit_text, with_units_kept

ROWS = 400
TIME_s = np.arange(ROWS) / 30.0


def axes_of(voltage_V: np.ndarray, residual_um: np.ndarray) -> set[str]:
    record = Record(TIME_s, voltage_V, residual_um)
    return {x.axis for x in residual_ranges(observe(record), residual_um, 0.0)}


def test_of_two_levels_none_is_a_place() -> None:
    levels = np.where(np.arange(ROWS) // 7 % 2, 0.0, 6.0)
    assert "voltage" not in axes_of(levels, np.sin(TIME_s * 3.0))
    assert "voltage" in axes_of(levels, np.where(levels > 4.0, np.sin(TIME_s * 3.0), 0.0))


def test_a_side_with_as_much_of_the_residual_as_of_the_rows_is_no_place() -> None:
    triangle = np.abs(np.arange(ROWS) % 100 - 50.0)
    everywhere = np.random.default_rng(3).standard_normal(ROWS)
    rising = np.diff(triangle, prepend=0.0) > 0.0
    assert not {"direction", "hold"} & axes_of(triangle, everywhere)
    assert "direction" in axes_of(triangle, np.where(rising, everywhere, 0.0))


def test_effects_that_no_size_would_show_are_listed_once() -> None:
    size = {"parameter": "delay_s", "value": 0.05, "unit": "s", "shown": "above"}
    found = {"transport_delay": size, "dead_zone": size | {"parameter": "threshold_V", "value": None, "unit": "V"}}
    assert [x["title"] for x in visible_rows(found)] == ["Transport delay"]
    assert never_visible(found) == ["dead zone"]


@pytest.mark.parametrize(("units", "text"), [(("V", "um"), "from 0.3 µm rms, 12 % at 5 V"), (("bar", "rpm"), "3 rpm")])
def test_a_number_stays_on_the_line_of_its_unit(units: tuple[str, str], text: str) -> None:
    with shown_in(*units):
        assert with_units_kept(text).split(" ") == [x for x in with_units_kept(text).split(" ") if x != "rpm"]
        assert " ".join(with_units_kept(text).split()) == text
        assert not any(x.startswith(("µm", "%", "V", "rpm")) for x in with_units_kept(text).split(" "))


def test_factors_of_a_unit_are_set_apart() -> None:
    with shown_in("cm/s", "N"):
        assert unit_text("V.s") == "(cm/s)·s"
        assert plain(unit_text("V.s")) == "(cm/s).s"


@pytest.mark.parametrize(("probability", "text"), [(0.743, "0.74"), (1.0, "1"), (0.9999, "0.99"), (1e-6, "0.01")])
def test_a_probability_looks_like_no_share(probability: float, text: str) -> None:
    assert chance(probability) == text


def test_one_of_several_profiles_has_no_number() -> None:
    drawn = Experiment("random levels 3", np.array([0.0, 1.0]), np.array([0.0, 9.0]), 1.0, 0.1)
    assert drawn.why.startswith("random levels (")
    assert "10 times the noise floor" in drawn.why


def test_notes_name_effects_by_their_titles() -> None:
    record = record_of(effects={"rate_independent_hysteresis": {"thresholds_V": (5.0,), "weights_um_per_V": (0.3,)}})
    best = hypothesis(load_model("paper"), [record], ("source_resistance", (2.0,)))
    findings = find(told([record], best, refit=False))
    effect = replace(findings.effects[0], numbers=tuple(replace(x, std=np.inf) for x in findings.effects[0].numbers))
    said = " ".join(warnings(replace(findings, effects=(effect,))))
    assert "source resistance: these records determine the response, not each of these numbers: time_constant_s" in said
    assert "commands like the recorded ones" in said
    assert "do not use" not in said
    assert not any(f"{x}:" in said for x in EFFECTS if "_" in x)


@pytest.mark.parametrize(("effect", "is_said"), [("transport_delay", True), ("source_resistance", False)])
def test_whose_delay_it_is_no_record_alone_can_say(effect: str, is_said: bool) -> None:
    record = record_of(effects={"transport_delay": {"delay_s": 0.1}})
    best = hypothesis(load_model("paper"), [record], (effect, (0.1,)))
    said = warnings(find(told([record], best, refit=False)))
    assert sum("delay of the sensor from one of the actuator" in x for x in said) == is_said
    assert all("[sensor] or [camera]" in x for x in said if "delay of the sensor" in x)


@given(st.floats(0.0001, 0.9999))
def test_a_part_is_never_told_as_nothing_or_as_all(share: float) -> None:
    told = float(percent(share).removesuffix(" %"))
    assert 0.0 < told < 100.0
    assert told == pytest.approx(100.0 * share, abs=0.5)


@pytest.mark.parametrize(
    ("share", "told"), [(0.0, "0 %"), (0.0004, "0.04 %"), (0.71, "71 %"), (0.9997, "99.97 %"), (1.0, "100 %")]
)
def test_the_last_per_cent_is_told_closely(share: float, told: str) -> None:
    assert percent(share) == told
