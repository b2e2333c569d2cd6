"""One offset of the reading for records between which the sensor was not zeroed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_compiled.simulation import Drive
from bender_discrepancy.conclusion.notes import warnings
from bender_discrepancy.workflow import diagnose
from bender_identify.first_model.structures import Structure
from bender_inference.fitting.fit_problem import calibrated, problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import fit
from bender_inference.fitting.uncertainty import uncertainty
from bender_inference.records.observations import Observations, observe
from bender_inference.settings import Settings
from bender_loop.records.record import Record


def observed(measured: np.ndarray, step: float = 0.0) -> Observations:
    rows = measured.size
    times = np.arange(rows, dtype=float)
    none = np.zeros(rows, dtype=bool)
    drive = Drive.of_rows(times, np.ones(rows))
    return Observations(drive, measured, ~none, none, none, half_step_um=step / 2.0, same_zero=True)


@given(st.integers(0, 2**32 - 1), st.floats(-5.0, 5.0), st.floats(-9.0, 9.0))
def test_line_of_records_with_one_zero_is_that_of_their_rows_together(seed: int, gain: float, offset: float) -> None:
    random = np.random.default_rng(seed)
    simulated = [random.normal(size=n) for n in (20, 31)]
    seen = [observed(gain * y + offset + random.normal(0.0, 0.3, y.size)) for y in simulated]
    line = calibrated(seen, simulated)
    expected = np.polyfit(np.concatenate(simulated), np.concatenate([x.measured_um for x in seen]), 1)
    assert [line.gain, *line.offsets_um] == pytest.approx([expected[0], expected[1], expected[1]], abs=1e-9)


def test_coarse_readings_with_one_zero_lie_within_their_steps() -> None:
    simulated = [np.linspace(0.0, 1.0, 40), np.linspace(0.0, 3.0, 50)]
    seen = [observed(0.5 * np.round((2.0 * y + 0.7) / 0.5), 0.5) for y in simulated]
    line = calibrated(seen, simulated)
    assert line.offsets_um[0] == line.offsets_um[1]
    for x, y in zip(seen, simulated, strict=True):
        assert np.all(np.abs(x.measured_um - line.gain * y - line.offsets_um[0]) <= 0.25 + 1e-6)


def two_records() -> list[Record]:
    random = np.random.default_rng(3)
    found = []
    for volts, zero in ((20.0, 0.0), (40.0, 0.3)):
        times = np.arange(0.0, 4.0, 0.02)
        command = volts * (0.5 + 0.5 * np.sign(np.sin(2.0 * np.pi * 0.5 * times)))
        # the reading of a row is that of the command before
        reading = 0.4 * np.concatenate([[0.0], command[:-1]]) + zero + random.normal(0.0, 0.01, times.size)
        found.append(Record(times, command, reading))
    return found


def test_zero_is_as_certain_in_all_records() -> None:
    seen = [replace(observe(x), same_zero=True) for x in two_records()]
    problem = problem_of(Structure().model((), 0.4), seen)
    fitted = fit(problem, Hypothesis())
    assert fitted is not None
    stated = uncertainty(problem, fitted).offsets_um
    assert stated[0] == stated[1] > 0.0


def test_offsets_of_their_own_are_told_unless_the_zero_is_known() -> None:
    base = Structure().model((), 0.4)
    own = diagnose(base, two_records(), Settings())
    assert any("--same-zero" in x for x in warnings(own.findings))
    assert max(own.findings.calibration.offsets_um) - min(own.findings.calibration.offsets_um) == pytest.approx(
        0.3, abs=0.01
    )
    told = diagnose(base, two_records(), Settings(same_zero=True))
    assert not any("--same-zero" in x for x in warnings(told.findings))
    assert len(set(told.findings.calibration.offsets_um)) == 1
