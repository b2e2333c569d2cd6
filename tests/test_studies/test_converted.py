"""The same records in other units and at other scales: what counts as the same, what the files hold, one for real."""

import math
from pathlib import Path

import numpy as np
import pytest

from bender_loop.records.record import read_record
from bender_proving.systems.suspected import suspected_case
from bender_studies.hidden_effects import converted as judge
from bender_studies.hidden_effects.converted import NEUTRAL, PER_UNIT, SCALES, Converted, Said, converted, totals

PLAIN = Said("named", ("creep",), {"creep.gain": 0.02, "after.rms": 0.031})


def _of(after: Said, kind: str = "units") -> Converted:
    return Converted(0, kind, "ms, mV, nm", PLAIN, after)


def test_in_other_units_verdict_names_and_every_number_have_to_stay() -> None:
    near = Said("named", ("creep",), {"creep.gain": 0.02 * (1.0 + 5e-7), "after.rms": 0.031})
    off = Said("named", ("creep",), {"creep.gain": 0.02 * (1.0 + 2e-6), "after.rms": 0.031})
    assert _of(PLAIN).difference == 0.0
    assert _of(near).is_same
    assert _of(near).difference == pytest.approx(5e-7, rel=1e-3)
    assert not _of(off).is_same
    assert not _of(Said("named", ("creep",), {"creep.gain": 0.02})).is_same
    assert _of(Said("named", ("creep",), {})).difference == math.inf
    assert not _of(Said("ambiguous", ("creep",), PLAIN.numbers)).is_same
    assert not Converted(0, "units", "", Said("error", error="why"), Said("error", error="why")).is_same


def test_at_another_scale_verdict_and_names_have_to_stay() -> None:
    assert _of(Said("named", ("creep",), {"creep.gain": 4.0}), "scale").is_same
    assert not _of(Said("named", ("ageing",), PLAIN.numbers), "scale").is_same
    assert totals([_of(PLAIN), _of(Said("no_gap"), "scale")]) == [
        ["units", "1", "1", "0.0e+00"],
        ["scale", "1", "0", ""],
    ]


@pytest.mark.parametrize("number", range(4))
def test_a_record_in_other_units_is_read_as_the_same(tmp_path: Path, number: int) -> None:
    case = suspected_case(1, 1)
    units = tuple(list(x)[number % len(x)] for x in PER_UNIT)
    record = read_record(judge._written(case, tmp_path, units))
    for own, read in (
        (case.time_s, record.time_s), (case.voltage_V, record.voltage_V), (case.reading_um, record.displacement_um)
    ):  # fmt: skip
        assert np.max(np.abs(read - own)) <= 1e-12 * np.max(np.abs(own))


@pytest.mark.parametrize("scale", SCALES)
def test_a_scaled_record_is_kept_in_numbers_that_people_read(tmp_path: Path, scale: tuple[float, float]) -> None:
    path = judge._written(suspected_case(1, 1), tmp_path, NEUTRAL, scale)
    record = read_record(path, judge._columns(path))
    assert record.quantities[:2] != NEUTRAL[1:] or scale == (1.0, 1e6)
    assert 1.0 <= np.ptp(record.voltage_V) < 1000.0
    assert 1.0 <= np.ptp(record.displacement_um) < 1000.0


@pytest.mark.slow
def test_a_diagnosis_in_other_units_says_the_same(tmp_path: Path) -> None:
    (found,) = converted([3], 1, tmp_path, 1)
    assert found.kind == "units"
    assert found.before.verdict != "error"
    assert found.is_same, (found.before, found.after)
