"""Benches that are confused without their instruments: what counts, what is right, and that the channels matter."""

from pathlib import Path

import pytest

from bender_studies.hidden_effects.witnessed import WitnessedAnswer, WitnessedJudged, totals, witnessed

OPEN = WitnessedAnswer("ambiguous", ("sensor_lag",), ("source_resistance",))


def _judged(answer: WitnessedAnswer) -> WitnessedJudged:
    return WitnessedJudged(1, 2, "source_resistance", 0.3, OPEN, answer)


@pytest.mark.parametrize(
    ("answer", "right", "false"),
    [
        (WitnessedAnswer("named", ("source_resistance",)), True, False),
        (WitnessedAnswer("named", ("source_resistance", "creep")), False, True),
        (WitnessedAnswer("named", ("sensor_lag",)), False, True),
        (OPEN, False, False),
        (WitnessedAnswer("unexplained"), False, False),
        (WitnessedAnswer("error", error="no"), False, False),
    ],
)
def test_right_is_the_name_alone(answer: WitnessedAnswer, right: bool, false: bool) -> None:
    found = _judged(answer)
    assert (found.is_right, found.is_false) == (right, false)


def test_totals_count_by_what_is_hidden_with_an_interval() -> None:
    rows = totals([_judged(WitnessedAnswer("named", ("source_resistance",))), _judged(OPEN)])
    assert rows[0][:3] == ["source_resistance", "2", "1"]
    assert rows[-1][0] == "all"
    assert rows[-1][3].endswith("%")
    assert totals([])[-1][:3] == ["all", "0", "0"]


@pytest.mark.slow
def test_benches_that_are_confused_are_told_apart_by_their_channels(tmp_path: Path) -> None:
    found = list(witnessed(range(2), 1, tmp_path, 1))
    assert len(found) == 2
    for x in found:
        assert not x.without.names(x.effect), x.without.in_words
        assert x.is_right, x.answer.in_words
        assert any("read-back voltage shows" in sentence for sentence in x.answer.witnesses)
        assert not x.without.witnesses
