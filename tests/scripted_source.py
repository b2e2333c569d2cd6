"""A supply that is a script, and an exact clock, for tests of the guard's parts without a process."""

import time
from dataclasses import dataclass, field
from typing import Any

from bender_hil.log.journal import GuardJournal
from bender_hil.supply.failures import LinkLostError
from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import Patience
from bender_hil.supply.source import Bounds


@dataclass
class Clock:
    """Stands in for `time`: it moves when somebody sleeps, and a little with every look at it."""

    now_s: float = 1000.0
    look_s: float = 1e-6

    def perf_counter(self) -> float:
        self.now_s += self.look_s
        return self.now_s

    def sleep(self, time_s: float) -> None:
        self.now_s += max(0.0, time_s)


@dataclass
class ClockedSource:
    """Obeys at once, except where told otherwise; `log` has everything that reached it, with its time."""

    clock: Clock | None = None
    answer_s: float = 0.0
    broken_writes: int = 0
    refused_offs: int = 0
    confirm_errors: list[Exception] = field(default_factory=list)
    measure_errors: list[Exception] = field(default_factory=list)
    reconnect_errors: list[Exception] = field(default_factory=list)
    resync_errors: list[Exception] = field(default_factory=list)
    on_again: int = 0
    """So many times it goes on by itself after it has confirmed that it is off."""
    readings_V: list[float | None] = field(default_factory=list)
    """Taken one after the other, the last one for ever; without any, what it is set to."""
    wire_s: float = 0.0
    log: list[tuple[str, float, float]] = field(default_factory=list)
    level_V: float = 0.0
    current_A: float | None = 0.0
    setting_V: float | None = None
    on: bool = True
    is_closed: bool = False
    tripped: bool = False
    patience: Patience = field(default_factory=Patience)

    def now_s(self) -> float:
        return self.clock.perf_counter() if self.clock is not None else time.perf_counter()

    def _note(self, what: str, value: float = 0.0) -> float:
        now_s = self.now_s()
        self.log.append((what, value, now_s))
        return now_s

    def _ask(self, what: str) -> None:
        self._note(what)
        if self.is_closed:
            raise LinkLostError("the link is closed")
        if self.clock is not None:
            self.clock.sleep(self.answer_s)
        elif self.answer_s:
            time.sleep(self.answer_s)

    def whats(self) -> list[str]:
        return [what for what, _, _ in self.log]

    def open(self) -> Identity:
        self._note("open")
        return Identity("B&K", "9115", "EMU1", "V1")

    def arm(self, bounds: Bounds) -> list[str]:
        self._note("arm", bounds.maximum_V)
        self.on = True
        return []

    def set_voltage(self, voltage_V: float) -> float:
        sent_s = self.set_voltage_blind(voltage_V)
        self._ask("complaint?")
        return sent_s

    def set_voltage_blind(self, voltage_V: float) -> float:
        if self.broken_writes:
            self.broken_writes -= 1
            raise OSError("gone")
        self.level_V = voltage_V
        return self._note("volt", voltage_V) + self.wire_s

    def rounded(self, voltage_V: float) -> float:
        return round(voltage_V, 3)

    @property
    def setting_tolerance_V(self) -> float:
        return 2e-3

    def voltage_setting_V(self) -> float:
        self._ask("setting?")
        return self.level_V if self.setting_V is None else self.setting_V

    def measured_V(self) -> float | None:
        self._ask("volts?")
        if self.measure_errors:
            raise self.measure_errors.pop(0)
        if not self.readings_V:
            return self.level_V if self.on else 0.0
        return self.readings_V.pop(0) if len(self.readings_V) > 1 else self.readings_V[0]

    def measured_A(self) -> float | None:
        self._ask("amperes?")
        return self.current_A

    def is_on(self) -> bool:
        self._ask("switch?")
        return self.on

    def confirm_off(self) -> bool:
        self._ask("confirm?")
        if self.confirm_errors:
            raise self.confirm_errors.pop(0)
        is_off = not self.on
        if is_off and self.on_again:
            self.on_again -= 1
            self.on = True
        return is_off

    def has_tripped(self) -> bool:
        self._ask("protection?")
        return self.tripped

    def off_blind(self) -> None:
        self._note("off")
        if self.refused_offs:
            self.refused_offs -= 1
        else:
            self.on = False

    def reconnect(self) -> None:
        self._note("reconnect")
        self.is_closed = False
        if self.reconnect_errors:
            raise self.reconnect_errors.pop(0)

    def resync(self) -> None:
        self._note("resync")
        if self.resync_errors:
            raise self.resync_errors.pop(0)

    def release(self) -> None:
        self._note("release")

    def close(self) -> None:
        self._note("close")
        self.is_closed = True


class KeptJournal(GuardJournal):
    """Keeps its entries in memory."""

    def __init__(self) -> None:
        self.entries: list[dict[str, Any]] = []

    def write(self, kind: str, **facts: Any) -> None:
        self.entries.append({"kind": kind, **facts})

    def sync(self) -> None:
        pass

    def close(self) -> None:
        pass

    def kinds(self) -> list[str]:
        return [str(entry["kind"]) for entry in self.entries]

    def one(self, kind: str) -> dict[str, Any]:
        (entry,) = [entry for entry in self.entries if entry["kind"] == kind]
        return entry
