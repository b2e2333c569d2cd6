"""The catalogue of cases and what it refuses."""

from few import few
import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from bender_proving import cases, INSIDE, NOISE_UM, OUTSIDE, Bench, Case, DrawError, Hidden, make_case, strength
from bender_proving.cases import selections
from bender_proving.cases.case import Given, Kind, identified
from bender_proving.chain import readings_um
from bender_proving.cases.effects import common_sensors, effect
from bender_proving.cases.hidden import Sensor
from bender_proving.cases.rivals import mimicked_um
from bender_proving.cases.selections import SELECTIONS
from bender_proving.cases.weak import TRUTHS


@pytest.mark.slow
@pytest.mark.parametrize("name", few(["sensor_lag", "source_resistance", "rate_independent_hysteresis"], 0))
def test_a_weak_record_hides_its_effect_from_its_rivals(name: str):
    case = make_case("weak", (name,), 0)
    weak = case.weak
    assert weak is not None
    assert name not in weak.rivals
    assert strength(case) >= 3.0
    if weak.pattern == "step":
        plan = Bench(case).excitation()
        left_um = mimicked_um(weak.rivals[0], readings_um(plan.commands, case.effects), plan)
        assert len(plan.time_s) * (left_um / NOISE_UM["camera"]) ** 2 <= 6.0
        assert len(np.unique(plan.voltage_V)) == 2
    else:
        assert set(weak.rivals) <= set(TRUTHS)
        assert np.ptp(Bench(case).excitation().voltage_V) == pytest.approx(2 * weak.volts, rel=0.02)


def test_the_catalogue_spans_what_it_should():
    singles = {(case.effect_ids[0], case.sensor) for case in asked("singles")}
    assert singles == {(name, sensor) for name, entry in INSIDE.items() for sensor in entry.ranges}
    assert {case.effect_ids[0] for case in asked("outside")} == set(OUTSIDE)
    usual = {"singles", "pairs", "nothing", "calibrations", "outside", "weak"}
    assert set(SELECTIONS) == usual | {
        "triples", "quadruples", "quintuples", "faint", "moved", "starts", "begun", "loops", "approximate", "lagging"
    }  # fmt: skip
    sensors = [case.sensor for case in cases("nothing", range(4))]
    assert sensors == ["camera", "vibrometer"] * 2
    with pytest.raises(ValueError, match="selection"):
        next(cases("everything", (0,)))


def asked(selection: str, seeds: Iterable[int] = (0,)) -> list[Case]:
    """The cases of a selection without drawing them: what `make_case` would be asked for."""

    def ask(kind: Kind, names: tuple[str, ...], seed: int, sensor: Sensor, **_: object) -> Case:
        return Case("", kind, tuple(Hidden(name, "", 0.0, ()) for name in names), seed, sensor)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(selections, "make_case", ask)
        return list(cases(selection, seeds))


def test_pairs_take_turns_over_all_stages():
    drawn = asked("pairs", range(6))
    assert len({frozenset(case.effect_ids) for case in drawn}) == 60
    for case in drawn:
        assert len({effect(name).stage for name in case.effect_ids}) == 2
        assert case.sensor in common_sensors(case.effect_ids)


def test_a_pair_that_never_shows_is_passed_over():
    def never(*arguments):
        raise DrawError("never")

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(selections, "make_case", never)
        with pytest.raises(DrawError, match="use another seed"):
            next(selections.pairs((0,)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("triple", ("creep",)), "kind"),
        (("single", ()), "effect_ids"),
        (("single", ("creep", "ageing")), "effect_ids"),
        (("single", ("stick_slip",)), "among"),
        (("pair", ("creep", "saturation")), "different stages"),
        (("pair", ("creep", "creep")), "different names"),
        (("calibration", ("creep",)), "gain_error"),
        (("weak", ("stiffening",)), "weak case"),
        (("single", ("creep",), 0, "vibrometer"), "sensor"),
        (("single", ("creep",), -1), "seed"),
    ],
)
def test_wrong_arguments_are_named(arguments: tuple, message: str):
    with pytest.raises(ValueError, match=message):
        make_case(*arguments)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"outlying": 0.5}, "outlying"),
        ({"lost": math.nan}, "lost"),
        ({"gain": 0.0}, "gain"),
        ({"offset_um": math.inf}, "offset_um"),
    ],
)
def test_wrong_cases_are_named(change: dict, field: str):
    with pytest.raises(ValueError, match=field):
        replace(Case("", "nothing", (), 0, "camera"), **change)


@pytest.mark.slow
def test_a_model_that_is_given_may_have_another_lag():
    found = list(cases("lagging", (3,)))
    assert {x.effect_ids[0] for x in found} == set(INSIDE) - {
        "tip_mass", "structural_damping", "sensor_lag", "source_resistance"
    }  # fmt: skip
    for case in found:
        assert 1.5 <= max(case.given.lag, 1.0 / case.given.lag) <= 3.0
        # what the sensor lags by is known: it is in the readings and in no list of hidden effects
        plain = make_case("single", case.effect_ids, 3, case.sensor)
        assert case.effects == plain.effects
        plan = Bench(case).excitation()
        assert not np.allclose(Bench(case).clean(plan), Bench(plain).clean(plan), atol=0.01)
    with pytest.raises(ValueError, match=r"given\.lag_s"):
        Given(lag_s=-1.0)


@pytest.mark.slow
def test_a_model_that_is_given_may_be_a_little_wrong():
    found = list(cases("approximate", (3,)))
    assert {x.effect_ids[0] for x in found} == set(INSIDE) - {"tip_mass", "structural_damping"}
    assert len({x.given for x in found}) == len(found)
    for case in found:
        assert abs(case.given.frequency - 1.0) <= 0.03
        assert abs(np.log(case.given.damping)) <= np.log(1.5)
        assert abs(case.given.gain - 1.0) <= 0.1
        # the bench is the same, whatever the model says
        plain = replace(case, given=Given())
        assert identified(plain).id == make_case("single", case.effect_ids, 3, case.sensor).id != case.id
    with pytest.raises(ValueError, match=r"given\.gain"):
        Given(gain=0.0)
