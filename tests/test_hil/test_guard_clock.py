"""The guard's own waits, against a clock that moves only when somebody waits."""

import math
import os
import time
from itertools import pairwise
from typing import Any

import pytest
from scripted_source import Clock, ClockedSource, KeptJournal

from bender_hil.guard.descent import Landing
from bender_hil.guard.guard import Guard, Status, say_end
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.watchman import Known
from bender_hil.supply.patience import Patience
from bender_loop.shell.last_word import UNKNOWN
from bender_loop.shell.messages import Channel


class ClockedChannel(Channel):
    """Brings each message at its time, counted from the first look, and keeps what it is told."""

    def __init__(self, clock: Clock, *due: tuple[float, dict[str, Any]]) -> None:
        self._clock, self._due, self._begin_s = clock, list(due), clock.now_s
        self.said: list[tuple[float, dict[str, Any]]] = []
        self.waits_s: set[float] = set()

    def send(self, message: dict[str, Any]) -> None:
        self.said.append((self._clock.now_s, message))

    def receive(self, timeout_s: float) -> dict[str, Any] | None:
        self.waits_s.add(timeout_s)
        end_s = self._clock.now_s + max(0.0, timeout_s)
        if self._due and self._begin_s + self._due[0][0] <= end_s:
            due_s, message = self._due.pop(0)
            self._clock.now_s = max(self._clock.now_s, self._begin_s + due_s)
            return message
        self._clock.now_s = end_s
        return None

    def has_message(self) -> bool:
        return bool(self._due) and self._begin_s + self._due[0][0] <= self._clock.now_s

    def times_s(self, word: str) -> list[float]:
        return [when_s for when_s, message in self.said if message["say"] == word]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(time, "perf_counter", clock.perf_counter)
    monkeypatch.setattr(time, "sleep", clock.sleep)
    return clock


def test_the_first_command_is_waited_for_as_long_as_the_manual_says(clock: Clock):
    channel = ClockedChannel(clock)
    limits = GuardSettings(heartbeat_s=0.5)
    status = Guard(ClockedSource(clock), limits, channel, KeptJournal()).run()
    (ready_s,), (tripped_s,) = channel.times_s("ready"), channel.times_s("tripped")
    assert status is Status.TRIPPED
    assert tripped_s - ready_s == pytest.approx(30.0 + limits.heartbeat_s, abs=0.1)


def test_it_is_heard_of_five_times_a_second(clock: Clock):
    channel = ClockedChannel(clock)
    Guard(ClockedSource(clock), GuardSettings(heartbeat_s=0.5), channel, KeptJournal()).run()
    times_s = channel.times_s("alive")
    assert len(times_s) > 100
    # nothing that happens to the supply waits longer for a look than this
    assert channel.waits_s == {0.01}
    assert all(0.2 <= later - earlier < 0.25 for earlier, later in pairwise(times_s[:100]))


@pytest.mark.parametrize(("after_s", "is_heard"), [(0.45, True), (0.55, False)])
def test_an_alarm_is_raised_again_when_nobody_hears_it_within_half_a_second(
    clock: Clock, capsys: pytest.CaptureFixture[str], after_s: float, is_heard: bool
):
    channel = ClockedChannel(clock, (after_s, {"do": "heard"}))
    say_end(channel, KeptJournal(), Status.UNCONFIRMED, Landing(False))
    assert (UNKNOWN in capsys.readouterr().err) is not is_heard


@pytest.mark.parametrize(("answer_s", "is_refused"), [(0.12, False), (0.13, True)])
def test_answers_that_do_not_fit_into_the_settling_time_are_refused(clock: Clock, answer_s: float, is_refused: bool):
    channel = ClockedChannel(clock, (0.0, {"do": "stop"}))
    source = ClockedSource(clock, answer_s=answer_s)
    status = Guard(source, GuardSettings(settle_s=0.25), channel, KeptJournal()).run()
    assert (status is Status.REFUSED) is is_refused


