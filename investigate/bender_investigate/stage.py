"""Plays on a bench, within a budget, each written down before and after; none is played twice.

A play has a folder of its own with `profile.csv`, which is there before the bench is touched. When an investigation is
taken up again, a play that came to its end is read back. One that was killed is recovered from its journals, and only
what it had not played yet is played, as a play of its own.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bender_hil.guard.start import OutputUnknownError
from bender_hil.runner.voltages import Voltages, read_profile_file
from bender_investigate.bench_port import BenchPort, Controller, Played
from bender_investigate.journal import DecisionJournal
from bender_investigate.safety import of_rows, rows_of
from bender_loop.control.references import Profile
from bender_loop.errors import RunError
from bender_loop.records.record import Record
from bender_loop.shell.files import prepare_directory, write_atomically

PROFILE = "profile.csv"
LEAST_S = 2.0
"""What is shorter is no record to learn from, and no rest of a profile worth playing."""
MISHAPS = ("camera_stalled", "heartbeat", "frame_age", "controller_gone", "guard_gone")
"""Trips of a machine that was too busy or that lost a process: they say nothing of the bench or of gains, and the rest
of a profile may be played another time."""
Tell = Callable[[str], None]


class Followed(NamedTuple):
    """What came of following set-points: the record, None where an earlier sitting was cut off; why it was ended."""

    record: Record | None
    trip: str | None


class TrippedError(RunError):
    """The guard ended a play; somebody has to look at the bench before it goes on."""


class BudgetSpentError(Exception):
    """The next play would go beyond the budget of bench time."""


@dataclass(slots=True)
class Stage:
    """The plays of one investigation.

    Attributes:
        bench: that plays.
        out: directory of the investigation.
        journal: of the decisions.
        budget_s: of bench time.
        tell: is told what happens.
        spent_s: of it so far.
        count: plays so far, which numbers their folders.
    """

    bench: BenchPort
    out: Path
    journal: DecisionJournal
    budget_s: float
    tell: Tell
    spent_s: float = 0.0
    count: int = 0
    _earlier: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        folders = [x for x in self.out.glob("[0-9][0-9]-*") if x.is_dir()]
        self._earlier = sorted(folders)

    @property
    def left_s(self) -> float:
        """What is left of the budget."""
        return self.budget_s - self.spent_s

    def play(self, name: str, voltages: Voltages, why: str) -> list[Record]:
        """Play a profile, or read back what an earlier sitting played of it; returns its records, one or two.

        Raises:
            BudgetSpentError: it would go beyond the budget.
            TrippedError: the guard ended it.
            KeyboardInterrupt: a person did; the output is off.
        """
        earlier = self._next_earlier(name)
        if earlier is not None:
            return self._taken_up(earlier, name, voltages)
        return [self._played(name, voltages, why)]

    def follow(self, name: str, reference: Profile, controller: Controller, duration_s: float, why: str) -> Followed:
        """Follow set-points, or read back that an earlier sitting did.

        Raises:
            BudgetSpentError: it would go beyond the budget.
            TrippedError: a mishap of the machine ended it, which is not held against the gains.
            KeyboardInterrupt: a person ended it.
            RunError: it left nothing.
        """
        earlier = self._next_earlier(name)
        if earlier is not None:
            return self._followed_earlier(earlier)
        self._afford(duration_s)
        folder = self._announce(name, why, duration_s)
        done = self._attended(folder, lambda: self.bench.follow(folder, reference, controller, duration_s))
        if done.trip is None or done.trip.startswith(MISHAPS):
            return Followed(self._noted(folder, done), None)
        self.spent_s += done.seconds
        facts = {"folder": folder.name, "seconds": done.seconds, "spent_s": self.spent_s}
        self.journal.write("tripped", done.trip, **facts)
        return Followed(done.record, done.trip)

    def _followed_earlier(self, folder: Path) -> Followed:
        kept = self.bench.recovered(folder)
        self._account(kept)
        trip = next((x for x in self._trips(folder) if not x.startswith(MISHAPS)), None)
        record = None if kept is None else kept.record
        return Followed(record if self._is_whole(folder) or trip else None, trip)

    def _played(self, name: str, voltages: Voltages, why: str) -> Record:
        self._afford(voltages.duration_s)
        folder = self._announce(name, why, voltages.duration_s, voltages)
        return self._noted(folder, self._attended(folder, lambda: self.bench.play(folder, voltages)))

    def _attended(self, folder: Path, play: Callable[[], Played]) -> Played:
        """Play; an output that could not be confirmed off is written down before it ends the sitting."""
        try:
            return play()
        except OutputUnknownError as error:
            self.journal.write("alarm", str(error), folder=folder.name)
            raise

    def _afford(self, duration_s: float) -> None:
        if duration_s > self.left_s:
            raise BudgetSpentError(
                f"the next play takes {duration_s:.0f} s, of the budget of {self.budget_s:g} s of bench time "
                f"{max(self.left_s, 0.0):.0f} s are left"
            )

    def _announce(self, name: str, why: str, duration_s: float, voltages: Voltages | None = None) -> Path:
        """Write down what is going to be played, on the disk, before the bench is touched."""
        self.count += 1
        folder = self.out / f"{self.count:02d}-{name}"
        prepare_directory(folder)
        if voltages is not None:
            pairs = zip(voltages.times_s, voltages.levels_V, strict=True)
            text = "time_s,voltage_V\n" + "".join(f"{t!r},{v!r}\n" for t, v in pairs)
            # the last level holds until the profile is over
            text += f"{voltages.duration_s!r},{voltages.levels_V[-1]!r}\n"
            write_atomically(folder / PROFILE, text)
        self.journal.write("play", why, folder=folder.name, duration_s=duration_s)
        self.tell(f"{folder.name}: {why} ({duration_s:.0f} s)")
        return folder

    def _noted(self, folder: Path, done: Played) -> Record:
        self.spent_s += done.seconds
        facts = {"folder": folder.name, "seconds": done.seconds, "spent_s": self.spent_s}
        if done.interrupted:
            self.journal.write("interrupted", "a person asked for the end; the output is off", **facts)
            raise KeyboardInterrupt
        if done.trip is not None:
            self.journal.write("tripped", done.trip, **facts)
            raise TrippedError(f"{folder.name}: the guard ended the run: {done.trip}; look at the bench")
        if done.record is None:
            raise TrippedError(f"{folder.name}: the run left no record; look at the bench")
        self.journal.write("played", done.line or "as planned", rows=len(done.record), **facts)
        return done.record

    def _next_earlier(self, name: str) -> Path | None:
        """Return the folder in which an earlier sitting has announced this very play, the next in the order."""
        if not self._earlier:
            return None
        folder = self._earlier[0]
        if re.sub(r"^\d+-", "", folder.name) != name:
            return None
        self._earlier.pop(0)
        self.count = int(folder.name.split("-", 1)[0])
        return folder

    def _trips(self, folder: Path) -> list[str]:
        return [str(x["why"]) for x in self.journal.all("tripped") if x.get("folder") == folder.name]

    def _is_whole(self, folder: Path) -> bool:
        return any(x.get("folder") == folder.name for x in self.journal.all("played"))

    def _account(self, kept: Played | None) -> None:
        self.spent_s += kept.seconds if kept is not None else 0.0

    def _taken_up(self, folder: Path, name: str, wanted: Voltages) -> list[Record]:
        kept = self.bench.recovered(folder)
        self._account(kept)
        voltages = _profile_of(folder) or wanted
        if kept is not None and kept.record is not None and self._is_whole(folder):
            self.tell(f"{folder.name}: run before the interruption")
            return [kept.record]
        reached_s = -1.0 if kept is None else kept.seconds
        records = [kept.record] if kept is not None and kept.record is not None and reached_s >= LEAST_S else []
        rest = _rest_of(voltages, reached_s, self.bench.allowed.rate_Hz, self.bench.allowed.change_V)
        is_over = any(not x.startswith(MISHAPS) for x in self._trips(folder))
        if rest is None or is_over:
            self.journal.write("recovered", "the runs before the interruption are enough", folder=folder.name)
            if not records:
                raise TrippedError(
                    f"{folder.name}: this run has ended and left no record; look at the bench, start anew"
                )
            return records
        following = self._next_earlier(f"{name}-rest")
        if following is not None:
            return [*records, *self._taken_up(following, f"{name}-rest", rest)]
        why = f"{folder.name} was interrupted after {max(reached_s, 0.0):.1f} s: only the rest is played"
        return [*records, self._played(f"{name}-rest", rest, why)]


def _profile_of(folder: Path) -> Voltages | None:
    path = folder / PROFILE
    if not path.exists():
        return None
    found = read_profile_file(str(path))
    if not isinstance(found, Voltages):
        return None
    # the last row only says when the profile is over
    return Voltages(found.times_s[:-1], found.levels_V[:-1], found.times_s[-1])


def _rest_of(voltages: Voltages, reached_s: float, rate_Hz: float, change_V: float) -> Voltages | None:
    """Return what a profile has not played yet, led there from 0 V; None where next to nothing is left."""
    times, levels = rows_of(voltages, rate_Hz)
    left = levels[times > reached_s]
    if left.size < LEAST_S * rate_Hz:
        return None
    steps = int(np.ceil(abs(float(left[0])) / change_V)) if change_V > 0.0 else 0
    lead = np.linspace(0.0, float(left[0]), steps + 2)[:-1]
    return of_rows(np.concatenate([lead, left]), rate_Hz)
