"""An interrupt waits for the compiled code, and is not lost."""

import signal
import sys
import threading

import pytest

from bender_compiled.interrupts import defer_signals, signals_as_interrupt

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself an interrupt there")


@pytest.fixture(autouse=True)
def _default_handler():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("failure", [None, ArithmeticError])
def test_an_interrupt_acts_after_the_block_also_when_it_fails(failure):
    reached = []

    def work():
        with defer_signals():
            signal.raise_signal(signal.SIGINT)
            reached.append("the end of the block")
            if failure:
                raise failure

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_leave_signals_alone():
    seen = []

    def work():
        with defer_signals():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_a_termination_ends_the_block_like_an_interrupt_and_waits_like_one():
    before = signal.getsignal(signal.SIGTERM)
    reached = []

    def work():
        with signals_as_interrupt(), defer_signals():
            signal.raise_signal(signal.SIGTERM)
            reached.append("the end of the block")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached
    assert signal.getsignal(signal.SIGTERM) == before


def test_a_termination_that_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with signals_as_interrupt(), defer_signals():
            signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)
