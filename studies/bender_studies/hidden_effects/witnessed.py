"""Witnesses: benches whose effects are confused without the instruments beside the sensor, diagnosed with them."""

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.errors import InputError, RunError
from bender_studies.hidden_effects.figures import wilson
from bender_studies.hidden_effects.trial import MODEL
from bender_studies.runner import workers

if TYPE_CHECKING:
    from bender_proving.cases.witnessed import WitnessedCase

CHANNELS = ("supply_voltage_V", "current_A", "temperature_C")
MOST_DRAWS = 5
"""Draws for each bench that is wanted: more of them are not confused only if the weak records are not weak."""


@dataclass(frozen=True, slots=True)
class WitnessedAnswer:
    """What a diagnosis said of a record.

    Attributes:
        verdict: the contract's word, "error" where it failed.
        effects: in the corrected model.
        rivals: that could stand in its place.
        witnesses: sentences of the report.
        seconds: of wall time.
        error: what went wrong, "" where nothing did.
    """

    verdict: str
    effects: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    witnesses: tuple[str, ...] = ()
    seconds: float = 0.0
    error: str = ""

    def names(self, effect: str) -> bool:
        """Whether it names this effect and no other."""
        return self.verdict == "named" and self.effects == (effect,)

    @property
    def in_words(self) -> str:
        """The verdict and what it is about."""
        rivals = f" or {', '.join(self.rivals)}" if self.rivals else ""
        return f"{self.verdict}: {self.error or ' + '.join(self.effects) or 'nothing'}{rivals}"


@dataclass(frozen=True, slots=True)
class WitnessedJudged:
    """A bench that is confused without its instruments.

    Attributes:
        number: of the draw.
        drawn: benches drawn until this one, itself included.
        effect: what is hidden.
        size: of it.
        without: the answer to the record without the channels.
        answer: the answer to the whole record.
    """

    number: int
    drawn: int
    effect: str
    size: float
    without: WitnessedAnswer
    answer: WitnessedAnswer

    @property
    def is_right(self) -> bool:
        """Whether what is hidden is named, and nothing else."""
        return self.answer.names(self.effect)

    @property
    def is_false(self) -> bool:
        """Whether something is named that is not hidden."""
        return self.answer.verdict == "named" and not set(self.answer.effects) <= {self.effect}


def witnessed(numbers: Iterable[int], seed: int, folder: Path, jobs: int | None) -> Iterator[WitnessedJudged]:
    """Draw benches until as many as asked for are confused without their instruments; judge those with them."""
    wanted, jobs = len(list(numbers)), jobs or os.cpu_count() or 1
    draws = iter(count())
    running: list[tuple[WitnessedCase, Future[WitnessedAnswer]]] = []
    confirmed: list[tuple[int, WitnessedCase, WitnessedAnswer, Future[WitnessedAnswer]]] = []
    taken = found = 0
    with workers(jobs) as pool:
        while found < wanted:
            while len(running) <= jobs:
                case = _case(next(draws), seed)
                running.append((case, pool.submit(_answer, _written(case, folder, whole=False))))
            case, plain = running.pop(0)
            taken += 1
            if taken > MOST_DRAWS * wanted:
                raise RunError(f"found {found} benches confused of {taken - 1} drawn, expected {wanted}")
            if plain.result().verdict == "error" or plain.result().names(case.effect):
                continue
            found += 1
            confirmed.append((taken, case, plain.result(), pool.submit(_answer, _written(case, folder))))
            while confirmed and (confirmed[0][-1].done() or len(confirmed) > jobs):
                yield _judged(*confirmed.pop(0))
        for _, plain in running:
            plain.cancel()
        for one in confirmed:
            yield _judged(*one)


def _judged(
    taken: int, case: "WitnessedCase", without: WitnessedAnswer, answer: Future[WitnessedAnswer]
) -> WitnessedJudged:
    return WitnessedJudged(case.number, taken, case.effect, case.hidden.magnitude, without, answer.result())


def totals(found: Sequence[WitnessedJudged]) -> list[list[str]]:
    """Return a row for each hidden effect and one for all: effect, benches, right, 95 % interval, false names."""
    rows = []
    for name in (*sorted({x.effect for x in found}), "all"):
        some = [x for x in found if name in (x.effect, "all")]
        right = sum(x.is_right for x in some)
        low, high = wilson(right / len(some), len(some)) if some else (0.0, 1.0)
        interval = f"{100 * low:.0f} to {100 * high:.0f} %"
        rows.append([name, str(len(some)), str(right), interval, str(sum(x.is_false for x in some))])
    return rows


def _case(number: int, seed: int) -> "WitnessedCase":
    from bender_proving.cases.witnessed import witnessed_case

    return witnessed_case(number, seed)


def _written(case: "WitnessedCase", folder: Path, *, whole: bool = True) -> Path:
    from bender_loop.records.record import write_record

    path = folder / f"bench-{case.number}{'' if whole else '-plain'}.csv"
    write_record(path, case.record if whole else replace(case.record, **dict.fromkeys(CHANNELS)))
    return path


def _answer(record: Path) -> WitnessedAnswer:
    """Diagnose in a process that knows nothing of what is hidden."""
    import time

    from bender_discrepancy.workflow import diagnose
    from bender_inference.records.checks import read_model
    from bender_loop.records.record import read_record

    began = time.perf_counter()
    try:
        found = diagnose(read_model(MODEL), [read_record(record)])
    except (InputError, RunError) as error:
        return WitnessedAnswer("error", seconds=time.perf_counter() - began, error=str(error))
    added = tuple(x.id for x in found.added)
    return WitnessedAnswer(
        found.verdict,
        added,
        tuple(x.id for x in found.effects if x.id not in added),
        found.findings.search.witnesses,
        time.perf_counter() - began,
    )
