import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.guard.rules import Situation, judge
from bender_hil.guard.settings import GuardOrders, GuardSettings
from bender_hil.guard.slew import SlewLimit
from bender_hil.supply.select import SupplySettings

LIMITS = GuardSettings()
WELL = Situation(now_s=10.0, beat_s=9.99, frame_s=9.98, tip_um=12.0, lowest_V=20.0, highest_V=22.0, measured_V=21.0)


def test_all_is_well():
    assert judge(LIMITS, WELL) is None
    assert judge(LIMITS, Situation()) is None


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"beat_s": 9.89}, "heartbeat"),
        ({"frame_s": 9.88}, "frame_age"),
        ({"lost": 3}, "lost_tip"),
        ({"tip_um": 45.1}, "travel"),
        ({"tip_um": -10.1}, "travel"),
        ({"measured_V": 18.9}, "band"),
        ({"measured_V": 23.1}, "band"),
        ({"high_for_s": 0.3, "measured_A": 0.02}, "current"),
        ({"measured_A": -math.inf}, "reading"),
        ({"measured_A": math.nan}, "reading"),
        ({"measured_A": -1.1}, "reading"),
        ({"measured_V": math.nan}, "reading"),
        ({"measured_V": 1e300}, "reading"),
    ],
)
def test_each_rule_ends_the_run(change: dict[str, float], code: str):
    trip = judge(LIMITS, replace(WELL, **change))
    assert trip is not None
    assert trip.code == code


@pytest.mark.parametrize(
    "change",
    [{"beat_s": 9.91}, {"frame_s": 9.90}, {"lost": 2, "tip_um": None}, {"tip_um": 44.9}, {"measured_V": 19.1},
     {"high_for_s": 0.2, "measured_A": 0.02}, {"measured_A": 0.99}],
)  # fmt: skip
def test_within_its_bound_nothing_ends(change: dict[str, float]):
    assert judge(LIMITS, replace(WELL, **change)) is None


@given(st.lists(st.tuples(st.floats(0.0, 0.2), st.floats(0.0, 50.0)), min_size=1, max_size=60))
def test_the_output_changes_no_faster_than_slew_plus_burst(commands: list[tuple[float, float]]):
    slew, burst = 250.0, 0.05
    limit = SlewLimit(slew, burst, 0.0)
    now, level = 0.0, 0.0
    history = [(0.0, 0.0)]
    for wait, wanted in commands:
        now += wait
        allowed = limit.allowed(level, wanted, now)
        assert min(level, wanted) - 1e-9 <= allowed <= max(level, wanted) + 1e-9
        limit.take(allowed - level)
        level = allowed
        history.append((now, level))
    for k, (start, before) in enumerate(history):
        for end, after in history[k:]:
            assert abs(after - before) <= slew * (end - start + burst) + 1e-6


def test_commands_at_the_slew_pass_whole_though_frames_jitter():
    limit = SlewLimit(250.0, 0.05, 0.0)
    level = now = 0.0
    for dt in (0.033, 0.025, 0.041, 0.033, 0.020, 0.046) * 3:
        now += dt
        wanted = level + 0.9 * 250.0 * 0.033
        assert limit.allowed(level, wanted, now) == pytest.approx(wanted)
        limit.take(wanted - level)
        level = wanted


@pytest.mark.parametrize(
    ("name", "value"),
    [("slew_V_per_s", 0.0), ("heartbeat_s", math.nan), ("travel_um", (3.0, 3.0)), ("protection_V", 50.0),
     ("current_trip_A", 0.0), ("lost_frames", -1), ("maximum_V", -5.0), ("protection_V", math.inf),
     ("heartbeat_s", 1e308), ("frame_age_s", 1e308), ("band_V", 1e308), ("lost_frames", 10**9), ("safe_V", 1e3),
     ("current_limit_A", math.inf), ("current_limit_A", 100.0), ("travel_um", (-1e9, 1e9)), ("slew_V_per_s", 1e9),
     ("shutdown_limit_s", 1e9), ("discharge_limit_s", 1e9), ("settle_s", 1e9), ("ramp_V_per_s", 1e9)],
)  # fmt: skip
def test_settings_out_of_range(name: str, value: object):
    with pytest.raises(ValueError, match=name):
        GuardSettings(**{name: value})  # pyright: ignore[reportArgumentType]


def test_orders_survive_the_way_to_the_process():
    orders = GuardOrders(SupplySettings("ASRL1::INSTR", serial="7"), "a.jsonl", replace(LIMITS, maximum_V=40.0), 3, "x")
    assert GuardOrders.from_json(orders.to_json()) == orders
