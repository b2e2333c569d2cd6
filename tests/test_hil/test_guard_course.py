"""The guard's course without a process: what it is told beforehand stands in a real channel, then it runs."""

import contextlib
import json
import re
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from present import present
from scripted_source import ClockedSource, KeptJournal

from bender_hil.guard.descent import Landing
from bender_hil.guard.guard import Guard, Status, say_end
from bender_hil.guard.settings import GuardSettings
from bender_hil.supply.failures import NoReplyError, SupplyError, WrongInstrumentError
from bender_hil.supply.parse import Identity
from bender_loop.shell.last_word import UNKNOWN
from bender_loop.shell.messages import Channel, ClosedError, Listener, call

LIMITS = GuardSettings(
    shutdown_limit_s=0.3, discharge_limit_s=0.2, heartbeat_s=0.15, frame_age_s=5.0, settle_s=0.25, slew_V_per_s=1e5
)


@pytest.fixture
def channels() -> Iterator[tuple[Channel, Channel]]:
    listener = Listener()
    theirs = call(listener.port, listener.password)
    ours = listener.accept(5.0)
    listener.close()
    with theirs, ours:
        yield ours, theirs


def command(sequence: int = 0, voltage_V: float = 10.0, tip_um: float | None = 1.0, **facts: Any) -> dict[str, Any]:
    return {
        "do": "command", "sequence": sequence, "voltage_V": voltage_V, "frame_s": time.perf_counter(),
        "tip_um": tip_um, **facts,
    }  # fmt: skip


def run(
    channels: tuple[Channel, Channel], *messages: dict[str, Any], source: ClockedSource | None = None,
    limits: GuardSettings = LIMITS, journal: KeptJournal | None = None,
) -> tuple[Status, dict[str, dict[str, Any]], ClockedSource, KeptJournal]:  # fmt: skip
    ours, theirs = channels
    source, journal = source or ClockedSource(), journal or KeptJournal()
    for message in messages:
        ours.send(message)
    status = Guard(source, limits, theirs, journal).run()
    said: dict[str, dict[str, Any]] = {}
    with contextlib.suppress(ClosedError):
        while (message := ours.receive(0.0)) is not None:
            said[message["say"]] = message
    return status, said, source, journal


STOP = {"do": "stop"}


def test_a_run_that_is_done(channels: tuple[Channel, Channel]):
    status, said, source, journal = run(channels, command(4, 10.0), STOP)
    assert status is Status.DONE
    assert said["end"] == {
        "say": "end", "status": 0, "confirmed": True, "off_s": said["off"]["off_s"],
        "harmless_s": said["end"]["harmless_s"], "code": None, "sentence": None, "clamped": 0, "slowed": 0, "alarm": "",
    }  # fmt: skip
    assert said["ready"] == {
        "say": "ready", "emulated": True, "remarks": [],
        "identity": {"manufacturer": "B&K", "model": "9115", "serial": "EMU1", "firmware": "V1"},
    }  # fmt: skip
    assert source.whats()[-2:] == ["release", "close"]
    assert not source.on
    assert journal.one("opened")["emulated"] is True
    assert journal.kinds()[-1] == "end"
    assert "trip" not in journal.kinds()
    assert journal.one("end")["status"] == 0


def test_only_the_newest_of_the_commands_that_wait_is_carried_out(channels: tuple[Channel, Channel]):
    source = ClockedSource()
    status, said, _, journal = run(
        channels, command(0, 1.0), command(1, 2.0), command(2, 3.0), {"do": "trip", "code": "x", "sentence": "y"},
        source=source,
    )  # fmt: skip
    assert status is Status.TRIPPED
    superseded = [(e["sequence"], e["wanted_V"]) for e in journal.entries if e["kind"] == "superseded"]
    assert superseded == [(0, 1.0), (1, 2.0)]
    assert (said["end"]["code"], said["end"]["sentence"]) == ("x", "y")
    assert said["tripped"] == {"say": "tripped", "code": "x", "sentence": "y"}
    assert journal.one("trip") == {"kind": "trip", "code": "x", "sentence": "y"}


