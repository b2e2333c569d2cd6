"""Signals that wait for a gap between two calls of the plant."""

import signal
import threading
from collections.abc import Mapping

import pytest

from bender_tuner.task.interrupts import DeferredInterrupts, GuardedPlant


class Counter:
    """A plant that sends itself the signal in its third step, and notes whether that step was finished."""

    def __init__(self, number: signal.Signals) -> None:
        self.number, self.begun, self.finished = number, 0, 0

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        pass

    def reset(self) -> None:
        pass

    def step(self, voltage_V: float, step_s: float) -> float:
        self.begun += 1
        if self.begun == 3:
            signal.raise_signal(self.number)
        self.finished += 1
        return voltage_V

    def read(self) -> float:
        return 0.0

    def close(self) -> None:
        pass


def guarded_steps(inner: Counter) -> None:
    with DeferredInterrupts() as interrupts:
        plant = GuardedPlant(inner, interrupts)
        for _ in range(10):
            plant.step(1.0, 0.01)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_inside_a_step_is_raised_before_the_next(number: signal.Signals) -> None:
    before = [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)]
    inner = Counter(number)
    with pytest.raises(KeyboardInterrupt):
        guarded_steps(inner)
    assert (inner.begun, inner.finished) == (3, 3)
    assert [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)] == before


def test_parameters_and_reset_look_for_signals_too() -> None:
    with DeferredInterrupts() as interrupts:
        plant = GuardedPlant(Counter(signal.SIGINT), interrupts)
        for call in (plant.reset, lambda: plant.set_parameters({})):
            signal.raise_signal(signal.SIGINT)
            with pytest.raises(KeyboardInterrupt):
                call()
        assert plant.step(2.0, 0.01) == 2.0


def test_a_second_signal_acts_at_once() -> None:
    with DeferredInterrupts() as interrupts:
        signal.raise_signal(signal.SIGINT)
        assert interrupts.pending
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        interrupts.pending = False


def test_a_signal_is_not_lost_at_the_end() -> None:
    with pytest.raises(KeyboardInterrupt), DeferredInterrupts():
        signal.raise_signal(signal.SIGINT)


def test_another_error_is_not_hidden_by_a_signal() -> None:
    def interrupted_failure() -> None:
        with DeferredInterrupts():
            signal.raise_signal(signal.SIGINT)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        interrupted_failure()


def test_what_is_ignored_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with DeferredInterrupts() as interrupts:
            signal.raise_signal(signal.SIGINT)
            assert not interrupts.pending
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_change_nothing() -> None:
    before, seen = signal.getsignal(signal.SIGINT), []

    def work() -> None:
        with DeferredInterrupts():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [before]
