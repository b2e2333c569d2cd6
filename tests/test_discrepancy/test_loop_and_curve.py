"""What is certain of an effect that has a part of another one, or of one beside which hardly any of the gap is its."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from reported_diagnosis import hypothesis, levels, record_of, told

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.findings import find
from bender_inference.candidates import candidate_forms
from bender_inference.records.observations import observe
from bender_plant.model import Model, load_model

BEAM = load_model("beam")
LOOP = "8 plays to the power 2"
SQUARE = {"electrostriction": {"coefficient_um_per_V2": 0.002}}
PLAYS = {"rate_independent_hysteresis": {"thresholds_V": (2.0, 6.0, 10.0), "weights_um_per_V": (0.05, 0.04, 0.03)}}


@pytest.mark.parametrize(("hidden", "is_certain"), [(SQUARE, False), ({**SQUARE, **PLAYS}, True)])
def test_a_loop_beside_a_curve_is_certain_where_the_loop_is_shown(
    hidden: dict[str, dict[str, Any]], is_certain: bool
) -> None:
    record = record_of("beam", hidden, voltage_V=levels(30.0))
    search = told([record], hypothesis(BEAM, [record], (LOOP, (0.0,) * 17)), base=BEAM)
    (found,) = search.grades.effects
    assert (found.grade == "certain") == is_certain
    assert (found.probability > 0.9) == is_certain


def test_what_a_loop_is_beside_is_one_curve_up_and_down() -> None:
    record = record_of("beam", PLAYS, voltage_V=levels(30.0))
    form = next(x for x in candidate_forms(BEAM, [observe(record)]) if x.name == LOOP)
    values = (*(0.05 / (1 + k) for k in range(len(form.free) - 1)), 0.003)
    alone, numbers = form.curve_alone(values)
    assert numbers == (0.003,)
    assert [x.name for x in alone.free] == ["reversible_quadratic_um_per_V2"]
    volts = np.concatenate([np.linspace(0.0, 30.0, 61), np.linspace(30.0, 0.0, 61)]).repeat(3)
    time_s = np.arange(volts.size, dtype=np.float64)

    def opening_um(model: Model) -> float:
        reading_um = Simulator(Drive.of_rows(time_s, volts, linear=False)).run(model).reading_um[2::3]
        return float(np.max(np.abs(reading_um[:61] - reading_um[61:][::-1])))

    assert opening_um(form.apply(BEAM, values)) > 10.0 * opening_um(alone.apply(BEAM, numbers))
    assert opening_um(alone.apply(BEAM, numbers)) == pytest.approx(opening_um(BEAM), abs=1e-6)


def test_nothing_is_certain_that_closes_next_to_nothing_of_the_gap() -> None:
    record = record_of("beam", PLAYS, voltage_V=levels(30.0))
    plays = tuple(0.01 for _ in range(10))
    found = hypothesis(BEAM, [record], ("10 plays", plays), ("electrostriction", (1e-6,)))
    search = told([record], found, base=BEAM)
    sure = tuple(replace(x, grade="certain") for x in search.grades.effects)
    loop, square = find(replace(search, grades=replace(search.grades, effects=sure))).search.grades.effects
    assert loop.grade == "certain"
    assert square.grade == "likely"
    assert square.doubt