def test_a_command_without_a_number_has_one_that_no_tick_has(channels: tuple[Channel, Channel]):
    unnumbered = {name: value for name, value in command(0, 1.0).items() if name != "sequence"}
    _, _, _, journal = run(channels, unnumbered, command(1, 2.0), STOP)
    assert [entry["sequence"] for entry in journal.entries if entry["kind"] == "superseded"] == [-1]


@pytest.mark.parametrize(
    "bad",
    [
        {"voltage_V": "10"}, {"voltage_V": None}, {"frame_s": None}, {"frame_s": "0"}, {"tip_um": "1"},
        {"sequence": "0"}, {"sequence": 1.5}, {"do": "dance"},
    ],
)  # fmt: skip
def test_a_command_or_an_order_that_is_none_ends_the_run(channels: tuple[Channel, Channel], bad: dict[str, Any]):
    status, said, source, _ = run(channels, {**command(), **bad})
    assert status is Status.TRIPPED
    assert said["end"]["code"] == "bad_command"
    assert bad.get("do", "") in said["end"]["sentence"]
    assert max(value for what, value, _ in source.log if what == "volt") == 0.0


@pytest.mark.parametrize(("refused_offs", "status"), [(0, Status.TRIPPED), (10**9, Status.UNCONFIRMED)])
def test_who_has_lost_its_controller_raises_its_alarm_itself(
    channels: tuple[Channel, Channel], capsys: pytest.CaptureFixture[str], refused_offs: int, status: Status
):
    ours, theirs = channels
    ours.close()
    source, journal = ClockedSource(refused_offs=refused_offs), KeptJournal()
    assert Guard(source, LIMITS, theirs, journal).run() is status
    assert journal.one("end")["code"] == "controller_gone"
    alarm = f"{UNKNOWN} (the supply says that its output is still on)" if refused_offs else ""
    assert capsys.readouterr().err.strip() == journal.one("end")["alarm"] == alarm


def test_an_alarm_that_is_acknowledged_is_not_raised_twice(
    channels: tuple[Channel, Channel], capsys: pytest.CaptureFixture[str]
):
    """Only a word for it is an acknowledgement; without a channel, or a second time, there is none."""
    ours, theirs = channels
    alarmed = KeptJournal(), Status.UNCONFIRMED, Landing(False, sentence="why")
    ours.send({"do": "beat"})
    ours.send({"do": "heard"})
    say_end(theirs, *alarmed, code=None)
    assert capsys.readouterr().err == ""
    message = present(ours.receive(1.0))
    assert message["alarm"] == f"{UNKNOWN} (why)"
    for unheard in (theirs, None):
        say_end(unheard, *alarmed, code=None)
        assert UNKNOWN in capsys.readouterr().err
    say_end(None, KeptJournal(), Status.DONE, Landing(True), code=None)
    assert capsys.readouterr().err == ""


def test_live_terminals_are_an_alarm_though_the_output_is_off_and_a_controller_that_takes_it_has_not_heard_it(
    channels: tuple[Channel, Channel], capsys: pytest.CaptureFixture[str]
):
    status, said, source, _ = run(channels, STOP, source=ClockedSource(readings_V=[0.0, 0.0, 0.0, 0.0, 7.0]))
    assert status is Status.UNCONFIRMED
    assert "7.00 V" in said["end"]["alarm"]
    assert said["end"]["confirmed"] is False
    assert "release" not in source.whats()
    assert UNKNOWN in capsys.readouterr().err


class Refusing(ClockedSource):
    error: Exception

    def open(self) -> Identity:
        raise self.error


@pytest.mark.parametrize(
    ("error", "status"), [(WrongInstrumentError("another"), Status.REFUSED), (NoReplyError("none"), Status.TRIPPED)]
)
def test_an_instrument_that_does_not_answer_right_is_refused(
    channels: tuple[Channel, Channel], error: SupplyError, status: Status
):
    source = Refusing()
    source.error = error
    found, said, _, journal = run(channels, source=source)
    assert (found, said["refused"]["status"]) == (status, int(status))
    assert str(error) in said["refused"]["sentence"]
    assert journal.kinds() == ["refused"]
    assert source.whats() == ["close"]


