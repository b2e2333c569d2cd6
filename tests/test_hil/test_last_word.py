"""After everything else, the status and the last line are those of the output, whatever failed meanwhile."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from bender_cli.main import main
from bender_hil import command
from bender_hil.guard.guard import Status
from bender_hil.guard.spares import Ended
from bender_hil.log import results as results_module
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import summarise
from bender_hil.runner import run as runner
from bender_loop.errors import InputError, RunError
from bender_loop.shell.last_word import UNKNOWN, Output, number_of_outputs, status_at_last

ALARM = f"{UNKNOWN} (37.00 V are still measured)"
STUCK = Ended(Status.UNCONFIRMED, "supply", "the link is lost", ALARM, {})
OFF = Ended(Status.TRIPPED, "supply", "the link is lost", "", {})
Run = Callable[..., int]


@pytest.fixture
def hil(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """`bender hil` with a run that ends as it is told to."""

    def start(ended: Ended, *, unwritten: tuple[str, ...] = (), fails: BaseException | None = None) -> int:
        def run(*_: object, **__: object) -> runner.RunResult:
            output = Output()
            output.alarm = ended.alarm
            if fails is not None:
                raise fails
            log = RunLog(tmp_path, {"emulated": True}, (), (), ())
            return runner.RunResult(tmp_path, ended, False, None, summarise(log), log, None, unwritten)

        monkeypatch.setattr(runner, "run", run)
        return main(["hil", "--out", str(tmp_path / "run")])

    return start


def _alarm_is_last(capfd: pytest.CaptureFixture[str]) -> bool:
    out, err = capfd.readouterr()
    assert "output is off" not in out + err
    return UNKNOWN in err.splitlines()[-1]


@pytest.mark.parametrize("unwritten", [(), ("record.csv: is a directory",)])
def test_an_alarm_is_the_last_word_whatever_could_not_be_written(
    hil: Run, capfd: pytest.CaptureFixture[str], unwritten: tuple[str, ...]
):
    assert hil(STUCK, unwritten=unwritten) == 3
    assert _alarm_is_last(capfd)


@pytest.mark.parametrize(
    "error", [MemoryError(), InputError("no"), RunError("no"), OSError(28, "full"), KeyboardInterrupt(), SystemExit(0)]
)
def test_no_failure_takes_the_alarm_back(hil: Run, capfd: pytest.CaptureFixture[str], error: BaseException):
    assert hil(STUCK, fails=error) == 3
    assert _alarm_is_last(capfd)


@pytest.mark.parametrize("error", [MemoryError(), ValueError("?"), OSError(5, "gone"), BrokenPipeError()])
@pytest.mark.parametrize("place", ["write_results", "page", "_show_results"])
def test_results_that_fail_do_not_take_the_alarm_back(
    hil: Run, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, error: BaseException, place: str
):
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(command if place == "_show_results" else results_module, place, fail)
    assert hil(STUCK) == 3
    assert _alarm_is_last(capfd)


def test_an_output_that_is_off_leaves_the_status_of_the_run(hil: Run, capfd: pytest.CaptureFixture[str]):
    assert hil(OFF) == 1
    assert UNKNOWN not in capfd.readouterr().err
    assert hil(OFF, fails=InputError("bad bench")) == 2
    assert hil(OFF._replace(status=Status.DONE, code=None, sentence=None)) == 0


def test_an_output_of_which_nobody_said_anything_is_not_off(capfd: pytest.CaptureFixture[str]):
    before = number_of_outputs()
    first, second = Output(), Output()
    first.confirm_off()
    assert status_at_last(0, before) == 3
    assert capfd.readouterr().err == f"bender: {UNKNOWN}\n"
    second.confirm_off()
    assert status_at_last(130, before) == 130
    assert capfd.readouterr().err == ""


def test_the_alarm_needs_no_stream_of_python(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    before = number_of_outputs()
    output = Output()
    monkeypatch.setattr(sys, "stderr", None)
    assert status_at_last(0, before) == 3
    assert UNKNOWN in capfd.readouterr().err
    output.confirm_off()


@pytest.mark.skipif(os.name == "nt", reason="descriptors of POSIX")
@pytest.mark.parametrize("closed", [(0,), (1,), (2,), (0, 1, 2)])
def test_the_status_stands_with_closed_descriptors_and_at_the_end_of_the_interpreter(closed: tuple[int, ...]):
    code = """
import atexit, os, sys
from bender_cli import main as cli
from bender_loop.shell.last_word import Output
def add_arguments(parser): pass
def run(arguments):
    Output()
    sys.stdout.write("x")
    return 0
HELP = EXAMPLE = ""
sys.modules["failing"] = sys.modules["__main__"]
cli.COMMANDS = {"fail": "failing"}
atexit.register(os._exit, 0)
sys.argv[1:] = ["fail"]
from bender_cli.start import entry
entry()
"""

    def close() -> None:
        for number in closed:
            os.close(number)

    done = subprocess.run([sys.executable, "-P", "-c", code], preexec_fn=close, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 3
    assert (UNKNOWN in done.stderr.decode()) == (2 not in closed)


@pytest.mark.parametrize("error", [SystemExit(), SystemExit(0), GeneratorExit(), MemoryError(), ValueError("?")])
def test_a_loop_that_is_left_by_any_way_is_a_run_that_failed(error: BaseException):
    told: list[str] = []

    class Loop:
        def run(self, zeroed_s: float) -> None:
            raise error

    guard = SimpleNamespace(ready={}, trip=lambda code, _: told.append(code), wait=lambda: OFF)
    eyes = SimpleNamespace(zero=lambda _: 0.0, noise_um=0.0)
    journal = SimpleNamespace(write=lambda *_, **__: None)
    with pytest.raises(RunError, match=f"a fault in the controller: {type(error).__name__}"):
        runner._looped(Loop(), eyes, guard, journal, 3, None)  # pyright: ignore[reportArgumentType]
    assert told == ["controller_failed"]


def test_an_interrupt_of_the_loop_stays_one():
    def interrupt(_: int) -> float:
        raise KeyboardInterrupt

    guard = SimpleNamespace(ready={}, trip=lambda *_: None, wait=lambda: OFF)
    nothing = SimpleNamespace(write=lambda *_, **__: None)
    with pytest.raises(KeyboardInterrupt):
        runner._looped(nothing, SimpleNamespace(zero=interrupt), guard, nothing, 3, None)  # pyright: ignore[reportArgumentType]
