"""What a search has fitted so far, kept so that an interrupted diagnosis goes on where it was.

Fits and scans depend on nothing but what they are given, so a search that is told their results again comes to the same
place without doing them: bit by bit, since numbers are kept whole.
"""

import contextlib
import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bender_effects.form import Form
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.records.observations import Observations
from bender_loop.errors import InputError
from bender_loop.shell.bounded import read_bounded
from bender_loop.shell.run import version

UNFINISHED = "unfinished.json"
"""Beside the partial result of an interrupted diagnosis."""
_MOST_BYTES = 1 << 28


@dataclass(slots=True)
class Journal:
    """Results of fits and scans by what they were given, and the work done before every step of the search.

    Attributes:
        entries: the results, as JSON has them.
        work: sub-steps before every step of this search.
        earlier_work: the same of the search that goes on.
        reused: how many results were told again.
    """

    entries: dict[str, Any] = field(default_factory=dict)
    work: list[int] = field(default_factory=list)
    earlier_work: list[int] = field(default_factory=list)
    reused: int = 0
    _counted: int = 0
    _begun: int = 0
    _digests: dict[int, tuple[tuple[Observations, ...], str]] = field(default_factory=dict)

    def key(self, problem: FitProblem, hypothesis: Hypothesis, *given: object) -> str:
        """Return what stands for a fit or scan of a hypothesis on a problem."""
        parts = [_part(x.form, x.values) for x in hypothesis.parts]
        beside = [None if x is None else _part(x.form, x.values) for x in (hypothesis.own, hypothesis.equation)]
        structure = None if hypothesis.structure is None else hypothesis.structure.to_table()
        words = [
            self._digest(problem),
            parts,
            beside,
            structure,
            [_part(x, ()) if isinstance(x, Form) else x for x in given],
        ]
        return hashlib.sha256(json.dumps(words).encode()).hexdigest()[:32]

    def recall(self, key: str) -> Any:
        """Return the result of a key, None where there is none."""
        found = self.entries.get(key)
        self.reused += found is not None
        return found

    def begin_search(self) -> None:
        """Count the work of another search from nought."""
        self._begun = len(self.work)

    def work_so_far(self, substeps: int) -> int:
        """Return the work done before a step, counting that of the search that goes on."""
        step = len(self.work)
        before = self.work[-1] - self._counted if step > self._begun else 0
        self.work.append(self.earlier_work[step] if step < len(self.earlier_work) else substeps + before)
        self._counted = substeps
        return self.work[-1]

    def _digest(self, problem: FitProblem) -> str:
        seen = problem.observations
        known = self._digests.get(id(seen))
        if known is None:
            # the observations are held, so that no other ones get their place; simulators would be large
            known = self._digests[id(seen)] = seen, _digest_of(seen)
        base = json.dumps(problem.base.to_table(), sort_keys=True)
        return hashlib.sha256(f"{known[1]} {base}".encode()).hexdigest()

    def to_json(self) -> str:
        """Return the content of the file that a later diagnosis goes on from."""
        return json.dumps({"version": version(), "work": self.work, "entries": self.entries}) + "\n"


def _digest_of(observations: Sequence[Observations]) -> str:
    found = hashlib.sha256()
    for x in observations:
        drive = x.drive
        found.update(repr((x.half_step_um, x.start, drive.linear, drive.smooth, drive.exposure_s)).encode())
        of_drive = (drive.row_time_s, drive.command_time_s, drive.voltage_V)
        for array in (*of_drive, x.measured_um, x.usable, x.held_out, x.reported):
            found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()


def _part(form: Form, values: Sequence[float]) -> list[object]:
    free = [[x.name, x.low, x.high, list(x.starts)] for x in form.free]
    return [form.name, form.records, free, list(values)]


def read_journal(folder: Path) -> Journal:
    """Return the journal of an interrupted diagnosis.

    Raises:
        InputError: there is none in the folder, it is damaged, or another version wrote it.
    """
    path = folder / UNFINISHED
    content = read_bounded(path, _MOST_BYTES, "what an interrupted diagnosis left")
    try:
        found = json.loads(content)
        written, entries, work = found["version"], dict(found["entries"]), [int(x) for x in found["work"]]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: is damaged ({type(error).__name__}); start anew without --resume") from None
    if written != version():
        raise InputError(f"{path}: was left by version {written}, this is {version()}; start anew without --resume")
    return Journal(entries, earlier_work=work)


_open: list[Journal] = []


@contextlib.contextmanager
def keeping(journal: Journal) -> Iterator[Journal]:
    """Let every fit and scan keep its result in a journal, and take it from there where it is."""
    _open.append(journal)
    try:
        yield journal
    finally:
        _open.remove(journal)


def current_journal() -> Journal | None:
    """Return the journal that is kept, None where none is."""
    return _open[-1] if _open else None
