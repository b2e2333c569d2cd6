"""The trial run of an FMU, as a process of its own: FMUs may crash, hang or take the interpreter along.

`python -m bender_loop.fmu.check.trial FMU RESULT STAGES` writes to RESULT, before every stage, which one comes next and
what was found up to there, so that the last one that began is known after a crash. STAGES is `all`, or `start` for the
first one.
"""

import json
import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError, RunError
from bender_loop.fmu.check.explanations import explained_failure
from bender_loop.fmu.check.findings import LEAVING, Finding, error, note, warning
from bender_loop.fmu.check.trial_instance import TrialInstance
from bender_loop.fmu.file import co_simulation, read_description
from bender_loop.shell.files import write_atomically

STEPS = 20
_LATER_S = 5.0
_ASK = "ask the maker of the FMU"
_SEEN = 1e-4


class Trial:
    """The stages of a trial run over one FMU."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.description = read_description(path)
        interface = co_simulation(self.description)
        self.state = bool(interface.canGetAndSetFMUstate)
        self.serialises = bool(interface.canSerializeFMUstate)
        self.any_step = bool(interface.canHandleVariableCommunicationStepSize)
        self.once = bool(interface.canBeInstantiatedOnlyOncePerProcess)
        self.instance = TrialInstance(path, self.description)
        self.first: list[list[float]] = []

    def stages(self) -> tuple[tuple[str, Callable[[], Iterable[Finding]]], ...]:
        """Names and functions of the stages, in their order; the first one that raises ends the trial."""
        return (
            ("a run from t = 0", self.run),
            ("a second run after a reset", self.again),
            (f"a run that starts at t = {_LATER_S:g} s", self.later),
            ("a run from a saved state", self.restored),
            ("a run from a serialised state", self.deserialised),
            ("a run in half the steps", self.halved),
            ("two instances side by side", self.two),
            ("an input that is not a number", self.not_a_number),
        )

    def run(self) -> Iterable[Finding]:
        """Step from rest under an input that moves."""
        self.instance.begin()
        self.first = self._moved(self.instance, range(STEPS))
        for name in sorted({n for row in self.first for n, x in zip(self.instance.outputs, row, strict=True) if x - x}):
            yield error(f"{name} is not finite after a step from rest", "nothing can be computed from it", _ASK)

    def again(self) -> Iterable[Finding]:
        """The same after a reset."""
        self.instance.reset()
        self.instance.begin()
        if self._moved(self.instance, range(STEPS)) != self.first:
            yield error(
                "a run after a reset differs from the first one",
                "something of the first run is left; results depend on what was run before",
                f"{_ASK}; with bender, every run from a restored state is checked for this",
            )

    def later(self) -> Iterable[Finding]:
        """A start time other than zero."""
        self.instance.reset()
        self.instance.begin(_LATER_S)
        for row in self._moved(self.instance, range(STEPS)):
            if not all(math.isfinite(value) for value in row):
                yield error(f"not finite when started at t = {_LATER_S:g} s", "only t = 0 works", _ASK)
                return

    def restored(self) -> Iterable[Finding]:
        """Go on from a saved state, twice."""
        if self.state and self._differs(lambda: self.instance.saved(), self.instance.restore):
            yield self._forgetful("a saved state")

    def deserialised(self) -> Iterable[Finding]:
        """Go on from bytes, twice."""
        if self.serialises and self._differs(self.instance.serialised, self.instance.deserialise):
            yield self._forgetful("a serialised state")

    def halved(self) -> Iterable[Finding]:
        """Half steps under a held input: an exact model does not notice."""
        if not self.any_step:
            return
        self.instance.reset()
        self.instance.begin()
        halves = self._moved(self.instance, range(STEPS), parts=2)
        for k, name in enumerate(self.instance.outputs):
            largest = max((abs(row[k]) for row in self.first), default=0.0)
            off = max((abs(a[k] - b[k]) for a, b in zip(halves, self.first, strict=True)), default=0.0)
            if off > _SEEN * largest:
                share = f"{off:.3g}, {off / largest:.2g} of its span,"
                yield note(
                    f"{name} changes by up to {share} when the communication step is halved",
                    "results depend on the communication step, as they do where the FMU solves by a fixed step",
                    "keep to one step, or choose it small enough for your purpose",
                )

    def two(self) -> Iterable[Finding]:
        """Another instance, stepped in between, must not show."""
        if self.once:
            return
        with TrialInstance(self.path, self.description) as other:
            other.begin()
            self.instance.reset()
            self.instance.begin()
            found = []
            for k in range(STEPS):
                self._moved(other, [STEPS - k])
                found += self._moved(self.instance, [k])
        if found != self.first:
            yield error(
                "a second instance in the same process changes the results of the first",
                "runs side by side mix, in one process at least",
                "run one instance in a process; the FMU should set canBeInstantiatedOnlyOncePerProcess",
            )

    def not_a_number(self) -> Iterable[Finding]:
        """NaN must not go through in silence."""
        if not self.instance.inputs:
            return
        self.instance.reset()
        self.instance.begin()
        try:
            row = self.instance.step(math.nan)
        except RunError:
            return
        if not all(math.isfinite(value) for value in row):
            yield warning(
                "an input that is not a number is taken and comes out again",
                "one bad sample spoils the rest of a run without a word",
                "check records before you drive the FMU with them; bender does",
            )

    def _moved(self, instance: TrialInstance, at: Iterable[int], parts: int = 1) -> list[list[float]]:
        return [instance.step(math.sin(0.7 * k) + 1.0, parts) for k in at]

    def _differs(self, save: Callable[[], Any], restore: Callable[[Any], None]) -> bool:
        self.instance.reset()
        self.instance.begin()
        self._moved(self.instance, range(STEPS // 2))
        kept, time_s = save(), self.instance.time_s
        expected = self._moved(self.instance, range(STEPS // 2, STEPS))
        restore(kept)
        self.instance.time_s = time_s
        return self._moved(self.instance, range(STEPS // 2, STEPS)) != expected

    def _forgetful(self, call: str) -> Finding:
        return error(
            f"a run from {call} differs from the one that went on",
            "the saved state is not the whole state; masters that repeat steps get wrong results",
            f"{_ASK}; bender notices this and initialises anew for every run",
        )


def main(path: Path, result: Path) -> None:
    """Run all stages; what is found goes to the result file."""
    found: list[Finding] = []

    def tell(stage: str | None) -> None:
        write_atomically(result, json.dumps({"stage": stage, "findings": [asdict(finding) for finding in found]}))

    tell("loading and instantiating")
    stage = "loading and instantiating"
    try:
        trial = Trial(path)
        for stage, check in trial.stages():
            tell(stage)
            found += check()
        stage = "freeing the instance"
        tell(stage)
        trial.instance.close()
        tell(LEAVING)
    except (InputError, RunError) as problem:
        text = str(problem).removeprefix(f"{path}: ")
        found.append(explained_failure(f"{stage}: {text}", "the FMU cannot be used that far", _ASK))
        tell(None)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
