"""The way down against an exact clock: its rate, its deadlines, its order, and what it says."""

import itertools
from typing import Any

import pytest
from scripted_source import Clock, ClockedSource, KeptJournal

from bender_hil.guard import descent
from bender_hil.guard.descent import Landing, descend
from bender_hil.guard.settings import GuardSettings
from bender_hil.supply import patience
from bender_hil.supply.failures import LinkLostError, NoReplyError, WrongInstrumentError

LIMITS = GuardSettings(shutdown_limit_s=2.0, discharge_limit_s=3.0, ramp_V_per_s=100.0)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(descent, "time", clock)
    monkeypatch.setattr(patience, "time", clock)
    return clock


class Told:
    def __init__(self) -> None:
        self.words: list[tuple[str, dict[str, Any]]] = []

    def __call__(self, what: str, **facts: Any) -> None:
        self.words.append((what, facts))


def _descend(source: ClockedSource, from_V: float = 30.0, limits: GuardSettings = LIMITS):
    journal, told = KeptJournal(), Told()
    return descend(source, limits, from_V, journal, told), journal, told


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("rate", "expected_s"), [(100.0, 0.3), (1.0, 0.8)])
def test_a_ramp_is_straight_and_ends_in_time(clock: Clock, rate: float, expected_s: float, sign: float):
    source = ClockedSource(clock, on=True)
    limits = GuardSettings(shutdown_limit_s=2.0, ramp_V_per_s=rate)
    start_s = clock.now_s
    landing, journal, _ = _descend(source, sign * 30.0, limits)
    assert landing.confirmed
    volts = [(at_s - start_s, sign * level_V) for what, level_V, at_s in source.log if what == "volt"]
    slope = 30.0 / expected_s
    assert volts[-1][1] == 0.0
    assert volts[-1][0] == pytest.approx(expected_s, abs=0.01)
    for at_s, level_V in volts:
        assert level_V == pytest.approx(max(0.0, 30.0 - slope * (at_s + 0.005)), abs=0.02 * slope * 0.005 + 1e-3)
    assert len(volts) == pytest.approx(expected_s / 0.005, abs=2)
    assert journal.one("ramp") == {"kind": "ramp", "from_V": sign * 30.0, "rate_V_per_s": pytest.approx(slope)}


@pytest.mark.parametrize("rate", [100.0, 1.0])
def test_the_steps_of_the_ramp_are_written_down_once_the_output_is_off(clock: Clock, rate: float):
    source = ClockedSource(clock, on=True, wire_s=0.001)
    limits = GuardSettings(shutdown_limit_s=6.0, ramp_V_per_s=rate)
    _, journal, _ = _descend(source, 30.0, limits)
    sent = [(at_s + 0.001, level_V) for what, level_V, at_s in source.log if what == "volt"]
    steps = journal.one("came_down")["steps"]
    assert len(steps) <= 200
    assert set(steps) <= set(sent)
    assert steps[-1] == sent[-1]
    assert steps == sorted(steps)
    if rate == 100.0:
        assert steps == sent
    assert journal.kinds().index("output_off") < journal.kinds().index("came_down")


def test_the_discharge_is_written_down_every_twentieth_of_a_second(clock: Clock):
    source = ClockedSource(clock, on=True, readings_V=[*(30.0 - k / 10 for k in range(295)), 0.5])
    _, journal, _ = _descend(source, 0.0)
    told = [entry["measured_V"] for entry in journal.entries if entry["kind"] == "discharging"]
    assert 20 <= len(told) <= 30
    assert told == sorted(told, reverse=True)
    assert told[0] == 30.0


def test_the_switch_follows_zero_after_a_moment_and_is_asked_after_another(clock: Clock):
    source = ClockedSource(clock, on=True)
    _descend(source)
    last = [entry for entry in source.log if entry[0] == "volt"][-1]
    (off,) = [entry for entry in source.log if entry[0] == "off"]
    asked, _ = [entry for entry in source.log if entry[0] == "confirm?"]
    assert 0.010 <= off[2] - last[2] < 0.012
    assert 0.010 <= asked[2] - off[2] < 0.012


