"""The next experiment: what it may ask of the bench, and that a rival cannot follow the others under it."""

import argparse
import json
import math
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported_diagnosis import FRAME_S, NOISE_um, hypothesis, levels, record_of, told

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.command import run
from bender_discrepancy.conclusion.smallest_visible import Smallest, smallest_visible
from bender_discrepancy.record_search import search_records
from bender_discrepancy.report.visible_section import never_visible, visible_rows
from bender_effects.catalogue import EFFECTS
from bender_inference.candidates import candidate_forms
from bender_inference.experiment import design as experiment
from bender_inference.experiment.design import SWEPT, SWEPT_FARTHER, Experiment, design
from bender_inference.experiment.profiles import Limits, Sine
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.search.result import SearchResult
from bender_loop.errors import InputError
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model, model_from_table

SINE = Sine(2.0, 20.0, 15.0)


def designed(limits: Limits, sine: Sine | None) -> Experiment:
    base, record = load_model("paper"), record_of()
    rivals = [
        hypothesis(base, [record], ("source_resistance", (0.05,))),
        hypothesis(base, [record], ("transport_delay", (0.05,))),
    ]
    found = design(base, rivals, NOISE_um, FRAME_S, np.random.default_rng(1), limits, sine)
    assert found is not None
    return found


@pytest.mark.parametrize("limits", [Limits(), Limits(high_V=12.0), Limits(5.0, 30.0)])
def test_it_stays_within_what_the_bench_allows(limits: Limits):
    found = designed(limits, None)
    assert found.voltage_V.min() >= limits.low_V
    assert found.voltage_V.max() <= limits.high_V
    assert found.voltage_V[0] == found.voltage_V[-1] == limits.low_V


def test_a_slew_rate_is_kept_and_the_profile_comes_down_to_nought():
    found = designed(Limits(slew_V_per_s=40.0), None)
    assert np.abs(np.diff(found.voltage_V)).max() <= 40.0 * FRAME_S + 1e-9
    assert found.voltage_V[-1] == pytest.approx(0.0, abs=1e-9)


def test_after_one_sine_its_own_voltages_go_first():
    found = designed(Limits(), SINE)
    assert found.pattern == SWEPT
    assert found.voltage_V.max() <= 35.0
    assert found.distance_um > 10.0 * NOISE_um


def test_after_a_sine_too_small_to_tell_the_whole_range_is_swept():
    found = designed(Limits(high_V=40.0), Sine(2.0, 0.4, 0.4))
    assert found.pattern == SWEPT_FARTHER
    assert 30.0 < found.voltage_V.max() <= 40.0


def test_of_a_device_whose_simulation_takes_long_not_all_profiles_are_tried(monkeypatch: pytest.MonkeyPatch):
    played: list[int] = []
    of_one = experiment._played

    def counted(base: Model, profile: np.ndarray, step_s: float, rivals: list[Hypothesis]) -> object:
        played.append(profile.size)
        return of_one(base, profile, step_s, rivals)

    monkeypatch.setattr(experiment, "_played", counted)
    found = []
    for work in (experiment.MOST_WORK_SUBSTEPS, 1.0):
        monkeypatch.setattr(experiment, "MOST_WORK_SUBSTEPS", work)
        played.clear()
        found.append((_after(1.0, ("source_resistance", (0.002,)), ("transport_delay", (0.002,))), len(played)))
    (whole, all_of_them), (some, few) = found
    assert few == 1 < all_of_them
    assert some.distance_um > 0.0
    assert whole.contrast >= some.contrast


def test_no_voltage_is_said_to_tell_only_after_all_were_tried():
    """Creep and a drift: the profile that sets them furthest apart is not the one that does beside what they leave."""
    base, record = load_model("beam"), record_of("beam", {}, levels(20.0))
    parts = ("1 relaxation", (0.1, 12.0)), ("thermal_drift", (2.0, 12.0))
    rivals = [hypothesis(base, [record], x) for x in parts]
    rng = np.random.default_rng(1)
    few, all_ = (design(base, rivals, NOISE_um, FRAME_S, rng, unexplained=x) for x in (0.3, 3.0))
    assert few is not None
    assert few.tells_apart
    assert few.distance_um >= few.unexplained_um > 0.0
    assert all_ is not None
    assert not all_.tells_apart
    assert "no command that was tried" in all_.why


