"""Another frequency and another damping of the model, beside an effect: named where they are evidence themselves."""

from typing import Any

import pytest
from reported_diagnosis import NOISE_um, hypothesis, record_of

from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.fitting.own_numbers import own_form, part_without_named
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search.archive import Archive
from bender_discrepancy.search.judgement.rules import Rules
from bender_discrepancy.search.moves import Catalogue, Kit
from bender_discrepancy.search.search import with_named_numbers
from bender_discrepancy.workflow import candidate_forms
from bender_plant.model import load_model

PAPER = load_model("paper")
DELAY = {"transport_delay": {"delay_s": 0.05}}
DAMPED = {"structural_damping": {"damping_ratio": 0.006}}
ELSEWHERE = {"tip_mass": {"frequency_ratio": 1.03}}


def free_beside_the_delay(effects: dict[str, dict[str, Any]], *, given: bool = True) -> tuple[Archive, Fitted, Fitted]:
    """The archive of a record, the delay with all numbers of the model free, and that with names."""
    record = record_of(effects=effects)
    problem = problem_of(PAPER, (observe(record),))
    archive = Archive(problem, NOISE_um)
    bare = archive.fit(Hypothesis())
    own = own_form(PAPER)
    assert bare is not None
    assert own is not None
    delay = hypothesis(PAPER, [record], ("transport_delay", (0.05,)))
    free = archive.fit(delay.freeing(own, tuple(x.starts[0] for x in own.free)))
    assert free is not None
    kit = Kit(None, tuple(candidate_forms(PAPER, problem.observations)), own)
    kit = kit if given else kit.without_changes_of_numbers()
    return archive, free, with_named_numbers(archive, Catalogue((kit,)), Rules(), free)


@pytest.mark.parametrize("hidden", [DAMPED, ELSEWHERE], ids=["damping", "frequency"])
def test_a_number_that_the_readings_show_is_an_effect(hidden: dict[str, dict[str, Any]]) -> None:
    archive, free, named = free_beside_the_delay({**DELAY, **hidden})
    (effect,) = hidden
    assert free.hypothesis.effects == ("transport_delay",)
    assert set(named.hypothesis.effects) == {"transport_delay", effect}
    assert archive.square(named) <= 1.01 * archive.square(free)


def test_a_number_that_is_as_the_model_has_it_stays_a_recalibration() -> None:
    _, free, named = free_beside_the_delay(DELAY)
    assert named is free


def test_numbers_of_structures_that_no_model_gave_have_no_names() -> None:
    _, free, named = free_beside_the_delay({**DELAY, **DAMPED}, given=False)
    assert named is free


def test_a_fit_with_the_number_free_does_not_lack_the_effect() -> None:
    archive, free, named = free_beside_the_delay({**DELAY, **DAMPED})
    lacking = list(archive.lacking("structural_damping"))
    assert free not in lacking
    assert named not in lacking
    assert any(not x.hypothesis.parts for x in lacking)


def test_numbers_without_a_name_stay_free() -> None:
    _, free, _ = free_beside_the_delay(DELAY)
    assert free.hypothesis.own is not None
    rest = part_without_named(free.hypothesis.own, {"tip_mass"})
    assert rest is not None
    assert [x.name for x in rest.form.free] == ["bending_modes.damping_ratio"]
    assert part_without_named(free.hypothesis.own, {"tip_mass", "structural_damping"}) is None
