"""A plainer rival is held to the named effects in a form with as few numbers as it has."""

import numpy as np
from told_diagnosis import hypothesis, levels, record_of

from bender_discrepancy.fitting.criterion import cost, yardstick
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import fit, judge
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search.evidence import is_plainer
from bender_discrepancy.search.revise import with_plainer_forms
from bender_discrepancy.search.state import Found, Ranked, noise_of
from bender_discrepancy.workflow import candidate_forms
from bender_plant.model import load_model

BEAM = load_model("beam")


def found_with(*rivals: str) -> tuple[Found, list[str]]:
    """A source of two lags, found in that form, with sensors of lags in its place."""
    lags = {"time_constant_s": 0.08, "second_share": 0.008}
    record = record_of("beam", effects={"source_resistance": lags}, voltage_V=levels(60.0))
    problem = problem_of(BEAM, (observe(record),))
    forms = candidate_forms(BEAM, problem.observations)
    values = {"source_resistance, of two": (0.08, 0.008), "sensor_lag, of two": (0.08, 0.008), "sensor_lag": (0.09,)}
    fits = {
        name: fit(problem, hypothesis(BEAM, [record], (name, values[name])))
        for name in ("source_resistance, of two", *rivals)
    }
    fitted = [x for x in fits.values() if x is not None]
    base, best = judge(problem, Hypothesis()), fitted[0]
    assert base is not None
    by = yardstick(problem, best, 1)
    ranked = tuple(Ranked(x, cost(x, by) - cost(base, by)) for x in fitted)
    found = Found(problem, base, best, noise_of(best, problem), by, ranked, ranked, (base, best))
    after = with_plainer_forms(found, forms)
    names = [x.fitted.hypothesis.parts[0].form.name for x in after.last_ranking]
    return after, names


def test_beside_a_plainer_rival_the_named_effect_is_ranked_in_its_plainer_form() -> None:
    found, names = found_with("sensor_lag")
    sensor = next(x.fitted for x in found.last_ranking if x.fitted.hypothesis.effects == ("sensor_lag",))
    assert is_plainer(sensor, found.best, found.base)
    assert sorted(names) == ["sensor_lag", "source_resistance", "source_resistance, of two"]
    plain = next(x.fitted for x in found.last_ranking if x.fitted.hypothesis.parts[0].form.name == "source_resistance")
    assert [x.difference for x in found.last_ranking] == sorted(x.difference for x in found.last_ranking)
    assert plain.hypothesis.free_count == 1
    assert np.isfinite(plain.training_square)
    assert plain.training_square >= found.best.training_square


def test_without_one_nothing_more_is_fitted() -> None:
    _, names = found_with("sensor_lag, of two")
    assert sorted(names) == ["sensor_lag, of two", "source_resistance, of two"]