@pytest.mark.parametrize(
    ("answer_s", "accepted", "slow"), [(0.0, True, False), (0.05, True, True), (0.14, False, True)]
)
def test_a_slow_instrument_is_accepted_with_a_remark_or_refused_with_the_reason(
    channels: tuple[Channel, Channel], answer_s: float, accepted: bool, slow: bool
):
    status, said, source, journal = run(channels, STOP, source=ClockedSource(answer_s=answer_s))
    if accepted:
        assert status is Status.DONE
        assert bool(said["ready"]["remarks"]) is slow
        assert journal.one("opened")["turn_s"] == pytest.approx(2 * answer_s, abs=0.02)
        if slow:
            found = present(re.search(r"at most (\d+) commands per second", said["ready"]["remarks"][0]))
            assert 5 <= int(found[1]) <= 10
    else:
        assert status is Status.REFUSED
        assert "raise guard.settle_s" in said["refused"]["sentence"]
        assert "settle_s = 250 ms" in said["refused"]["sentence"]
        assert "arm" not in source.whats()


def test_a_slow_instrument_does_not_make_the_controller_silent(channels: tuple[Channel, Channel]):
    """Answers of 60 ms, a heartbeat of 150 ms: what waits in the channel was said in time."""
    ours, theirs = channels
    source, journal = ClockedSource(answer_s=0.06), KeptJournal()
    guard = Guard(source, LIMITS, theirs, journal)
    sent = 0

    def look_on() -> None:
        nonlocal sent
        if "armed" in journal.kinds() and sent < 30:
            ours.send(command(sent, 5.0))
            sent += 1
            if sent == 30:
                ours.send(STOP)

    ask = source._ask
    source._ask = lambda what: (look_on(), ask(what), look_on())[1]  # pyright: ignore[reportAttributeAccessIssue]
    ours.send(command(0, 5.0))
    assert guard.run() is Status.DONE
    assert journal.kinds().count("superseded") > 10


def test_a_fault_in_the_guard_itself_brings_the_output_down(channels: tuple[Channel, Channel]):
    class Broken(ClockedSource):
        def is_on(self) -> bool:
            raise ZeroDivisionError("oh")

    source = Broken()
    status, said, _, _ = run(channels, command(), source=source)
    assert (status, said["end"]["code"]) == (Status.TRIPPED, "guard")
    assert "ZeroDivisionError: oh" in said["end"]["sentence"]
    assert not source.on


@pytest.mark.parametrize(
    ("error", "status", "code"),
    [(NoReplyError("armed not"), Status.TRIPPED, "supply"), (ValueError("too much"), Status.REFUSED, "limits")],
)
def test_a_supply_that_cannot_be_armed_is_led_down_from_0_V(
    channels: tuple[Channel, Channel], error: Exception, status: Status, code: str
):
    class Failing(ClockedSource):
        def arm(self, bounds: object) -> list[str]:
            raise error

    found, said, _, journal = run(channels, source=Failing())
    assert (found, said["end"]["code"], said["end"]["sentence"]) == (status, code, str(error))
    assert journal.one("ramp")["from_V"] == 0.0


def test_a_signal_and_a_journal_that_fails_end_the_run(channels: tuple[Channel, Channel]):
    ours, theirs = channels
    guard = Guard(ClockedSource(), LIMITS, theirs, KeptJournal())
    guard.signal = "SIGQUIT"
    assert guard.run() is Status.TRIPPED
    journal = KeptJournal()
    journal.failure = "No space left on device"
    status, said, _, _ = run((ours, theirs), journal=journal)
    assert (status, said["end"]["code"]) == (Status.TRIPPED, "journal")


