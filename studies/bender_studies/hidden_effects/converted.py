"""The same records in other units and at other scales: the verdict has to stay, in other units every number too."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from bender_studies.hidden_effects.trial import silence

if TYPE_CHECKING:
    from collections.abc import Callable

    from bender_discrepancy.diagnosis import Diagnosis
    from bender_loop.records.record import Record
    from bender_proving.systems.suspected import SuspectedCase

PER_UNIT: tuple[Mapping[str, float], ...] = (
    {"ms": 1e3, "min": 1.0 / 60.0, "us": 1e6},
    {"mV": 1e3, "kV": 1e-3, "uV": 1e6},
    {"nm": 1e3, "mm": 1e-3, "m": 1e-6, "inch": 1.0 / 25_400.0},
)
"""Units of time, voltage and displacement: how many of them are a second, a volt, a micrometre."""
SCALES = ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6), (1e-6, 1e-6), (1e6, 1e6))
"""Factors of the input and of the output."""
NEUTRAL = ("s", "Pa", "N")
"""Units of records and FMUs at other scales: no supply gives a million volts."""
SCALED_EVERY, SCALED_FIRST = 4, 1
"""One case of so many is diagnosed at other scales, one in which an effect is hidden."""
WITHIN = 1e-6
DESCRIPTION = "modelDescription.xml"


@dataclass(frozen=True, slots=True)
class Said:
    """What a diagnosis said of a record.

    Attributes:
        verdict: the contract's word, "error" where it failed.
        effects: that it names.
        numbers: of the effects, of the calibration and of the gap.
        error: what went wrong, "" where nothing did.
    """

    verdict: str
    effects: tuple[str, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    error: str = ""

    @property
    def in_words(self) -> str:
        """The verdict and the names."""
        return f"{self.verdict}: {self.error or ' + '.join(self.effects) or 'nothing'}"


@dataclass(frozen=True, slots=True)
class Converted:
    """A record as it was and as it was converted.

    Attributes:
        number: of the case.
        kind: "units" or "scale".
        conversion: in words.
        before: what was said of the record as it was.
        after: what was said of the converted one.
    """

    number: int
    kind: str
    conversion: str
    before: Said
    after: Said

    @property
    def difference(self) -> float:
        """The largest difference of a number, in parts of it; inf where one is missing. Nought for a scale."""
        if self.kind == "scale":
            return 0.0
        if set(self.before.numbers) != set(self.after.numbers):
            return math.inf
        pairs = ((x, self.after.numbers[name]) for name, x in self.before.numbers.items())
        return max((abs(a - b) / max(abs(a), abs(b)) for a, b in pairs if a != b), default=0.0)

    @property
    def is_same(self) -> bool:
        """Whether verdict and names are the same, and every number within 1e-6."""
        own, other = ((x.verdict, x.effects, x.error) for x in (self.before, self.after))
        return own == other and self.before.verdict != "error" and self.difference <= WITHIN


def converted(numbers: Iterable[int], seed: int, folder: Path, jobs: int) -> Iterator[Converted]:
    """Draw records, diagnose each as it is and converted, in their order."""
    from bender_proving.systems.suspected import suspected_case

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=silence) as pool:
        waiting: list[tuple[int, Future[Said], list[tuple[str, str, Future[Said]]]]] = []
        for k in numbers:
            case = suspected_case(k, seed)
            given = (case.structure, dict(case.given))
            plain = pool.submit(_said, _written(case, folder, ("s", "V", "um")), *given)
            units = tuple(list(x)[k % len(x)] for x in PER_UNIT)
            path = _written(case, folder, units)
            waiting.append((k, plain, [("units", ", ".join(units), pool.submit(_said, path, *given))]))
            if k % SCALED_EVERY == SCALED_FIRST:
                usual, *others = (_submitted(pool, case, folder, x) for x in ((1.0, 1.0), *SCALES))
                waiting.append((k, usual[2], others))
        try:
            for k, plain, others in waiting:
                for kind, name, answer in others:
                    yield Converted(k, kind, name, plain.result(), answer.result())
        finally:
            pool.shutdown(cancel_futures=True)


def _submitted(
    pool: ProcessPoolExecutor, case: "SuspectedCase", folder: Path, scale: tuple[float, float]
) -> tuple[str, str, Future[Said]]:
    """Hand out a record at another scale, with an FMU whose gain is scaled as well."""
    path, fmu = _written(case, folder, NEUTRAL, scale), folder / f"{case.structure}-{scale[1] / scale[0]:g}.fmu"
    if not fmu.exists():
        _write_fmu(fmu, case.structure, case.given, scale[1] / scale[0])
    name = f"input times {scale[0]:g}, output times {scale[1]:g}"
    return "scale", name, pool.submit(_said_of_fmu, path, fmu)


def _write_fmu(path: Path, structure: str, numbers: Mapping[str, float], gain: float) -> None:
    """Write the model as an FMU from Pa to N."""
    import zipfile

    from bender_native.ready import ready_plant_fmu
    from bender_studies.hidden_effects.suspected import given_model

    with zipfile.ZipFile(ready_plant_fmu(given_model(structure, numbers, gain))) as source:
        entries = {x: source.read(x) for x in source.namelist()}
    text = entries[DESCRIPTION].decode("utf-8")
    for usual, other in (("V", "Pa"), ("m", "N")):
        text = re.sub(rf'(<Unit name=|unit=)"{usual}"', rf'\1"{other}"', text)
    # without their base units the names alone say what they are
    text = re.sub(r'(<Unit name="(?:Pa|N)">).*?(</Unit>)', r"\1\2", text, flags=re.DOTALL)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in entries.items():
            target.writestr(name, text if name == DESCRIPTION else content)


def totals(found: Sequence[Converted]) -> list[list[str]]:
    """Return a row for each kind: kind, records, the same, largest difference of a number."""
    rows = []
    for kind in ("units", "scale"):
        some = [x for x in found if x.kind == kind]
        largest = max((x.difference for x in some), default=0.0)
        told = f"{largest:.1e}" if kind == "units" else ""
        rows.append([kind, str(len(some)), str(sum(x.is_same for x in some)), told])
    return rows


def _written(
    case: "SuspectedCase", folder: Path, units: tuple[str, ...], scale: tuple[float, float] = (1.0, 1.0)
) -> Path:
    """Write a record with its units in the header, all digits kept."""
    from bender_loop.shell.files import write_atomically

    # an FMU of the plant gives metres, which are called newtons
    factors = [1e-6 if x == "N" else per.get(x, 1.0) for per, x in zip(PER_UNIT, units, strict=True)]
    columns = (case.time_s, scale[0] * case.voltage_V, scale[1] * case.reading_um)
    rows = zip(*(factor * x for factor, x in zip(factors, columns, strict=True)), strict=True)
    heads = (f"{name} [{unit}]" for name, unit in zip(("time", "voltage", "displacement"), units, strict=True))
    text = "\n".join([",".join(heads), *(",".join(repr(float(x)) for x in row) for row in rows)]) + "\n"
    path = folder / f"case-{case.number}-{'-'.join(units)}-{scale[0]:g}-{scale[1]:g}.csv"
    write_atomically(path, text)
    return path


def _columns(record: Path) -> str:
    """Return the heads of the columns: a pressure is no voltage by itself."""
    return record.read_text(encoding="utf-8").partition("\n")[0]


def _said(record: Path, structure: str, numbers: Mapping[str, float]) -> Said:
    """Diagnose in a process that knows nothing of what is hidden."""
    from bender_discrepancy.workflow import diagnose
    from bender_studies.hidden_effects.suspected import given_model

    return _answer(record, lambda x: diagnose(given_model(structure, numbers), [x]))


def _said_of_fmu(record: Path, fmu: Path) -> Said:
    from bender_discrepancy.foreign.diagnose import diagnose_fmu

    return _answer(record, lambda x: diagnose_fmu(fmu, None, None, [x]))


def _answer(path: Path, diagnosed: "Callable[[Record], Diagnosis]") -> Said:
    from bender_loop.errors import InputError, RunError
    from bender_loop.records.record import read_record

    try:
        found = diagnosed(read_record(path, _columns(path)))
    except (InputError, RunError) as error:
        return Said("error", error=str(error))
    told = found.to_dict()
    values = {f"{x.id}.{y.name}": y.value for x in found.added for y in x.numbers}
    values |= {f"{name}.rms": told["gap"][name]["rms_um"] for name in ("before", "recalibrated", "after")}
    values |= {name: told["recalibrated"][name]["after"] for name in told["recalibrated"]}
    return Said(found.verdict, tuple(x.id for x in found.added), values)
