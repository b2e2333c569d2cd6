"""Other forms of the same effects: which ones are worth trying, and which one stands in the end."""

import numpy as np
import pytest
from told_diagnosis import hypothesis, levels, record_of, told

from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search.evidence import EVIDENCE, is_finished
from bender_discrepancy.search.revise import in_their_best_forms
from bender_discrepancy.search.state import rms_um
from bender_discrepancy.workflow import candidate_forms
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")


def forms_of(record: Record) -> dict[str, Form]:
    return {x.name: x for x in candidate_forms(PAPER, [observe(record)])}


def test_a_form_contains_another_one_where_its_further_numbers_do_nothing():
    forms = forms_of(record_of())
    assert forms["lens of degree 4"].contains(forms["lens of degree 2"], PAPER)
    assert forms["sensor_lag, of two"].contains(forms["sensor_lag"], PAPER)
    assert not forms["lens of degree 2"].contains(forms["lens of degree 4"], PAPER)
    assert not forms["sensor_lag"].contains(forms["source_resistance"], PAPER)
    loops = [x for x in forms.values() if x.effect == "rate_independent_hysteresis"]
    plays = [x for x in loops if "plays" in x.name]
    assert len(plays) > 1
    assert not any(x.contains(y, PAPER) for x in plays for y in loops if x is not y)


@pytest.mark.parametrize("pair", [("source_resistance, of two", "source_resistance"), ("lens of degree 3",) * 2])
def test_what_a_form_contains_leaves_no_less(pair: tuple[str, str]):
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.2, "second_share": 0.05}})
    forms, bench = forms_of(record), problem_of(PAPER, (observe(record),))
    wide, narrow = forms[pair[0]], forms[pair[1]]
    assert wide.contains(narrow, PAPER)
    begun = [Hypothesis().plus(x, tuple(y.starts[0] for y in x.free)) for x in (narrow, wide)]
    left = [fit(bench, x, 40) for x in begun]
    assert left[0] is not None
    assert left[1] is not None
    assert left[1].training_square <= left[0].training_square * (1.0 + 1e-6)


PLAYS = [((1.0, 3.0, 6.0), (0.2, 0.12, 0.06)), ((2.0, 4.0), (0.3, 0.2))]


@pytest.mark.parametrize(("thresholds_V", "weights_um_per_V"), PLAYS)
def test_in_the_end_a_named_effect_has_the_form_that_leaves_least(
    thresholds_V: tuple[float, ...], weights_um_per_V: tuple[float, ...]
):
    """A loop that Bouc and Wen's form misses, beside a bump that no effect of the catalogue makes."""
    loop = {"form": "plays", "thresholds_V": thresholds_V, "weights_um_per_V": weights_um_per_V}
    seen = record_of(effects={"rate_independent_hysteresis": loop}, voltage_V=levels(60.0))
    bump_um = 0.2 * np.sin(seen.voltage_V / 2.0) * np.sin(0.9 * seen.time_s)
    record = Record(seen.time_s, seen.voltage_V, seen.displacement_um + bump_um)
    found = told([record], hypothesis(PAPER, [record], ("Bouc-Wen", (0.2, 0.15, 0.0)))).found
    assert not is_finished(found.best, found, EVIDENCE)
    better = in_their_best_forms(found, list(forms_of(record).values()))
    assert better.best.hypothesis.effects == ("rate_independent_hysteresis",)
    assert "plays" in better.best.hypothesis.parts[0].form.name
    assert rms_um(better.best, found.problem) < 0.7 * rms_um(found.best, found.problem)


def test_a_form_stays_where_noise_alone_is_left_or_nothing_is_named():
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.2}})
    forms = list(forms_of(record).values())
    right = told([record], hypothesis(PAPER, [record], ("source_resistance", (0.2,)))).found
    assert in_their_best_forms(right, forms) is right
    none = told([record]).found
    assert in_their_best_forms(none, forms) is none
