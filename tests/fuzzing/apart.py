"""Cases in a process of their own, so that a crash or a hang is a finding, not the end of the tests."""

import multiprocessing
from collections.abc import Callable
from typing import Any

SECONDS = 240.0


def complaints_of(cases: Callable[..., list[str]], *given: Any) -> list[str]:
    """Return what cases complain of, run with what is given; a crash or a hang is a complaint as well."""
    receiving, sending = multiprocessing.get_context("spawn").Pipe(duplex=False)
    process = multiprocessing.get_context("spawn").Process(target=_run, args=(sending, cases, given), daemon=True)
    process.start()
    sending.close()
    found: list[str] = []
    if receiving.poll(SECONDS):
        try:
            found = receiving.recv()
        except EOFError:
            found = []
        process.join(SECONDS)
    if process.is_alive():
        process.kill()
        process.join()
    return found if process.exitcode == 0 else [*found, f"{cases.__name__}: exit code {process.exitcode}"]


def _run(sending: Any, cases: Callable[..., list[str]], given: tuple[Any, ...]) -> None:
    sending.send(cases(*given))
    sending.close()
