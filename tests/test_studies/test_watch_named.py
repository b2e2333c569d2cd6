"""A lag on either side of a linear device is one answer, where the diagnosis says so."""

from typing import Any

import pytest

from bender_studies.watching.trial import Trial, other_sides


def entry(name: str, rival_of: str | None = None) -> dict[str, Any]:
    return {"id": name} | ({} if rival_of is None else {"rival_of": rival_of})


@pytest.mark.parametrize(
    ("effects", "found"),
    [
        ([], ()),
        ([entry("source_resistance")], ()),
        ([entry("source_resistance"), entry("sensor_lag")], ()),
        ([entry("source_resistance"), entry("sensor_lag", "source_resistance")], ("sensor_lag",)),
        ([entry("source_resistance"), entry("transport_delay", "source_resistance")], ()),
        ([entry("creep"), entry("source_resistance"), entry("sensor_lag", "source_resistance")], ()),
        ([entry("creep"), entry("an equation", "creep")], ()),
    ],
)
def test_the_other_side_is_what_the_diagnosis_cannot_tell_from_the_first(
    effects: list[dict[str, Any]], found: tuple[str, ...]
) -> None:
    assert other_sides(effects) == found


@pytest.mark.parametrize(
    ("named", "either", "is_named", "is_either"),
    [
        (("sensor_lag",), (), True, True),
        (("source_resistance", "sensor_lag"), ("sensor_lag",), False, True),
        (("source_resistance", "sensor_lag"), (), False, False),
        (("source_resistance",), (), False, False),
        ((), (), False, False),
        (None, (), False, False),
    ],
)
def test_a_lag_is_named_or_one_of_two(
    named: tuple[str, ...] | None, either: tuple[str, ...], *, is_named: bool, is_either: bool
) -> None:
    trial = Trial("sensor_lag", 3.0, "step", 1, 1, early=False, suspected=(), named=named, either=either)
    assert (trial.is_named, trial.is_either) == (is_named, is_either)
