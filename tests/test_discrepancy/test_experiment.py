"""The next experiment: what it may ask of the bench, and that a rival cannot follow the others under it."""

import argparse
from pathlib import Path

import numpy as np
import pytest
from reported_diagnosis import FRAME_S, NOISE_um, hypothesis, levels, record_of

from bender_discrepancy.command import run
from bender_discrepancy.experiment import design as experiment
from bender_discrepancy.experiment.design import SWEPT, SWEPT_FARTHER, Experiment, design
from bender_discrepancy.experiment.profiles import Limits, Sine
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_loop.errors import InputError
from bender_plant.model import Model, load_model

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


@pytest.mark.slow
def test_what_is_slow_is_given_its_time_after_a_short_record_as_well() -> None:
    slow = _after(1.0, ("1 relaxation", (0.1, 12.0)), ("thermal_drift", (2.0, 12.0)))
    assert slow.time_s[-1] > 20.0


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
