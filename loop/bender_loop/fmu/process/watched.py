"""An FMU that is not ours, in a process of its own that is watched: it may crash, hang or eat memory there."""

import contextlib
import multiprocessing
import os
import pickle
import shutil
import signal
import sys
import tempfile
import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from bender_loop.control.pid import Gains
from bender_loop.errors import RunError
from bender_loop.fmu.check.explanations import explained_failure
from bender_loop.fmu.check.findings import one_line
from bender_loop.fmu.file import is_of_this_project, read_description
from bender_loop.fmu.followed_model import FollowedModel, Loop
from bender_loop.fmu.follower import Follower
from bender_loop.fmu.ports import Port
from bender_loop.fmu.process.worker import (
    SAID,
    STEPS,
    STOP,
    Counted,
    CountedController,
    CountedFollower,
    CountedPlant,
    StoppedError,
    Task,
    mapped_board,
    serve,
)
from bender_loop.records.further import Array, Further
from bender_loop.shell.closed_at_exit import ClosedAtExit
from bender_loop.tables.quantities import USUAL, Quantities

NATIVE_CODE = "an FMU is native code: it runs with your rights, so use only those whose origin you trust"
PATIENCE_S = 60.0
"""A step, or the start, that takes longer hangs."""
GRACE_S = 2.0
"""After an interrupt, a step may take this long to end."""
_LOOK_S = 0.1
_ENDING_S = 5.0
_SHOWN = 200