def _after(record_s: float, *parts: tuple[str, tuple[float, ...]], step_s: float = 1.0 / 2000.0) -> Experiment:
    base = load_model("beam")
    record = record_of(base, {}, levels(20.0))
    rivals = [hypothesis(base, [record], x) for x in parts]
    found = design(base, rivals, NOISE_um, step_s, np.random.default_rng(1), record_s=record_s)
    assert found is not None
    return found


def test_after_a_short_record_a_short_one_is_asked_for_where_it_separates_the_rivals() -> None:
    short = _after(1.0, ("source_resistance", (0.002,)), ("transport_delay", (0.002,)))
    assert short.time_s[-1] <= 1.1
    assert short.contrast >= 1.0
    assert np.allclose(np.diff(short.time_s), 1.0 / 2000.0)


def test_after_hours_with_rows_far_apart_a_long_one_is_asked_for() -> None:
    """An oven: steps of half a second between rows of five would say nothing."""
    slow = _after(3600.0, ("1 relaxation", (0.1, 600.0)), ("thermal_drift", (2.0, 600.0)), step_s=5.0)
    assert 1000.0 < slow.time_s[-1] < 4500.0
    assert np.allclose(np.diff(slow.time_s), 5.0)


@pytest.mark.parametrize("volts", [0.0, -3.0, 2000.0, float("nan")])
def test_an_impossible_limit_is_refused(volts: float, tmp_path: Path):
    given = argparse.Namespace(record=[Path("none.csv")], input_hold="hold", untimed=False, highest_voltage=volts)
    given.out, given.resume, given.output = tmp_path / "out", None, []
    with pytest.raises(InputError, match="--highest-voltage"):
        run(given)
    assert not given.out.exists()


QUIET = ("no_gap", "recalibrated")


def with_forms(search: SearchResult) -> SearchResult:
    return replace(search, candidates=candidate_forms(search.base, search.problem.observations))


@cache
def of_a_quiet_record() -> dict[str, Smallest]:
    return smallest_visible(with_forms(told([record_of("beam", voltage_V=levels(40.0))], base=load_model("beam"))))


def settings_of(entry: Smallest, factor: float) -> dict[str, Any]:
    """The block's parameters, so many times as far from no effect as what just shows."""
    assert entry.value is not None
    neutral = {"damping_ratio": 0.02, "frequency_ratio": 1.0}.get(entry.parameter, 0.0)
    own = entry.value / factor if entry.below else neutral + factor * (entry.value - neutral)
    found: dict[str, Any] = {}
    for name, value in [(entry.parameter, own), *((x, y) for x, y, _ in entry.beside)]:
        field, bracket, _ = name.partition("[")
        found[field] = (value,) if bracket else value
    return found


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["dead_zone", "creep", "thermal_drift", "structural_damping", "saturation"])
def test_what_is_larger_shows_and_what_is_far_smaller_does_not(effect: str) -> None:
    entry, base, volts = of_a_quiet_record()[effect], load_model("beam"), levels(40.0)

    def diagnosed(factor: float) -> SearchResult:
        record = record_of("beam", {effect: settings_of(entry, factor)}, voltage_V=volts, seed=11)
        return search_records(base, [record])

    assert diagnosed(0.25).verdict.word in QUIET
    assert effect in diagnosed(2.5).best.hypothesis.effects


def record_with_noise(factor: float) -> Record:
    clean = record_of("beam", voltage_V=levels(40.0))
    volts, time_s = levels(40.0), FRAME_S * np.arange(levels(40.0).size, dtype=np.float64)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(load_model("beam")).reading_um
    return replace(clean, displacement_um=reading_um + factor * (clean.displacement_um - reading_um))