def test_a_slow_line_is_given_no_more_than_it_carries(clock: Clock):
    source = ClockedSource(clock, on=True, wire_s=0.02)
    _descend(source)
    times = [at_s for what, _, at_s in source.log if what == "volt"]
    assert all(later - earlier >= 0.0199 for earlier, later in itertools.pairwise(times))
    (off,) = [at_s for what, _, at_s in source.log if what == "off"]
    assert off - times[-1] >= 0.0299


def test_what_breaks_the_ramp_leads_straight_to_the_switch(clock: Clock):
    source = ClockedSource(clock, on=True, broken_writes=1)
    landing, journal, _ = _descend(source)
    assert landing.confirmed
    assert source.whats()[:5] == ["reconnect", "off", "resync", "volt", "off"]
    off, resync, volt, again = source.log[1:5]
    assert volt[1] == 0.0
    # two lines in one packet cost some supplies their link
    assert resync[2] - off[2] >= 0.01
    assert again[2] - volt[2] >= 0.01
    assert journal.one("ramp_broken")["sentence"] == "gone"
    assert journal.one("came_down")["steps"] == []
    assert "not_confirmed" not in journal.kinds()


def test_off_is_told_and_written_with_its_time(clock: Clock):
    source = ClockedSource(clock, on=True)
    landing, journal, told = _descend(source)
    assert landing.off_s is not None
    assert told.words == [("off", {"off_s": landing.off_s})]
    assert journal.one("output_off")["off_s"] == landing.off_s
    harmless = journal.one("harmless")
    assert landing.harmless_s is not None
    assert harmless["after_off_s"] == pytest.approx(landing.harmless_s - landing.off_s)
    assert (harmless["measured_V"], harmless["below_V"]) == (0.0, 1.0)


def test_the_deadline_is_that_of_every_answer_and_then_that_of_the_discharge(clock: Clock):
    source = ClockedSource(clock, on=True, confirm_errors=[NoReplyError("late")] * 1000)
    start_s = clock.now_s
    landing, journal, told = _descend(source, 0.0)
    assert landing == Landing(False, sentence="late")
    assert source.patience.end_s == pytest.approx(start_s + 2.0, abs=1e-3)
    assert clock.now_s - start_s == pytest.approx(2.0, abs=0.06)
    assert told.words == []
    attempts = [entry["attempt"] for entry in journal.entries if entry["kind"] == "not_confirmed"]
    assert attempts == list(range(len(attempts)))
    # a fresh link at every attempt but the first
    assert source.whats().count("reconnect") == len(attempts) - 1
    assert 30 <= len(attempts) <= 50

    source = ClockedSource(clock, on=True)
    landing, _, _ = _descend(source, 0.0)
    assert landing.off_s is not None
    assert source.patience.end_s == pytest.approx(landing.off_s + 3.0, abs=1e-3)


def test_a_question_that_the_deadline_cuts_off_hides_nothing_that_the_supply_has_said(clock: Clock):
    class CutOff(ClockedSource):
        def confirm_off(self) -> bool:
            is_off = super().confirm_off()
            if clock.now_s >= self.patience.end_s:
                raise NoReplyError("no answer within 0 s")
            return is_off

    source = CutOff(clock, on=True, answer_s=0.15, refused_offs=10**9)
    landing, _, _ = _descend(source, 0.0)
    assert landing == Landing(False, sentence="the supply says that its output is still on")
    assert source.patience.end_s <= clock.now_s
    silent = CutOff(clock, on=True, answer_s=5.0, refused_offs=10**9)
    assert _descend(silent, 0.0)[0].sentence == "no answer within 0 s"


def test_a_reading_counts_only_where_the_right_instrument_answers_before_and_after(clock: Clock):
    """The link is lost after "off" while 30 V are left, and another unit, at 0 V, answers at the address."""
    stranger = WrongInstrumentError("another instrument answers there")
    source = ClockedSource(clock, on=True, readings_V=[30.0, 0.0], resync_errors=[stranger] * 1000)
    source.measure_errors.append(LinkLostError("gone"))
    landing, journal, _ = _descend(source, 0.0)
    assert not landing.confirmed
    assert landing.off_s is not None
    assert "another instrument" in landing.sentence
    assert "harmless" not in journal.kinds()


def test_an_output_that_goes_on_again_is_switched_off_again(clock: Clock):
    source = ClockedSource(clock, on=True, on_again=1)
    landing, _, _ = _descend(source, 0.0)
    assert landing.confirmed
    assert source.on is False
    assert source.whats().count("off") == 2


