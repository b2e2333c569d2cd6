"""Rules exactly at their bounds, the slew, and the limits that hold when a bench file names none."""

import math
import re
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from present import present

from bender_hil.guard.rules import Situation, judge
from bender_hil.guard.settings import GuardOrders, GuardSettings
from bender_hil.guard.slew import SlewLimit
from bender_hil.supply.select import SupplySettings

# halves and quarters, so that sums are exact
LIMITS = GuardSettings(
    heartbeat_s=0.25, frame_age_s=0.5, lost_frames=2, travel_um=(-8.0, 40.0), band_V=1.5, settle_s=0.25
)
WELL = Situation(now_s=10.0, beat_s=10.0, frame_s=10.0, tip_um=0.0, lowest_V=20.0, highest_V=22.0, measured_V=21.0)


@pytest.mark.parametrize(
    ("at_bound", "beyond", "code", "sentence"),
    [
        ({"beat_s": 9.75}, {"beat_s": 9.5}, "heartbeat", "the controller was silent for 500 ms, allowed: 250 ms"),
        ({"frame_s": 9.5}, {"frame_s": 9.25}, "frame_age", "the newest reading is 750 ms old, allowed: 500 ms"),
        (
            {"frame_s": 10.0 + 2**-7},
            {"frame_s": 1010.0},
            "frame_age",
            "the newest reading is 1000000 ms ahead of now: its time is not one of time.perf_counter",
        ),
        ({"lost": 2}, {"lost": 3}, "lost_tip", "3 readings in a row without a tip, allowed: 2"),
        ({"tip_um": -8.0}, {"tip_um": -8.25}, "travel", "the tip is at -8.25 µm, allowed: -8 ... 40 µm"),
        ({"tip_um": 40.0}, {"tip_um": 40.25}, "travel", "the tip is at 40.25 µm, allowed: -8 ... 40 µm"),
        ({"measured_V": 18.5}, {"measured_V": 18.25}, "band", "18.250 V are measured, expected 18.500 ... 23.500 V"),
        ({"measured_V": 23.5}, {"measured_V": 23.75}, "band", "23.750 V are measured, expected 18.500 ... 23.500 V"),
        (
            {"high_for_s": 0.25, "measured_A": 0.5},
            {"high_for_s": 0.5, "measured_A": 0.5},
            "current",
            "0.5 A flow, allowed: 0.008 A for longer than 250 ms",
        ),
    ],
)  # fmt: skip
def test_a_bound_itself_is_allowed(at_bound: dict[str, Any], beyond: dict[str, Any], code: str, sentence: str):
    assert judge(LIMITS, replace(WELL, **at_bound)) is None
    assert judge(LIMITS, replace(WELL, **beyond)) == (code, sentence)


def test_all_is_well_within_the_bounds_and_as_long_as_nothing_is_known():
    assert judge(LIMITS, WELL) is None
    assert judge(GuardSettings(), Situation()) is None


@pytest.mark.parametrize(
    "reading",
    [{"measured_A": -math.inf}, {"measured_A": math.nan}, {"measured_A": -1.1}, {"measured_V": math.nan},
     {"measured_V": 1e300}],
)  # fmt: skip
def test_a_reading_that_no_instrument_gives_ends_the_run(reading: dict[str, float]):
    assert present(judge(LIMITS, replace(WELL, **reading))).code == "reading"
    assert judge(LIMITS, replace(WELL, measured_A=0.99)) is None


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


def test_the_limits_that_hold_without_a_word():
    """They are what the manual promises: a change here is a change there."""
    assert asdict(GuardSettings()) == {
        "maximum_V": 50.0, "minimum_V": 0.0, "protection_V": 55.0, "current_limit_A": 0.01, "current_trip_A": 0.008,
        "slew_V_per_s": 250.0, "burst_s": 0.05, "ramp_V_per_s": 500.0, "heartbeat_s": 0.1, "frame_age_s": 0.11,
        "lost_frames": 2, "travel_um": (-10.0, 45.0), "band_V": 1.0, "settle_s": 0.25, "safe_V": 1.0,
        "shutdown_limit_s": 6.0, "discharge_limit_s": 10.0,
    }  # fmt: skip
    orders = GuardOrders(SupplySettings("ASRL1::INSTR"), "a.jsonl")
    assert (orders.port, orders.password, orders.realtime, orders.make_safe) == (None, "", False, False)


