"""The guarded output against an exact clock: clamps, slew, and what is asked when."""

from typing import Any

import pytest
from present import present
from scripted_source import Clock, ClockedSource, KeptJournal

from bender_hil.guard import output as module
from bender_hil.guard.output import GuardedOutput
from bender_hil.guard.rules import Situation
from bender_hil.guard.settings import GuardSettings

LIMITS = GuardSettings(minimum_V=-5.0, maximum_V=40.0, slew_V_per_s=100.0, burst_s=0.05, settle_s=0.25)
ROUND = ["volts?", "setting?", "volts?", "amperes?", "volts?", "switch?", "volts?", "protection?"]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def _output(clock: Clock, limits: GuardSettings = LIMITS, **facts: object):
    source = ClockedSource(clock, **facts)  # pyright: ignore[reportArgumentType]
    journal, situation = KeptJournal(), Situation()
    return GuardedOutput(source, limits, journal, situation), source, journal, situation


@pytest.mark.parametrize(
    ("wanted_V", "clamped_V"), [(-5.0, None), (-5.1, -5.0), (40.0, None), (40.1, 40.0), (1e9, 40.0), (0.0, None)]
)
def test_clamps(clock: Clock, wanted_V: float, clamped_V: float | None):
    output, source, journal, _ = _output(clock, GuardSettings(minimum_V=-5.0, maximum_V=40.0, slew_V_per_s=1e6))
    output.command(wanted_V, 7)
    assert source.level_V == (wanted_V if clamped_V is None else clamped_V)
    assert output.clamped == (0 if clamped_V is None else 1)
    if clamped_V is not None:
        assert journal.one("clamped") == {
            "kind": "clamped", "sequence": 7, "wanted_V": wanted_V, "clamped_V": clamped_V,
        }  # fmt: skip


def test_a_jump_is_begun_at_once_and_gone_on_with(clock: Clock):
    output, source, journal, _ = _output(clock)
    output.command(12.0, 3)
    assert (source.level_V, output.voltage_V, output.slowed) == (5.0, 5.0, 1)
    clock.sleep(0.04)
    output.continue_slew()
    assert source.level_V == pytest.approx(9.0, abs=1e-3)
    clock.sleep(0.05)
    output.continue_slew()
    assert (source.level_V, output.slowed) == (12.0, 1)
    sent = len(source.log)
    output.continue_slew()
    assert len(source.log) == sent
    applied = [(entry["sequence"], entry["voltage_V"], entry["whole"]) for entry in journal.entries]
    assert applied == [(3, 5.0, True), (3, pytest.approx(9.0, abs=1e-3), False), (3, 12.0, False)]
    assert journal.entries[0]["command_time_s"] == pytest.approx(source.log[0][2], abs=1e-3)


def test_a_whole_command_is_not_counted_as_slowed_and_a_repeated_one_is_sent_again(clock: Clock):
    output, source, _, _ = _output(clock)
    output.command(3.0, 0)
    output.command(3.0, 1)
    assert output.slowed == 0
    assert [value for what, value, _ in source.log if what == "volt"] == [3.0, 3.0]


def test_without_room_in_the_bucket_nothing_is_sent_between_commands(clock: Clock):
    output, source, _, _ = _output(clock)
    clock.look_s = 0.0
    output.command(12.0, 0)
    sent = len(source.log)
    output.continue_slew()
    assert len(source.log) == sent


def test_all_questions_in_their_turn_while_there_is_time(clock: Clock):
    output, source, _, situation = _output(clock, current_A=0.003)
    assert output.patrol(lambda: False) is None
    assert source.whats() == ROUND
    assert situation.measured_A == 0.003
    assert situation.measured_V == 0.0


def test_a_patrol_ends_when_its_time_is_over(clock: Clock):
    output, source, _, _ = _output(clock, answer_s=0.004)
    output.patrol(lambda: False)
    assert source.whats() == ROUND[:2]
    output.patrol(lambda: False)
    assert source.whats() == ROUND[:4]


def test_a_waiting_message_comes_first_but_not_for_longer_than_the_settling_time(clock: Clock):
    output, source, _, _ = _output(clock)
    output.patrol(lambda: True)
    assert source.whats() == ROUND[:1]  # never asked before: overdue
    output.patrol(lambda: True)
    clock.sleep(0.24)
    output.patrol(lambda: True)
    assert source.whats() == ROUND[:1]
    clock.sleep(0.02)
    output.patrol(lambda: True)
    assert source.whats() == ROUND[:2]  # one question, no more


@pytest.mark.parametrize(("period_s", "answer_s"), [(1e-3, 0.3e-3), (1e-3, 0.19e-3), (0.01, 0.004), (0.033, 0.002)])
def test_no_command_has_to_wait_for_a_question(clock: Clock, period_s: float, answer_s: float):
    clock.look_s = 1e-7
    output, source, _, _ = _output(clock, answer_s=answer_s)
    due_s = clock.now_s
    for tick in range(60):
        # from then on the rhythm and the time of a question are known
        assert tick < 3 or clock.now_s <= due_s
        clock.now_s = max(clock.now_s, due_s)
        output.command(0.0, tick)
        output.patrol(lambda due_s=due_s: clock.now_s >= due_s + period_s)
        due_s += period_s
    assert source.whats().count("volts?") >= 20