class WatchedFmu(ClosedAtExit):
    """An FMU in another process, which is asked, and lost when it crashes or hangs.

    Once the process is lost, every further call raises what it was lost by.

    Args:
        path: the FMU file.
        make: what the FMU becomes in its process.
        options: of that.
        interrupted: whether the user wants an end; asked while the FMU runs, which then stops after its step, or is
            ended after `GRACE_S`.
        tell: is told how many steps are done, several times a second, while the FMU runs.
        patience_s: a step that takes longer hangs; a start may take `PATIENCE_S` at least.

    Raises:
        InputError: the FMU will not do.
        RunError: the FMU fails to start, crashes or hangs.
    """

    def __init__(
        self,
        path: Path | str,
        make: Callable[[Task, memoryview], Counted],
        options: dict[str, Any],
        interrupted: Callable[[], bool] = lambda: False,
        tell: Callable[[int], None] = lambda _: None,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self.path = Path(path)
        self._interrupted, self._tell, self._patience_s = interrupted, tell, patience_s
        read_description(self.path)
        self._folder = Path(tempfile.mkdtemp(prefix="bender-fmu-"))
        self._remove_folder = weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self._board = mapped_board(self._folder / "board")
        self._lost: str | None = None
        self._idle = False
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        task = Task(self.path, make, options, self._folder, os.getpid())
        self._process = context.Process(target=serve, args=(theirs, task), daemon=True)
        try:
            with _signals_held_back(), _children_allowed(), _main_left_alone():
                self._process.start()
            theirs.close()
            self._answer("loading and initialising", max(patience_s, PATIENCE_S))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the process and remove its files; a second call does nothing."""
        self._lost = self._lost or f"{self.path}: the FMU is closed; open it again"
        self._connection.close()
        if self._process.pid is not None:
            if self._idle:
                self._process.join(_ENDING_S)
            self._end_process()
        self._remove_folder()

    def _ask(
        self, function: Callable[..., Any] | str, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        if self._lost is not None:
            raise RunError(self._lost)
        self._board[STOP] = 0
        self._idle = False
        try:
            self._connection.send((function, args, kwargs or {}))
        except OSError:
            raise self._fallen("between two calls") from None
        return self._answer(f"the step after {self._board[STEPS]}" if function == "step" else "a run")

    def _answer(self, doing: str, patience_s: float | None = None) -> Any:
        self._wait(doing, self._patience_s if patience_s is None else patience_s)
        try:
            sound, found = self._connection.recv()
        except (EOFError, OSError, pickle.UnpicklingError, ValueError, TypeError):
            raise self._fallen(doing) from None
        self._idle = True
        if sound:
            return found
        if isinstance(found, StoppedError):
            raise RunError(f"{self.path}: stopped on request")
        raise found

    def _wait(self, doing: str, patience_s: float) -> None:
        """Wait for an answer; with an eye on the steps that are done and on what the user wants."""
        steps, since, asked = self._board[STEPS], time.monotonic(), None
        while not self._connection.poll(_LOOK_S):
            now = time.monotonic()
            if self._board[STEPS] != steps:
                steps, since = self._board[STEPS], now
                self._tell(steps)
            if asked is None and self._interrupted():
                self._board[STOP], asked = 1, now
            if asked is not None and now - asked > GRACE_S:
                raise self._given_up(f"{doing}: no end within {GRACE_S:g} s after the interrupt")
            if now - since > patience_s:
                raise self._given_up(f"{doing}: no end within {patience_s:g} s, after {steps} steps")

    def _given_up(self, what: str) -> RunError:
        self._end_process()
        self._lost = f"{self.path}: {what}; the FMU hangs, or is very slow; ask the maker of the FMU"
        return RunError(self._lost)

    def _fallen(self, doing: str) -> RunError:
        self._process.join(_ENDING_S)
        self._end_process()
        code = self._process.exitcode or 0
        how = _signal_name(-code) if code < 0 else f"exit status {code}"
        last = self._last_words()
        what = f"{doing}: the process that ran the FMU broke off with {how} after {self._board[STEPS]} steps" + (
            f" ({last})" if last else ""
        )
        found = explained_failure(what, "the FMU takes its host along", "ask the maker of the FMU")
        self._lost = f"{self.path}: {found.what}; {found.why}; {found.remedy}"
        return RunError(self._lost)

    def _last_words(self) -> str:
        with contextlib.suppress(OSError):
            with (self._folder / SAID).open("rb") as file:
                file.seek(-min(file.seek(0, os.SEEK_END), 4096), os.SEEK_END)
                text = file.read().decode("utf-8", "replace").strip()
            return one_line(text.rpartition("\n")[2])[:_SHOWN] if text else ""
        return ""

    def _end_process(self) -> None:
        if self._process.is_alive():
            self._process.kill()
        self._process.join(_ENDING_S)


class WatchedPlant(WatchedFmu):
    """`FmuPlant` with the FMU in another process; the same results, bit for bit.

    A step there and back takes longer than one in this process, so whole runs are done there (see `at_the_plant`).

    Args:
        path: the FMU file.
        input_name: as in `FmuPlant`, like the other options.
        output_name: as in `FmuPlant`.
        interrupted: as in `WatchedFmu`, like `tell` and `patience_s`.
        quantities: as in `FmuPlant`.

    Attributes:
        path: the FMU file.
        input: the variable that takes the voltage.
        output: the variable that is read.

    Raises:
        InputError: as `FmuPlant` raises it.
        RunError: the FMU fails to start, crashes or hangs.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        input_name: str | None = None,
        output_name: str | None = None,
        interrupted: Callable[[], bool] = lambda: False,
        tell: Callable[[int], None] = lambda _: None,
        patience_s: float = PATIENCE_S,
        quantities: Quantities = USUAL,
    ) -> None:
        options = {"input_name": input_name, "output_name": output_name, "quantities": quantities}
        super().__init__(path, CountedPlant, options, interrupted, tell, patience_s)
        ports: tuple[Port, Port] = self._ask("ports")
        self.input, self.output = ports

    def set_parameters(self, parameters: Mapping[str, float], /) -> None:
        """Set parameters from the next reset on; raises what `FmuPlant.set_parameters` raises."""
        self._ask("set_parameters", (dict(parameters),))

    def with_parameters(self, parameters: Mapping[str, float]) -> Self:
        """Return this plant with parameters set; where it refuses them, its process is ended first."""
        try:
            if parameters:
                self.set_parameters(parameters)
                self.reset()
        except BaseException:
            self.close()
            raise
        return self

    def follow(self, time_s: Array, further: Sequence[Further]) -> None:
        """Let further inputs follow a record; raises what `FmuPlant.follow` raises."""
        self._ask("follow", (time_s, tuple(further)))

    def begin_at(self, time_s: float) -> None:
        """Set the time of the record at which the next reset begins."""
        self._ask("begin_at", (time_s,))

    def reset(self) -> None:
        """Back to rest; raises what `FmuPlant.reset` raises."""
        self._ask("reset")

    def read(self) -> float:
        """The displacement in um now."""
        return self._ask("read")

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance by `step_s`; returns displacement_um and raises what `FmuPlant.step` raises."""
        return self._ask("step", (voltage_V, step_s))

    def run_there(self, function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        """Return `function(plant, *args, **kwargs)`, run in the FMU's process.

        Raises:
            RunError: the FMU failed, crashed, hung or was stopped.
            Exception: InputError and ValueError as the function raises them.
        """
        return self._ask(function, args, kwargs)


class WatchedController(WatchedFmu):
    """`FmuController` with the FMU in another process; the same commands, bit for bit.

    Args:
        path: the FMU file.
        period_s: as in `FmuController`.
        patience_s: a step that takes longer hangs.

    Raises:
        InputError: as `FmuController` raises it.
        RunError: the FMU fails to start, crashes or hangs.
    """

    def __init__(self, path: Path | str, period_s: float, *, patience_s: float = PATIENCE_S) -> None:
        super().__init__(path, CountedController, {"period_s": period_s}, patience_s=patience_s)

    def step(self, setpoint_um: float, measurement_um: float, dt_s: float) -> float:
        """Take one sample; returns the command in V and raises what `FmuController.step` raises."""
        return self._ask("step", (setpoint_um, measurement_um, dt_s))


class WatchedFollower(WatchedFmu):
    """`Follower` with both models in another process; the same commands, bit for bit.

    Args:
        path: as in `Follower`, like the next three.
        model: what is followed.
        gains: of the PID block.
        loop: in which the controller runs.
        patience_s: a step that takes longer hangs.

    Raises:
        InputError: as `Follower` raises it.
        RunError: the FMU fails to start, crashes or hangs.
    """

    def __init__(
        self, path: Path, model: FollowedModel, gains: Gains, loop: Loop, *, patience_s: float = PATIENCE_S
    ) -> None:
        options = {"model": model, "gains": gains, "loop": loop}
        super().__init__(path, CountedFollower, options, patience_s=patience_s)

    def rest(self) -> None:
        """Forget all samples; raises what `Follower` raises."""
        self._ask("rest")

    def step(self, aim_um: float, measured_um: float | None, dt_s: float, acted_s: float | None = None) -> float:
        """Take one sample; returns the command in V and raises what `Follower.step` raises."""
        return self._ask("step", (aim_um, measured_um, dt_s, acted_s))

    def predicted_um(self) -> float:
        """Return the newest frame that the model predicts."""
        return self._ask("predicted_um")


def opened_follower(
    path: Path, model: FollowedModel, gains: Gains, loop: Loop, *, patience_s: float = PATIENCE_S
) -> Follower | WatchedFollower:
    """Open a controller: in this process, whose priority it then has, or in one of its own around anybody else's FMU.

    Args:
        path: as in `Follower`, like the next three.
        model: what is followed.
        gains: of the PID block.
        loop: in which the controller runs.
        patience_s: a step of anybody else's FMU that takes longer hangs.

    Raises:
        InputError: as `Follower` raises it.
        RunError: the FMU fails to start, crashes or hangs.
    """
    read_description(path)
    if is_of_this_project(path):
        return Follower(path, model, gains, loop)
    return WatchedFollower(path, model, gains, loop, patience_s=patience_s)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


@contextlib.contextmanager
def _children_allowed() -> Iterator[None]:
    """Daemonic processes, such as the workers of a pool, may have no children, lest these outlive them: ours do not."""
    settings: dict[str, Any] = vars(multiprocessing.current_process()).get("_config", {})
    before = settings.pop("daemon", None)
    try:
        yield
    finally:
        if before is not None:
            settings["daemon"] = before


@contextlib.contextmanager
def _main_left_alone() -> Iterator[None]:
    """A spawned process runs the main script of its parent once more, which a script must be written for.

    Nothing that our process does stands in that script.
    """
    main = vars(sys.modules["__main__"])
    names = ("__spec__", "__file__")
    kept = {name: main[name] for name in names if name in main}
    main.update(__spec__=None)
    main.pop("__file__", None)
    try:
        yield
    finally:
        main.update(kept)


@contextlib.contextmanager
def _signals_held_back() -> Iterator[None]:
    """A process that is just being started must not die of an interrupt at the keyboard."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    held = {number for name in ("SIGINT", "SIGHUP", "SIGTERM") if (number := getattr(signal, name, None)) is not None}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, held)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