@pytest.mark.parametrize(
    "name",
    [
        "slew_V_per_s", "burst_s", "ramp_V_per_s", "heartbeat_s", "frame_age_s", "band_V", "settle_s", "safe_V",
        "shutdown_limit_s", "discharge_limit_s", "current_trip_A",
    ],
)  # fmt: skip
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_limit_is_a_finite_number_above_0(name: str, value: Any):
    with pytest.raises(ValueError, match=name):
        GuardSettings(**{name: value})


def test_no_frame_need_be_lost():
    assert GuardSettings(lost_frames=0).lost_frames == 0
    assert judge(GuardSettings(lost_frames=0), Situation(lost=1)) is not None


@pytest.mark.parametrize(
    ("name", "value"),
    [("travel_um", (1.0,)), ("travel_um", (1.0, 2.0, 3.0)), ("travel_um", (2.0, 1.0)), ("travel_um", (1.0, 1.0)),
     ("travel_um", (-1e9, 1e9)), ("lost_frames", -1), ("maximum_V", -5.0), ("protection_V", 50.0),
     ("protection_V", math.inf), ("current_limit_A", math.inf)],
)  # fmt: skip
def test_what_is_no_limit_is_refused_by_its_name(name: str, value: Any):
    with pytest.raises(ValueError, match=name):
        GuardSettings(**{name: value})
    assert GuardSettings(travel_um=[1.0, 2.0]).travel_um == (1.0, 2.0)  # pyright: ignore[reportArgumentType]


def test_what_the_supply_is_told():
    bounds = GuardSettings(maximum_V=40.0, protection_V=44.0, current_limit_A=0.02, minimum_V=-3.0).bounds()
    assert (bounds.maximum_V, bounds.protection_V, bounds.current_A, bounds.minimum_V) == (40.0, 44.0, 0.02, -3.0)


PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "bench-file.md").read_text(encoding="utf-8")


def _promised() -> dict[str, float]:
    """What the manual's table says that each limit of the guard may be at most."""
    section = PAGE.partition("## `[guard]`")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (`.*?`) \| .*? \| (.*?) \| .* \|$", section, re.MULTILINE)
    most: dict[str, float] = {}
    for names, cell in rows:
        parts = [part.strip() for part in cell.split(",")]
        values = [1e6 if part == "10⁶" else float(part) for part in parts if part == "10⁶" or part.isdecimal()]
        for place, name in enumerate(re.findall(r"`(\w+)`", names)):
            if values:
                most[name] = values[min(place, len(values) - 1)]
    return most


def test_the_manual_says_of_every_limit_how_large_it_may_be():
    assert set(_promised()) == {field.name for field in fields(GuardSettings)} - {"travel_um"}


@pytest.mark.parametrize("name", sorted(_promised()))
def test_a_limit_may_be_as_large_as_the_manual_says_and_no_larger(name: str):
    most = _promised()[name]
    others: dict[str, Any] = {"maximum_V": {"protection_V": 1500.0}, "minimum_V": {}}.get(name, {})
    if name == "minimum_V":
        # below 0, and above the protection's negative
        assert GuardSettings(minimum_V=-54.9).minimum_V == -54.9
        with pytest.raises(ValueError, match="minimum_V"):
            GuardSettings(minimum_V=-55.0)
        return
    kind = int if name == "lost_frames" else float
    assert getattr(GuardSettings(**{**others, name: kind(most)}), name) == most
    with pytest.raises(ValueError, match=name):
        GuardSettings(**{**others, name: kind(most) + kind(1) if kind is int else 1.001 * most})