def test_a_turn_is_the_usual_time_of_a_command_and_that_of_a_look(clock: Clock):
    class Uneven(ClockedSource):
        def _ask(self, what: str) -> None:
            clock.sleep(times_s[what].pop(0) if times_s.get(what) else 0.0)
            super()._ask(what)

    times_s = {"setting?": [0.01, 0.09, 0.015], "volts?": [0.04, 0.03, 0.0425]}
    journal = KeptJournal()
    Guard(Uneven(clock), GuardSettings(), ClockedChannel(clock, (0.0, {"do": "stop"})), journal).run()
    assert journal.one("opened")["turn_s"] == pytest.approx(0.055, abs=1e-3)


@pytest.mark.parametrize("answer_s", [0.0, 0.004, 0.02])
def test_a_supply_that_is_given_no_commands_is_asked_many_times_within_the_settling_time(clock: Clock, answer_s: float):
    source, channel = ClockedSource(clock, answer_s=answer_s), ClockedChannel(clock, (3.0, {"do": "stop"}))
    limits = GuardSettings()
    assert Guard(source, limits, channel, KeptJournal()).run() is Status.DONE
    (ready_s,), (off_s,) = channel.times_s("ready"), channel.times_s("off")
    asked_s = [at_s for what, _, at_s in source.log if what.endswith("?") and ready_s <= at_s < off_s - 0.2]
    assert max(after - before for before, after in pairwise([ready_s, *asked_s])) < 0.4 * limits.settle_s


@pytest.mark.parametrize(
    ("end_in_s", "wanted_s", "waits_s"), [(5.0, 0.2, 0.2), (0.1, 0.2, 0.1), (-1.0, 0.2, 0.0), (math.inf, 0.2, 0.2)]
)
def test_nothing_is_waited_for_beyond_the_deadline(clock: Clock, end_in_s: float, wanted_s: float, waits_s: float):
    clock.look_s = 0.0
    patience, begin_s = Patience(), clock.now_s
    patience.end_s = begin_s + end_in_s
    assert patience.left_s(wanted_s) == pytest.approx(waits_s)
    patience.pause(wanted_s)
    assert clock.now_s - begin_s == pytest.approx(waits_s)


def test_who_waits_shows_that_it_is_alive_and_is_not_kept_from_waiting(clock: Clock):
    clock.look_s, told_s = 0.0, []

    def waiting() -> None:
        told_s.append(clock.now_s)
        raise RuntimeError("nobody listens")

    patience, begin_s = Patience(), clock.now_s
    patience.waiting = waiting
    patience.pause(1.0)
    assert clock.now_s - begin_s == pytest.approx(1.0)
    assert max(after - before for before, after in pairwise([begin_s, *told_s, clock.now_s])) <= 0.05 + 1e-9


@pytest.mark.parametrize("refused_offs", [0, 10**9])
def test_the_watchman_is_told_when_an_output_may_be_on_and_whether_it_is_off_again(clock: Clock, refused_offs: int):
    watchman, known = ClockedChannel(clock), Known()
    channel = ClockedChannel(clock, (1.0, {"do": "stop"}))
    source = ClockedSource(clock, refused_offs=refused_offs)
    Guard(source, GuardSettings(shutdown_limit_s=0.3), channel, KeptJournal(), None, watchman).run()
    begun_s = next(at_s for what, _, at_s in source.log if what == "arm")
    (arming,) = [(at_s, message) for at_s, message in watchman.said if message["say"] == "arming"]
    assert arming[0] <= begun_s
    assert list(arming[1]["identity"]) == ["B&K", "9115", "EMU1", "V1"]
    assert arming[1]["pid"] == os.getpid()
    # and whoever replaces this guard knows which instrument it was, before anything is switched
    assert channel.times_s("opened")[0] <= begun_s
    for _, message in watchman.said:
        known.take("said", message)
    assert known.may_be_on == (refused_offs > 0)
