"""A bench file as an investigation needs it: every play is a run of its own, through the guard, with its own log."""

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bender_hil.bench_file import BenchFile
from bender_hil.guard.guard import Status
from bender_hil.guard.start import OutputUnknownError
from bender_hil.live.session import LiveSession
from bender_hil.log.ending import EndOfRun
from bender_hil.log.read_run import RUN, RunLog, read_run
from bender_hil.log.results import RECORD, recover, write_results
from bender_hil.runner.following_program import following
from bender_hil.runner.interrupts import Interrupted, Interrupts
from bender_hil.runner.program import ClosedLoop, OpenLoop, Program
from bender_hil.runner.run import run
from bender_hil.runner.run_lock import sole_run_with_note
from bender_hil.runner.voltages import Voltages
from bender_investigate.bench_port import Controller, Played
from bender_investigate.safety import SLEW_SHARE, Allowed
from bender_loop.control.pid import Limits
from bender_loop.control.references import Profile
from bender_loop.errors import InputError
from bender_loop.records.record import read_record


class RealBench:
    """A bench, emulated or not, in real time.

    Args:
        bench: its file.
        fmu: makes the FMU of a model, for the emulated one.
        page: on which the plays are watched, and from which they are stopped; None for none.
    """

    def __init__(self, bench: BenchFile, fmu: Callable[[str], Path], page: LiveSession | None = None) -> None:
        self._bench, self._fmu, self._page = bench, fmu, page
        self._told = False
        guard = bench.guard
        self._allowed = Allowed(
            guard.minimum_V,
            guard.maximum_V,
            guard.slew_V_per_s,
            guard.burst_s,
            (guard.travel_um[0], guard.travel_um[1]),
            bench.rate_Hz,
        )

    @property
    def allowed(self) -> Allowed:
        """The limits, and the rate of the camera."""
        return self._allowed

    @property
    def loop_travel_um(self) -> tuple[float, float]:
        """Where a closed loop is ended: the guard's travel."""
        return self._allowed.travel_um

    def facts(self) -> dict[str, Any]:
        """Return what makes this bench another one, for the journal."""
        path = self._bench.path
        content = b"" if path is None else path.read_bytes()
        return {"bench": "emulated" if path is None else path.name, "sha256": hashlib.sha256(content).hexdigest()}

    def play(self, folder: Path, voltages: Voltages) -> Played:
        """Play a profile; the run's files go into the folder."""
        return self._run(folder, OpenLoop(voltages))

    def follow(self, folder: Path, reference: Profile, controller: Controller, duration_s: float) -> Played:
        """Follow set-points with the PID block, alone or with its model, within the guard's limits."""
        guard = self._bench.guard
        limits = Limits(guard.minimum_V, guard.maximum_V)
        alone = ClosedLoop(reference, controller.gains, limits, SLEW_SHARE * guard.slew_V_per_s, duration_s)
        if controller.model is None or controller.fmu is None:
            return self._run(folder, alone)
        with following(alone, controller.model, controller.fmu, self._allowed.rate_Hz, preview=False) as program:
            return self._run(folder, program)

    def recovered(self, folder: Path) -> Played | None:
        """Return what a run that was killed left in its folder; None where nothing of it reached the bench.

        Raises:
            InputError: its journals are damaged, so that nobody can say what was played.
        """
        if not (folder / RUN).exists() or b"\n" not in (folder / RUN).read_bytes():
            return None
        reached_s = _reached_s(read_run(folder), 1.0 / self._allowed.rate_Hz)
        if reached_s is None:
            return None
        if not (folder / RECORD).exists():
            try:
                recover(folder)
            except InputError:
                return Played(None, reached_s)
        return Played(read_record(folder / RECORD), reached_s)

    def _tell_once(self, sentence: str) -> None:
        """Say at the first play that another run is going on; the last line of every play counts its late ticks."""
        if not self._told:
            sys.stderr.write(f"bender: {sentence}\n")
        self._told = True

    def _run(self, folder: Path, program: Program) -> Played:
        page = self._page
        if page is not None and page.stop_asked:
            return Played(None, 0.0, interrupted=True)
        with Interrupts() as interrupts:
            try:
                with sole_run_with_note(self._bench.address, folder, self._tell_once):
                    result = run(
                        self._bench,
                        program,
                        folder,
                        fmu=self._fmu,
                        witness=None if page is None else page.see,
                        interrupts=interrupts,
                        stop=page,
                    )
            except Interrupted:
                return Played(None, 0.0, interrupted=True)
        ended = result.ended
        end = EndOfRun(ended.code, ended.sentence, ended.alarm, result.signal)
        results = write_results(result.directory, result.log, result.record, end)
        if ended.status is Status.UNCONFIRMED:
            raise OutputUnknownError(ended.alarm)
        record = None if result.record is None else read_record(result.record)
        ticks = result.log.ticks
        seconds = float(ticks[-1]["time_s"]) if ticks else 0.0
        by_hand = result.interrupted or ended.code == "stop"
        trip = None if ended.code is None or by_hand else f"{ended.code}: {ended.sentence}"
        return Played(record, seconds, trip, by_hand, results.line)


def _reached_s(log: RunLog, period_s: float) -> float | None:
    """Return how far a run may have gone: to the last command that was sent, or that the guard took.

    A process that is killed between an act and its journal leaves the act in the other one's journal, or in none: what
    was sent counts as played, and a command that the guard has taken and the controller not noted counts as well.
    """
    taken = log.by_sequence("applied")
    last = int(log.ticks[-1]["sequence"]) if log.ticks else -1
    newest = max(last, *taken, -1) if taken else last
    if newest < 0:
        return None
    last_s = float(log.ticks[-1]["time_s"]) if log.ticks else -period_s
    return last_s + (newest - last) * period_s