def test_a_delay_shows_beside_one_that_the_model_has_as_early_as_the_first_one() -> None:
    blocks = [
        {"id": "linear_transduction", "sensitivity_um_per_V": 0.5},
        {"id": "plant_lag", "time_constant_s": 0.1},
        {"id": "calibration", "gain": 1.0},
    ]
    lag = model_from_table({"format": 1, "name": "lag", "block": blocks})
    volts = levels(40.0)
    time_s, noise = FRAME_S * np.arange(float(volts.size)), np.random.default_rng(4).standard_normal(volts.size)
    sizes = []
    for model in (lag, lag.with_block("transport_delay", delay_s=2.0 * FRAME_S)):
        readings_um = Simulator(Drive.of_rows(time_s, volts)).run(model).reading_um + NOISE_um * noise
        sizes.append(smallest_visible(with_forms(told([Record(time_s, volts, readings_um)], base=model))))
    first, further = (x["transport_delay"] for x in sizes)
    assert (further.parameter, further.unit, first.further, further.further) == ("delay_s", "s", False, True)
    assert further.value == pytest.approx(first.value, rel=0.2)
    assert visible_rows({"transport_delay": further.to_dict()})[0]["size"].endswith("more than the model has")


@pytest.mark.slow
def test_twice_the_noise_hides_twice_as_much() -> None:
    def sizes(factor: float) -> dict[str, Smallest]:
        search = with_forms(told([record_with_noise(factor)], base=load_model("beam")))
        return smallest_visible(
            replace(search, found=replace(search.found, archive=replace(search.archive, noise_um=factor * NOISE_um)))
        )

    once, twice = sizes(1.0), sizes(2.0)
    for effect in ("electrostriction", "thermal_drift", "creep", "lens_distortion", "charge_leakage", "dead_zone"):
        small, large = once[effect].value, twice[effect].value
        assert small is not None
        assert large is not None
        assert large / small == pytest.approx(2.0, rel=0.15), effect
    assert twice["offset"].value == pytest.approx(2.0 * (once["offset"].value or 0.0))


def test_what_no_command_would_show_is_said_to_be_invisible() -> None:
    time_s = FRAME_S * np.arange(900, dtype=np.float64)
    slow_V = 4.0 - 4.0 * np.cos(2.0 * math.pi * 0.05 * time_s)
    search = with_forms(told([record_of("beam", voltage_V=slow_V)], base=load_model("beam")))
    found = smallest_visible(search)["slew_limit"]
    assert found.value is None
    assert found.to_dict()["value"] is None
    assert visible_rows({"slew_limit": found.to_dict()}) == []
    assert len(never_visible({"slew_limit": found.to_dict()})) == 1


@pytest.mark.parametrize("damping_ratio", [0.62, 0.95])
def test_a_damping_beyond_all_that_is_sought_shows_at_no_size(damping_ratio: float) -> None:
    """All that is sought is below it: the largest distance from it is negative, and has no logarithm."""
    own = next(x.parameters for x in load_model("beam").blocks if x.id == "bending_modes")
    damped = load_model("beam").with_block("bending_modes", **(asdict(own) | {"damping_ratio": damping_ratio}))
    search = with_forms(told([record_of(damped, voltage_V=levels(8.0))], base=damped))
    forms = tuple(x for x in search.candidates if x.effect == "structural_damping")
    assert forms[0].free[0].high < damping_ratio
    assert smallest_visible(replace(search, candidates=forms))["structural_damping"].value is None


def test_every_effect_of_the_catalogue_has_a_size_that_can_be_told() -> None:
    found = of_a_quiet_record()
    sought = {x.id for x in EFFECTS.values() if x.is_sought_in(piezo_bender=True)} - {"second_mode"}
    assert sought <= found.keys()
    for name, entry in found.items():
        written = json.loads(json.dumps(entry.to_dict(), allow_nan=False))
        assert written["unit"] == EFFECTS[name].parameters[written["parameter"].partition("[")[0]].unit
        assert written["shown"] == ("below" if name in ("slew_limit", "saturation") else "above")
    rows = visible_rows({name: x.to_dict() for name, x in found.items()})
    assert [x["title"] for x in rows] == [EFFECTS[name].title for name, x in found.items() if x.value is not None]
    assert next(x["size"] for x in rows if x["parameter"] == "frequency_ratio") != "1"
