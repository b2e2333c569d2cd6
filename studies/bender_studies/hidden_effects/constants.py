"""Do verdicts depend on the constants that decide them? Each is made smaller and larger, and the answers compared.

A constant is changed in worker processes of its own before anything reads it, as if its line in the source said so.
Fits and scans do not depend on it: every case keeps its own from one search to the next, and only what a changed
constant has the search look at besides is computed anew.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bender_studies.hidden_effects.trial import MODEL
from bender_studies.runner import silence, workers

if TYPE_CHECKING:
    from bender_inference.fitting.journal import Journal
    from bender_proving import Case

RECORD, JOURNAL = "record.csv", "journal.json"
CONFIDENCE = "confidence"
NEAR_ONE = (CONFIDENCE, "closes")
"""Of these, which are parts of one, what they lack to it is changed."""


@dataclass(frozen=True, slots=True)
class Changed:
    """One constant at another value; as it is where it has no name."""

    name: str = ""
    value: float = 0.0


@dataclass(frozen=True, slots=True)
class Said:
    """What a diagnosis answers: its word, and the names where it names any."""

    word: str
    names: tuple[str, ...] = ()

    @property
    def in_words(self) -> str:
        """The answer in a word or its names."""
        return " + ".join(self.names) if self.word == "named" else self.word


@dataclass(frozen=True, slots=True)
class Compared:
    """A case, and what is said with a constant as it is and changed."""

    case: str
    truth: tuple[str, ...]
    changed: Changed
    before: Said
    after: Said

    @property
    def differs(self) -> bool:
        """Whether the verdict is another."""
        return self.before != self.after


def changes(part: float, confidence: float) -> list[Changed]:
    """Return every constant at both values."""
    from bender_inference.search.judgement.rules import RULES

    usual = {x.name: float(getattr(RULES, x.name)) for x in fields(RULES)} | {CONFIDENCE: confidence}
    return [
        Changed(name, 1.0 - times * (1.0 - value) if name in NEAR_ONE else times * value)
        for name, value in usual.items()
        for times in (1.0 - part, 1.0 + part)
    ]


def compared(drawn: Iterable["Case"], folder: Path, jobs: int | None, part: float) -> Iterator[Compared]:
    """Yield every case with every constant changed by a part of it, one change after the other."""
    from bender_inference.fitting.criterion import CONFIDENCE as USUAL

    truths = dict(_written(case, folder) for case in drawn)
    before = dict(_answers(tuple(truths), folder, jobs, Changed()))
    for one in changes(part, USUAL):
        for case, after in _answers(tuple(truths), folder, jobs, one):
            yield Compared(case, truths[case], one, before[case], after)


def totals(found: Sequence[Compared]) -> list[list[str]]:
    """Return a row for each change that was compared: the constant, its value, the cases, those that differ."""
    cases = Counter(x.changed for x in found)
    differ = Counter(x.changed for x in found if x.differs)
    return [
        [one.name, f"{one.value:g}", str(count), str(differ[one]), f"{100.0 * differ[one] / count:.1f} %"]
        for one, count in cases.items()
    ]


def _written(case: "Case", folder: Path) -> tuple[str, tuple[str, ...]]:
    from bender_loop.records.record import write_record
    from bender_proving import Bench

    own = folder / case.id
    own.mkdir(parents=True, exist_ok=True)
    bench = Bench(case)
    write_record(own / RECORD, bench.record(bench.excitation(), bench.noise()))
    return case.id, case.effect_ids


def _answers(cases: Sequence[str], folder: Path, jobs: int | None, changed: Changed) -> Iterator[tuple[str, Said]]:
    with workers(jobs, _change, (changed,)) as pool:
        running = {pool.submit(_answer, folder / case, changed): case for case in cases}
        for future in as_completed(running):
            yield running[future], future.result()


def _change(changed: Changed) -> None:
    """Change a constant in a process in which nothing has read it yet."""
    from dataclasses import field, make_dataclass

    from bender_inference.search.judgement import rules

    silence()
    if changed.name:
        constant = (changed.name, float, field(default=changed.value))
        kind = make_dataclass("Rules", [constant], bases=(rules.Rules,), frozen=True, slots=True)
        setattr(rules, "Rules", kind)  # noqa: B010
        setattr(rules, "RULES", kind())  # noqa: B010


def _answer(folder: Path, changed: Changed) -> Said:
    from bender_discrepancy.conclusion.findings import find
    from bender_discrepancy.record_search import search_records
    from bender_inference.fitting.journal import keeping
    from bender_inference.records.checks import read_model, read_records
    from bender_inference.records.digits import printed
    from bender_inference.settings import Settings

    records = [printed(x) for x in read_records((folder / RECORD,))]
    of_settings = changed.name in {x.name for x in fields(Settings)}
    settings = replace(Settings(), **{changed.name: changed.value}) if of_settings else Settings()
    journal = _known(folder)
    with keeping(journal):
        findings = find(search_records(read_model(MODEL), records, settings))
    (folder / JOURNAL).write_text(journal.to_json(), encoding="utf-8")
    named = findings.verdict == "named"
    return Said(findings.verdict, tuple(sorted(x.id for x in findings.added)) if named else ())


def _known(folder: Path) -> "Journal":
    """Return what earlier searches of the case have fitted, with the work that the first of them did."""
    import json

    from bender_inference.fitting.journal import Journal

    path = folder / JOURNAL
    if not path.exists():
        return Journal()
    known = json.loads(path.read_text(encoding="utf-8"))
    return Journal(dict(known["entries"]), earlier_work=[int(x) for x in known["work"]])