def test_who_is_told_of_the_waiting_cannot_break_the_way_down(clock: Clock):
    source = ClockedSource(clock, on=True, confirm_errors=[NoReplyError("late")] * 3)

    def fail() -> None:
        raise MemoryError

    source.patience.waiting = fail
    landing, _, _ = _descend(source)
    assert landing.confirmed
    assert source.on is False


def test_live_terminals_are_told_when_the_limit_has_passed_and_given_up_after_the_discharge(clock: Clock):
    source = ClockedSource(clock, on=True, readings_V=[12.0])
    start_s = clock.now_s
    landing, journal, told = _descend(source, 0.0)
    assert not landing.confirmed
    assert landing.off_s is not None
    assert landing.sentence == "the output is off, but 12.00 V are still measured"
    assert [what for what, _ in told.words] == ["off", "overdue"]
    assert told.words[1][1] == {"sentence": landing.sentence}
    assert journal.one("overdue")["sentence"] == landing.sentence
    overdue_s = next(at_s for what, _, at_s in source.log if what == "volts?" and at_s > start_s + 2.0)
    assert overdue_s == pytest.approx(start_s + 2.0, abs=0.02)
    assert clock.now_s == pytest.approx(landing.off_s + 3.0, abs=0.02)
    # some two hundred looks a second
    assert source.whats().count("volts?") == pytest.approx(600, rel=0.1)


@pytest.mark.parametrize(("reading_V", "confirmed"), [(0.99, True), (-0.99, True), (1.0, False), (-1.0, False)])
def test_harmless_is_below_the_safe_level_either_way(clock: Clock, reading_V: float, confirmed: bool):
    landing, _, _ = _descend(ClockedSource(clock, on=True, readings_V=[reading_V]), 0.0)
    assert landing.confirmed is confirmed


def test_what_cannot_measure_is_believed_when_it_says_off(clock: Clock):
    landing, journal, _ = _descend(ClockedSource(clock, on=True, readings_V=[None]), 0.0)
    assert (landing.confirmed, landing.harmless_s) == (True, None)
    assert landing.off_s == journal.one("output_off")["off_s"]


def test_a_fall_in_time_is_nobodys_business(clock: Clock):
    source = ClockedSource(clock, on=True, readings_V=[20.0, 10.0, 5.0, 0.5])
    landing, journal, told = _descend(source, 0.0)
    assert landing.confirmed
    assert [what for what, _ in told.words] == ["off"]
    assert journal.one("harmless")["measured_V"] == 0.5


def test_an_answer_that_fails_while_it_discharges_is_asked_for_again_over_a_fresh_link(clock: Clock):
    source = ClockedSource(clock, on=True, measure_errors=[NoReplyError("late")])
    landing, _, _ = _descend(source, 0.0)
    assert landing.confirmed
    after = source.whats()[source.whats().index("volts?") :]
    assert after == ["volts?", "reconnect", "off", "resync", "volts?", "confirm?"]


def test_a_voltage_that_nobody_can_measure_is_not_confirmed(clock: Clock):
    errors: list[Exception] = [NoReplyError("late")] * 10_000
    source = ClockedSource(clock, on=True, measure_errors=errors, reconnect_errors=[OSError()] * 10_000)
    landing, _, _ = _descend(source, 0.0)
    assert not landing.confirmed
    assert landing.sentence.startswith("the output is off, but its voltage is not known")


def test_whatever_goes_wrong_is_no_reason_to_stop(clock: Clock):
    source = ClockedSource(clock, on=True, confirm_errors=[ValueError(), MemoryError("no memory")])
    landing, journal, _ = _descend(source, 0.0)
    assert landing.confirmed
    assert [entry["sentence"] for entry in journal.entries if entry["kind"] == "not_confirmed"] == [
        "ValueError", "no memory",
    ]  # fmt: skip


def test_it_says_that_it_is_alive_while_it_waits(clock: Clock):
    beats: list[float] = []
    source = ClockedSource(clock, on=True)
    source.patience.waiting = lambda: beats.append(clock.now_s)
    _descend(source, 30.0, GuardSettings(shutdown_limit_s=2.0, ramp_V_per_s=1.0))
    assert max(later - earlier for earlier, later in itertools.pairwise(beats)) <= 0.06
    assert beats[-1] - beats[0] > 0.7