def test_the_way_down_begins_where_the_output_is(channels: tuple[Channel, Channel]):
    ours, theirs = channels
    source, journal = ClockedSource(), KeptJournal()
    guard = Guard(source, LIMITS, theirs, journal)
    ours.send(command(0, 20.0))
    guard.run()  # ends by silence
    assert journal.one("ramp")["from_V"] == 20.0
    assert journal.one("end")["clamped"] == 0


@pytest.mark.parametrize(
    ("tips_um", "code"), [((None, None, None), "lost_tip"), ((None, None, 1.0, None, None), "heartbeat")]
)
def test_lost_tips_are_counted_in_a_row(
    channels: tuple[Channel, Channel], tips_um: tuple[float | None, ...], code: str
):
    messages = [command(k, tip_um=tip) for k, tip in enumerate(tips_um)]
    status, said, _, _ = run(channels, *messages, limits=replace(LIMITS, lost_frames=2))
    assert (status, said["end"]["code"]) == (Status.TRIPPED, code)


def test_an_idle_supply_is_looked_after(channels: tuple[Channel, Channel]):
    status, said, source, _ = run(
        channels, source=ClockedSource(tripped=True), limits=replace(LIMITS, heartbeat_s=5.0)
    )  # fmt: skip
    assert (status, said["end"]["code"]) == (Status.TRIPPED, "protection")
    assert "volts?" in source.whats()


def test_messages_without_pause_do_not_keep_the_guard_from_its_work(channels: tuple[Channel, Channel]):
    ours, theirs = channels
    source = ClockedSource(readings_V=[20.0])
    line = json.dumps({"do": "beat"}).encode() + b"\n"
    for _ in range(2500):
        ours._stream.sendall(line)
    ours.send(STOP)
    journal = KeptJournal()
    Guard(source, LIMITS, theirs, journal).run()
    assert journal.one("end")["code"] == "band"


def test_what_is_found_after_a_command_ends_the_run_at_once(channels: tuple[Channel, Channel]):
    ours, theirs = channels
    source = ClockedSource(tripped=True)
    ours.send(command(0, 5.0))
    journal = KeptJournal()
    Guard(source, replace(LIMITS, heartbeat_s=5.0), theirs, journal).run()
    assert journal.one("end")["code"] == "protection"
    assert source.whats().count("protection?") == 1


def test_it_says_that_it_is_alive_on_the_way_down_too(channels: tuple[Channel, Channel]):
    ours, theirs = channels
    ours.send(command(0, 20.0))
    ours.send({"do": "beat"})
    limits = replace(LIMITS, shutdown_limit_s=2.5, ramp_V_per_s=1.0)
    Guard(ClockedSource(), limits, theirs, KeptJournal()).run()
    words = []
    while (message := ours.receive(0.0)) is not None:
        words.append(message["say"])
    # a ramp of 1 s lies between the reason and the switch
    assert words[words.index("tripped") : words.index("off")].count("alive") >= 3


def test_a_command_that_the_slew_holds_back_is_gone_on_with(channels: tuple[Channel, Channel]):
    limits = replace(LIMITS, slew_V_per_s=100.0, burst_s=0.05, heartbeat_s=0.4, settle_s=0.5)
    _, _, _, journal = run(channels, command(0, 12.0), limits=limits)
    applied = [(entry["voltage_V"], entry["whole"]) for entry in journal.entries if entry["kind"] == "applied"]
    assert applied[0] == (5.0, True)
    assert applied[-1] == (12.0, False)


def test_a_command_rests_on_its_frame(channels: tuple[Channel, Channel]):
    old = command(frame_s=time.perf_counter() - 6.0)
    _, said, source, _ = run(channels, old)
    assert said["end"]["code"] == "frame_age"
    assert source.whats().count("complaint?") == 0


def test_a_beat_before_the_first_command_does_not_start_the_clock(channels: tuple[Channel, Channel]):
    ours, _ = channels
    later = threading.Timer(0.5, lambda: ours.send(STOP))
    later.start()
    status, _, _, _ = run(channels, {"do": "beat"})
    later.join()
    assert status is Status.DONE