@pytest.mark.parametrize("answer_s", [0.0011, 0.02, 0.04])
def test_a_supply_that_answers_more_slowly_than_commands_come_is_asked_all_the_same(clock: Clock, answer_s: float):
    output, source, _, _ = _output(clock, answer_s=answer_s)
    start_s = clock.now_s
    for tick in range(300):
        output.command(0.0, tick)
        output.patrol(lambda: False)
        clock.sleep(0.001)
    times_s = [at_s for what, _, at_s in source.log if what in ROUND]
    assert (
        max(after - before for before, after in zip([start_s, *times_s], times_s, strict=False)) < 0.05 + 3 * answer_s
    )


def test_idle_is_the_time_since_the_last_question(clock: Clock):
    output, _, _, _ = _output(clock)
    assert output.idle_s() > 1e6
    output.patrol(lambda: False)
    clock.sleep(0.5)
    assert output.idle_s() == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("facts", "code"),
    [
        ({"setting_V": 0.0019}, None), ({"setting_V": -0.0019}, None), ({"setting_V": 0.0021}, "setting"),
        ({"setting_V": -0.0021}, "setting"), ({"on": False}, "output_off"), ({"tripped": True}, "protection"),
    ],
)  # fmt: skip
def test_a_supply_that_says_that_it_is_not_as_it_was_told_trips(clock: Clock, facts: dict[str, Any], code: str | None):
    output, _, _, _ = _output(clock, **facts)
    trip = output.patrol(lambda: False)
    assert (None if trip is None else trip.code) == code


def test_a_setting_is_compared_with_what_was_told_last(clock: Clock):
    output, source, _, _ = _output(clock)
    output.command(4.0, 0)
    assert output.patrol(lambda: False) is None
    source.setting_V = 3.9
    trip = present(output.patrol(lambda: False))
    assert trip.sentence == "the supply is set to 3.9 V, it was told 4 V"


def test_the_bucket_loses_what_was_changed_and_no_more(clock: Clock):
    output, source, _, _ = _output(clock)
    clock.look_s = 0.0
    for sequence, wanted_V in enumerate((2.0, 1.0, 2.5, 9.0)):
        output.command(wanted_V, sequence)
    # 5 V fit in: 2 up, 1 down, 1.5 up, and 0.5 are left of the last
    assert [value for what, value, _ in source.log if what == "volt"] == [2.0, 1.0, 2.5, 3.0]


@pytest.mark.parametrize("current_A", [0.0081, -0.0081])
def test_a_current_counts_from_the_first_high_reading_to_the_last(clock: Clock, current_A: float):
    output, source, _, situation = _output(clock, current_A=current_A)
    output.patrol(lambda: False)
    assert situation.high_for_s == 0.0
    clock.sleep(0.3)
    output.patrol(lambda: False)
    assert situation.high_for_s == pytest.approx(0.3, abs=1e-3)
    source.current_A = 0.008
    output.patrol(lambda: False)
    assert situation.high_for_s == 0.0
    clock.sleep(0.3)
    source.current_A = current_A
    output.patrol(lambda: False)
    assert situation.high_for_s == 0.0


def test_a_source_that_cannot_measure_has_no_current(clock: Clock):
    output, _, _, situation = _output(clock, current_A=None)
    output.patrol(lambda: False)
    assert (situation.measured_A, situation.high_for_s) == (None, 0.0)


def test_the_band_is_around_all_that_was_set_within_the_settling_time(clock: Clock):
    output, _, journal, situation = _output(clock)
    output.command(4.0, 0)
    clock.sleep(0.1)
    output.command(2.0, 1)
    output.patrol(lambda: False)
    assert (situation.lowest_V, situation.highest_V) == (0.0, 4.0)
    clock.sleep(0.2)  # 0.3 s after 4 V were set: 0 V are forgotten, 4 V held until 0.2 s ago
    output.patrol(lambda: False)
    assert (situation.lowest_V, situation.highest_V) == (2.0, 4.0)
    clock.sleep(0.1)
    output.patrol(lambda: False)
    assert (situation.lowest_V, situation.highest_V) == (2.0, 2.0)
    last = journal.entries[-1]
    assert (last["kind"], last["sequence"], last["supply_voltage_V"], last["current_A"]) == ("measured", 1, 2.0, 0.0)


def test_the_band_counts_from_the_question_and_not_from_a_late_answer(clock: Clock):
    output, _, _, situation = _output(clock, answer_s=0.2)
    output.command(4.0, 0)
    clock.sleep(-0.2 + 0.1)  # 0.1 s after the setting
    output.patrol(lambda: False)
    assert (situation.lowest_V, situation.highest_V) == (0.0, 4.0)
