"""Numbers through the emulated camera: what counts as right, and what becomes of a delay whose exposure is ignored."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bender_discrepancy.effects.effect import Sizes
from bender_discrepancy.effects.library import transport_delay
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis, Part
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.fitting.uncertainty import uncertainty
from bender_discrepancy.records.checks import read_model
from bender_discrepancy.records.observations import observe
from bender_loop.records.record import Record
from bender_studies.hidden_effects import camera_record as camera
from bender_studies.hidden_effects.through_camera import (
    Number,
    ThroughCamera,
    camera_bench,
    misses,
    totals,
)


def _judged(found: float, deviation: float, effect: str = "transport_delay") -> ThroughCamera:
    return ThroughCamera("case", effect, 0.12, 0.015, 3, Number("named", (effect,), found, deviation))


def test_a_number_counts_within_two_stated_deviations() -> None:
    assert _judged(0.1199, 1e-4).is_within
    assert not _judged(0.1189, 1e-4).is_within
    assert _judged(math.nan, math.nan).deviations == math.inf
    assert not _judged(0.12, 0.0).is_within
    assert not _judged(0.12, math.inf).is_within
    rows = totals([_judged(0.1199, 1e-4), _judged(0.1189, 1e-4)])
    assert rows[-1][:3] == ["all", "2", "1"]
    assert [x[0:2] for x in misses([_judged(0.1189, 1e-4)])] == [["case", "transport_delay"]]


@pytest.mark.parametrize("number", range(4))
def test_what_is_hidden_has_one_true_number(number: int) -> None:
    bench, _ = camera_bench(number, 1)
    (hidden,) = bench.case.effects
    assert bench.case.sensor == "camera"
    assert hidden.magnitude == pytest.approx(sum(x for _, x in hidden.parameters))
    assert camera.EXPOSURES_S[0] <= bench.exposure_s <= camera.EXPOSURES_S[1]


def _record(exposure_s: float, monkeypatch: pytest.MonkeyPatch) -> tuple[float, Record]:
    """A delay through the camera, with stamps that do not tremble."""
    monkeypatch.setattr(camera, "DURATION_S", 8.0)
    monkeypatch.setattr(camera, "STAMP_S", 1e-9)
    bench, rng = camera_bench(0, 1)
    return bench.case.effects[0].magnitude, camera.camera_record(bench.case, exposure_s, rng).record


def _delay_s(record: Record, near_s: float) -> tuple[float, float]:
    (form,) = transport_delay.EFFECT.forms(Sizes(50.0, 23.1, 8.0, 104.4))
    problem = problem_of(read_model("paper"), (observe(record),))
    fitted = fit(problem, Hypothesis((Part(form, (near_s,)),)))
    assert fitted is not None
    deviation = math.sqrt(uncertainty(problem, fitted).coordinates[0, 0]) * form.free[0].unit
    return fitted.hypothesis.values()[0], deviation


@pytest.mark.slow
def test_a_delay_is_right_where_the_exposure_is_known_and_wrong_where_it_is_ignored(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    truth_s, record = _record(0.015, monkeypatch)
    assert np.isfinite(record.displacement_um).mean() > 0.5
    found_s, deviation_s = _delay_s(record, truth_s)
    ignored_s, _ = _delay_s(replace(record, exposure_s=None), truth_s)
    assert abs(found_s - truth_s) <= 3.0 * deviation_s
    assert abs(ignored_s - truth_s) > 3.0 * deviation_s
    assert abs(found_s - truth_s) < abs(ignored_s - truth_s)


def test_a_tip_that_comes_to_rest_within_the_exposure_is_read_at_its_mean() -> None:
    decays = np.exp(-5.0 * (np.arange(camera.INSTANTS) + 0.5) / camera.INSTANTS)
    places_um = np.array([x + y * decays for x in (8.0, 16.0, 24.0) for y in (-8.0, 8.0)])
    found_um = camera.found_um(places_um, np.random.default_rng(4))
    apart_um = np.median(places_um, axis=1) - places_um.mean(axis=1)
    assert np.abs(apart_um).min() > 0.8
    # of the way from the mean to where it was for half of the time
    assert np.abs((found_um - places_um.mean(axis=1)) / apart_um).max() < 0.08


@pytest.mark.slow
def test_deviations_allow_for_stamps_that_tremble(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "DURATION_S", 16.0)
    monkeypatch.setattr(camera, "found_um", lambda places, rng: places.mean(axis=1) + rng.normal(0, 0.01, len(places)))
    bench, _ = camera_bench(0, 1)
    truth_s = bench.case.effects[0].magnitude
    told = []
    for seed in range(10):
        record = camera.camera_record(bench.case, 0.01, np.random.default_rng(seed)).record
        told.append(_delay_s(record, truth_s))
    off = np.array([(found - truth_s) / deviation for found, deviation in told])
    # with every row as sure as the others: 3.9
    assert 0.4 < float(np.sqrt(np.mean(off**2))) < 1.8
