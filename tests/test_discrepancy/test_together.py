"""Several effects that are certain only once all of them are there, and when they are not sought."""

from typing import Any

import pytest
from told_diagnosis import levels, record_of

from bender_discrepancy.search import beam
from bender_discrepancy.search.together import together
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


@pytest.mark.parametrize("effects", [{}, {"source_resistance": {"time_constant_s": 0.03}}])
def test_nothing_is_sought_where_noise_alone_is_left(
    effects: dict[str, dict[str, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(beam, "together", lambda *given: asked.append(given))
    diagnose(PAPER, [record_of(effects=effects, voltage_V=levels(4.0))])
    assert asked == []


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
