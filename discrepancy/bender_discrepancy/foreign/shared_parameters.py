"""Suspected parameters of an FMU with several outputs: one value for all of them, beside what each output lacks.

A parameter acts on every output, an effect behind the FMU on its own one. So the parameters are fitted to the readings
of all outputs at once, each with its own noise, gain and offset; every output is diagnosed with them; and they are
fitted again beside what was found there, until they rest. The way with the parameters as given competes with that by
the criterion of `competition`, summed over the outputs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.foreign.answers import Answers, opened, short_step_s
from bender_discrepancy.foreign.calibration import Calibrated, calibrate
from bender_discrepancy.foreign.competition import Account, is_among, is_complete, with_suspected
from bender_discrepancy.foreign.container_stages import Original, Stages, stages_around
from bender_discrepancy.foreign.suspects import Suspect
from bender_inference.fitting.criterion import independent_rows, very_strong, yardstick
from bender_inference.fitting.fit_problem import calibrated
from bender_inference.records.observations import Observations, observe
from bender_inference.records.stand_in import Suspected
from bender_inference.search.search import Progress
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import Model

Array = NDArray[np.float64]
Found = dict[str, Diagnosis]
NOTHING_AROUND = Stages(None, None)
TURNS = 3
"""Of fitting the parameters beside what was found with the last ones."""
REWEIGHED = 3
"""Times that the outputs are weighed by what they leave."""


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """Several outputs of an FMU, and what was read of them.

    Attributes:
        originals: the FMU with each output, by its name.
        records: of each output.
        how: they are read.
        suspects: parameters that may be off.
        at: the diagnoses of all outputs with values of parameters.
        tell: is told what is being done.
    """

    originals: Mapping[str, Original]
    records: Mapping[str, Sequence[Record]]
    how: Settings
    suspects: tuple[Suspect, ...]
    at: Callable[[Mapping[str, float]], Found]
    tell: Progress


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """The diagnoses of all outputs, and the parameters that were moved for them."""

    found: Found
    moved: Calibrated | None

    def accounts(self) -> dict[str, Account]:
        """Return it by outputs; what was moved is counted once."""
        first, *_ = self.found
        return {name: Account(x, self.moved if name == first else None) for name, x in self.found.items()}


def diagnose_beside(bench: Bench) -> tuple[Found, dict[str, float]]:
    """Return the diagnosis of every output that the evidence of all favours, and the parameters that were moved.

    Raises:
        InputError, RunError: as a diagnosis raises them.
    """
    given = _Way(bench.at({}), None)
    alone = fitted_to_all(bench, {}, {}, bench.suspects)
    ways, off = [given], [x.suspect for x in alone.parameters if x.is_off]
    if off and len(off) < len(alone.parameters):
        alone = replace(fitted_to_all(bench, {}, {}, off), unseen=alone.unseen)
    now: Calibrated | None = alone if off else None
    while now is not None and len(ways) <= TURNS:
        ways.append(_Way(bench.at(now.values()), now))
        again = _beside(bench, ways[-1].found, off)
        known = [x.moved for x in ways if x.moved is not None]
        if again is None or not any(x.is_off for x in again.parameters) or is_among(again, known):
            break
        now = replace(again, unseen=alone.unseen)
    best = _cheapest(ways)
    moved = () if best.moved is None else best.moved.parameters
    numbers = tuple((x.suspect.name, x.suspect.given, x.value, x.std, x.suspect.unit) for x in moved)
    suspected = Suspected(numbers, alone.unseen, alone.combinations)
    found = {
        name: with_suspected(Account(x, best.moved), Account(given.found[name], None), suspected)
        for name, x in best.found.items()
    }
    return found, {} if best.moved is None else best.moved.values()


def _beside(bench: Bench, found: Found, off: Sequence[Suspect]) -> Calibrated | None:
    """Return the parameters fitted beside what was found on the outputs; None where nothing stands around them."""
    stages = {name: _stages(x, bench.originals[name]) for name, x in found.items()}
    if all(x.are_none for x in stages.values()):
        return None
    bench.tell("fitting the suspected parameters beside what was found on the outputs")
    return fitted_to_all(bench, stages, {name: x.findings.search.base for name, x in found.items()}, off)


def _stages(found: Diagnosis, original: Original) -> Stages:
    """Return what stands before and behind an output; its inside is left to the parameters."""
    search = found.findings.search
    return replace(stages_around(search.base, found.model, original.rest_um), inside=None, changed=())


def fitted_to_all(
    bench: Bench, stages: Mapping[str, Stages], stand_ins: Mapping[str, Model], suspects: Sequence[Suspect]
) -> Calibrated:
    """Return the parameters fitted to all outputs at once, each in units of what it leaves.

    That is the likelihood of all readings: the sum of n ln(S / n) over the outputs is least there. It has a minimum
    near the fit to each output alone: an output that lacks something else must not draw the parameters along.
    """
    how, originals = bench.how, list(bench.originals.values())
    seen = {name: [observe(x, how.linear, how.untimed, how.smooth) for x in own] for name, own in bench.records.items()}
    every = [x for own in seen.values() for x in own]
    step_s = short_step_s(every, list(stages.values()), list(stand_ins.values()))
    with opened(originals) as plant:
        task = _Task(bench, Answers(plant, originals), seen, stages, step_s)
        starts = [task.fitted(suspects, {name: 1.0}) for name in seen]
        best = min(starts, key=task.cost)
        for _ in range(REWEIGHED):
            again = task.fitted(suspects, task.left(best.values()))
            rests = is_among(again, [best])
            best = again
            if rests:
                break
        return best


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """All outputs, to be fitted to."""

    bench: Bench
    answers: Answers
    seen: Mapping[str, Sequence[Observations]]
    stages: Mapping[str, Stages]
    step_s: float

    def shown(self, name: str, values: Mapping[str, float]) -> list[Array]:
        """Return the readings (n,) of an output with values of parameters, for every record."""
        before = self.answers.drives
        self.answers.set_parameters({x.name: x.given for x in self.bench.suspects} | dict(values))
        stages, rest_um = self.stages.get(name, NOTHING_AROUND), self.bench.originals[name].rest_um
        rows = zip(self.seen[name], self.bench.records[name], strict=True)
        found = [self.answers.readings(name, rest_um, stages, x, record, self.step_s) for x, record in rows]
        if self.answers.drives > before:
            self.bench.tell(f"fitting the suspected parameters to all outputs, {self.answers.drives} runs of the FMU")
        return found

    def fitted(self, suspects: Sequence[Suspect], scales: Mapping[str, float]) -> Calibrated:
        """Return the parameters fitted to outputs, each in units of its scale."""
        sensors = [k for k, name in enumerate(scales) for _ in self.seen[name]]
        own = [replace(x, measured_um=x.measured_um / scale) for name, scale in scales.items() for x in self.seen[name]]

        def run(values: dict[str, float]) -> list[Array]:
            return [y / scale for name, scale in scales.items() for y in self.shown(name, values)]

        return calibrate(run, own, suspects, free_reading=True, sensors=sensors)

    def left(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the rms that every output leaves in the rows of fits, with gain and offsets of its own."""
        return {name: max(float(np.sqrt(np.mean(self._residual(name, values) ** 2))), 1e-300) for name in self.seen}

    def cost(self, fitted: Calibrated) -> float:
        """Return the sum of n ln(S / n) over the outputs."""
        rows = {name: sum(int(x.training.sum()) for x in own) for name, own in self.seen.items()}
        return sum(2.0 * rows[name] * float(np.log(rms)) for name, rms in self.left(fitted.values()).items())

    def _residual(self, name: str, values: Mapping[str, float]) -> Array:
        own = self.seen[name]
        line = calibrated(own, shown := self.shown(name, values))
        return np.concatenate(
            [
                (x.measured_um - line.gain * y - offset)[x.training]
                for x, y, offset in zip(own, shown, line.offsets_um, strict=True)
            ]
        )


def _cheapest(ways: Sequence[_Way]) -> _Way:
    """Return the way that the readings of all outputs favour: of those close to it, the one that stands around."""
    names, accounts = list(ways[0].found), [x.accounts() for x in ways]
    costs, confidence = np.zeros(len(ways)), 0.0
    for name in names:
        least = min(
            (x[name] for x in accounts), key=lambda x: x.diagnosis.findings.search.best.training_square
        ).diagnosis.findings.search
        by = yardstick(least.problem, least.best, least.grades.by.tried)
        rows = independent_rows(least.problem, least.best)
        costs += [x[name].cost(rows) + x[name].selection_cost(by.tried) for x in accounts]
        confidence = by.confidence
    close = [k for k, x in enumerate(costs) if x <= costs.min() + very_strong(confidence)]

    def order(k: int) -> tuple[bool, bool, int, float]:
        own = accounts[k].values()
        return (
            not all(x.stands for x in own),
            not all(is_complete(x) for x in own),
            sum(x.numbers for x in own),
            float(costs[k]),
        )

    return ways[min(close, key=order)]
