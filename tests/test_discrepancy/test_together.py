"""Several effects that are certain only once all of them are there, and when they are not sought."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from told_diagnosis import levels, record_of, told

from bender_discrepancy.effects.form import Free, simple
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.search import beam
from bender_discrepancy.search.evidence import EVIDENCE
from bender_discrepancy.search.state import Found, Ranked
from bender_discrepancy.search.together import several_are_missing, together
from bender_discrepancy.workflow import diagnose
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_proving import Bench, make_case

PAPER = load_model("paper")


def hidden_record(names: tuple[str, ...], seed: int, kind: Any = "several") -> Record:
    """The first record of a bench that hides effects, before a camera."""
    bench = Bench(make_case(kind, names, seed, sensor="camera"))
    return bench.record(bench.excitation(), bench.noise())


@pytest.mark.slow
def test_three_effects_of_which_no_two_are_certain_are_named() -> None:
    """Beside the lag, each of the others takes less than half of what both leave."""
    names = ("electrostriction", "ageing", "sensor_lag")
    found = diagnose(PAPER, [hidden_record(names, 7102)])
    assert found.verdict == "named"
    assert {x.id for x in found.added} == set(names)
    assert found.to_dict()["complete"]


@pytest.mark.slow
def test_a_mode_at_an_alias_beside_the_wrong_lag_is_put_where_it_belongs() -> None:
    names = ("creep", "tip_mass", "sensor_lag")
    found = diagnose(PAPER, [hidden_record(names, 7102)])
    assert {x.id for x in found.added} == set(names)


def leaving(found: Found, size: float, *effects: str) -> Fitted:
    """A hypothesis of these effects that leaves so many times the noise."""
    rng = np.random.default_rng(1)
    residuals = tuple(size * found.noise_um * rng.standard_normal(x.time_s.size) for x in found.problem.observations)
    rows = [(r, x) for r, x in zip(residuals, found.problem.observations, strict=True)]
    hypothesis = Hypothesis()
    for name in effects:
        hypothesis = hypothesis.plus(simple(name, Free("tau_s", 0.0, 2.0, False, (1.0,))), (1.0,))
    return replace(
        found.base,
        hypothesis=hypothesis,
        residuals=residuals,
        training_square=sum(float(np.sum(r[x.training] ** 2)) for r, x in rows),
        held_square=sum(float(np.sum(r[x.judging] ** 2)) for r, x in rows),
    )


@pytest.mark.parametrize(
    ("nearest", "stands", "missing"),
    [(4.0, True, True), (7.0, True, True), (7.2, True, False), (7.2, False, True), (9.9, True, False)],
)
def test_more_is_sought_beside_what_stands_where_what_was_tried_removes_most_of_the_rest(
    nearest: float, stands: bool, missing: bool
) -> None:
    """Of ten times the noise left beside a lag that closes a gap of a hundred times."""
    found = told([record_of()]).found
    found = replace(found, base=leaving(found, 100.0), best=leaving(found, 10.0, "lag"), ranking=())
    tried = Ranked(leaving(found, nearest, "lag", "play", "hum"), -1.0)
    assert several_are_missing(replace(found, last_ranking=(tried,)), EVIDENCE, stands=stands) is missing


def test_none_are_missing_where_nothing_that_was_tried_closes_most_of_the_gap() -> None:
    found = told([record_of()]).found
    found = replace(found, base=leaving(found, 100.0), best=leaving(found, 80.0, "lag"), ranking=())
    tried = Ranked(leaving(found, 40.0, "lag", "play"), -1.0)
    assert not several_are_missing(replace(found, last_ranking=(tried,)), EVIDENCE, stands=False)


@pytest.mark.slow
@pytest.mark.parametrize("effects", [{}, {"source_resistance": {"time_constant_s": 0.03}}])
def test_nothing_is_sought_where_noise_alone_is_left(
    effects: dict[str, dict[str, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(beam, "together", lambda *given: asked.append(given))
    diagnose(PAPER, [record_of(effects=effects, voltage_V=levels(4.0))])
    assert asked == []


@pytest.mark.slow
def test_nothing_is_sought_where_no_effect_closes_most_of_the_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    def counted(*given: Any) -> Any:
        asked.append(given)
        return together(*given)

    monkeypatch.setattr(beam, "together", counted)
    whole = hidden_record(("metastable_clamp",), 5, "outside")
    early = slice(0, 900)
    found = diagnose(PAPER, [Record(whole.time_s[early], whole.voltage_V[early], whole.displacement_um[early])])
    assert found.verdict == "unexplained"
    assert asked == []
