"""The way down and the guard's course with a supply that is a script: what is sent, in which order, how often."""

import os
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from bender_hil.guard.descent import descend
from bender_hil.guard.guard import Guard, Status
from bender_hil.guard.settings import GuardSettings
from bender_hil.log.journal import GuardJournal, read_journal
from bender_hil.supply.failures import LinkLostError, NoReplyError
from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import Patience
from bender_hil.supply.source import Bounds
from bender_loop.shell.messages import Channel, Listener, call

LIMITS = GuardSettings(shutdown_limit_s=0.3, discharge_limit_s=0.3, heartbeat_s=5.0, frame_age_s=5.0)


@dataclass
class ScriptedSource:
    """Obeys, except where told otherwise; `log` has every call that reached the supply."""

    broken_writes: int = 0
    refused_offs: int = 0
    late_answers: int = 0
    leftover_V: float = 0.0
    measures: bool = True
    log: list[tuple[str, float]] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)
    level_V: float = 0.0
    on: bool = False
    reopened: int = 0
    patience: Patience = field(default_factory=Patience)

    def open(self) -> Identity:
        return Identity("B&K", "9115", "EMU1", "V1")

    def arm(self, bounds: Bounds) -> list[str]:
        self.on = True
        return []

    def set_voltage(self, voltage_V: float) -> float:
        self.set_voltage_blind(voltage_V)
        return time.perf_counter()

    def set_voltage_blind(self, voltage_V: float) -> float:
        if self.broken_writes:
            self.broken_writes -= 1
            raise LinkLostError("gone")
        self.level_V = voltage_V
        self.log.append(("volt", voltage_V))
        self.times_s.append(time.perf_counter())
        return self.times_s[-1]

    def rounded(self, voltage_V: float) -> float:
        return round(voltage_V, 3)

    @property
    def setting_tolerance_V(self) -> float:
        return 2e-3

    def voltage_setting_V(self) -> float:
        return self.level_V

    def measured_V(self) -> float | None:
        if not self.measures:
            return None
        return self.level_V if self.on else self.leftover_V

    def measured_A(self) -> float | None:
        return 0.0 if self.measures else None

    def is_on(self) -> bool:
        return self.on

    def confirm_off(self) -> bool:
        if self.late_answers:
            self.late_answers -= 1
            raise NoReplyError("late")
        return not self.on

    def has_tripped(self) -> bool:
        return False

    def off_blind(self) -> None:
        self.log.append(("off", 0.0))
        if self.refused_offs:
            self.refused_offs -= 1
        else:
            self.on = False

    def reconnect(self) -> None:
        self.reopened += 1

    def resync(self) -> None:
        pass

    def release(self) -> None:
        self.log.append(("release", 0.0))

    def close(self) -> None:
        pass


def _descend(tmp_path: Path, source: ScriptedSource, from_V: float = 20.0):
    source.on = True
    journal = GuardJournal(tmp_path / "guard.jsonl")
    try:
        return descend(source, LIMITS, from_V, journal)
    finally:
        journal.close()


@pytest.mark.parametrize("from_V", [0.0, 0.5, 20.0, 50.0, -10.0])
def test_the_ramp_goes_straight_to_zero_and_then_off(tmp_path: Path, from_V: float):
    source = ScriptedSource()
    landing = _descend(tmp_path, source, from_V)
    assert landing.confirmed
    levels = [abs(volts) for what, volts in source.log if what == "volt"]
    assert levels == sorted(levels, reverse=True)
    assert levels[-1] == 0.0
    assert source.log[-1][0] == "off"
    for at_s, level_V in zip(source.times_s, levels, strict=True):
        # never below what the rate allows, counted from two steps before the first
        assert level_V >= abs(from_V) - LIMITS.ramp_V_per_s * (at_s - source.times_s[0] + 0.01) - 1e-6


def test_a_broken_link_is_opened_anew_and_the_output_goes_off(tmp_path: Path):
    source = ScriptedSource(broken_writes=1)
    assert _descend(tmp_path, source).confirmed
    assert source.reopened == 1
    # the switch comes first, and once more after the supply was called to remote again
    assert source.log == [("off", 0.0), ("volt", 0.0), ("off", 0.0)]


def test_what_is_refused_or_late_is_tried_again(tmp_path: Path):
    source = ScriptedSource(refused_offs=3, late_answers=1)
    assert _descend(tmp_path, source).confirmed
    assert [what for what, _ in source.log].count("off") >= 3
    kinds = [entry["kind"] for entry in read_journal(tmp_path / "guard.jsonl")]
    assert kinds.count("not_confirmed") == 2


def test_it_is_bounded_in_time_and_then_says_so(tmp_path: Path):
    start_s = time.perf_counter()
    landing = _descend(tmp_path, ScriptedSource(refused_offs=10**9))
    assert not landing.confirmed
    assert "still on" in landing.sentence
    assert time.perf_counter() - start_s < 5.0


def test_an_output_that_is_off_and_still_live_is_not_confirmed(tmp_path: Path):
    landing = _descend(tmp_path, ScriptedSource(leftover_V=30.0))
    assert not landing.confirmed
    assert landing.sentence == "the output is off, but 30.00 V are still measured"


def test_what_cannot_measure_is_believed_when_it_says_off(tmp_path: Path):
    landing = _descend(tmp_path, ScriptedSource(measures=False))
    assert (landing.confirmed, landing.harmless_s) == (True, None)


def test_a_full_disk_ends_the_run_and_the_output_still_goes_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    listener = Listener()
    theirs = call(listener.port, listener.password)
    ours = listener.accept(5.0)
    listener.close()
    source = ScriptedSource()
    journal = GuardJournal(tmp_path / "guard.jsonl")
    guard = Guard(source, LIMITS, theirs, journal)
    statuses: list[Status] = []
    thread = threading.Thread(target=lambda: statuses.append(guard.run()))
    write = os.write

    def full(file: int, data: bytes) -> int:
        if file == journal._file:
            raise OSError(28, "No space left on device")
        return write(file, data)

    with theirs, ours as channel:
        thread.start()
        _until(channel, "ready")
        channel.send({"do": "command", "sequence": 0, "voltage_V": 10.0, "frame_s": time.perf_counter(), "tip_um": 0.0})
        monkeypatch.setattr(os, "write", full)
        channel.send({"do": "command", "sequence": 1, "voltage_V": 10.0, "frame_s": time.perf_counter(), "tip_um": 0.0})
        end = _until(channel, "end")
        thread.join(5.0)
    journal.close()
    assert statuses == [Status.TRIPPED]
    assert (end["code"], end["confirmed"]) == ("journal", True)
    assert not source.on
    assert source.log[-1][0] == "release"


def _until(channel: Channel, what: str) -> dict[str, object]:
    for _ in range(100):
        message = channel.receive(5.0)
        assert message is not None
        if message["say"] == what:
            return message
    raise AssertionError(what)
