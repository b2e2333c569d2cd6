"""Parameter against effect: an FMU whose parameter is off, or whose model lacks an effect, or both."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.errors import InputError, RunError
from bender_studies.runner import in_processes

if TYPE_CHECKING:
    from bender_plant.model import Model
    from bender_proving.systems.suspected import SuspectedCase

PARAMETERS: Mapping[str, tuple[str, str]] = {
    "time_constant_s": ("plant_lag.time_constant", "lag"),
    "frequency_Hz": ("bending_modes.frequency_factor", "mode"),
    "damping_ratio": ("bending_modes.damping_ratio", "mode"),
}
"""Names in the FMU, and the structure that has them."""
SAME = {"output_curve": "lens_distortion"}
"""Names of one and the same thing: what is a curve of the lens for a camera is a curve of the output for others."""
WITHIN = 0.03
"""A corrected parameter is right within three per cent of itself: the smallest one that is off is off by five."""


@dataclass(frozen=True, slots=True)
class SuspectedAnswer:
    """What a diagnosis said of one case.

    Attributes:
        number: of the case.
        verdict: the contract's word, "error" where it failed.
        effects: that it names.
        parameters: values that it corrects, by their names in the FMU.
        seconds: of wall time.
        error: what went wrong, "" where nothing did.
    """

    number: int
    verdict: str
    effects: tuple[str, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    error: str = ""


@dataclass(frozen=True, slots=True)
class SuspectedJudged:
    """A case, the answer, and whether it is right.

    Attributes:
        kind: "parameter", "effect" or "both".
        truth: what is hidden, in words.
        said: what the answer says, in words.
        is_right: names the effect and no other, corrects the parameter and no other, to within three per cent.
        false: effects and parameters that are named for certain and are not hidden.
        answer: of the diagnosis.
    """

    kind: str
    truth: str
    said: str
    is_right: bool
    false: tuple[str, ...]
    answer: SuspectedAnswer


def judged_suspects(numbers: Iterable[int], seed: int, folder: Path, jobs: int | None) -> Iterator[SuspectedJudged]:
    """Draw, diagnose and judge cases, in their order."""
    from bender_proving.systems.suspected import suspected_case

    cases = {k: suspected_case(k, seed) for k in numbers}
    models = {x: _model_fmu(x, folder) for x in {x.structure for x in cases.values()}}
    tasks = ((_written(x, folder), models[x.structure], _given(x), k) for k, x in cases.items())
    for found in in_processes(_answer, tasks, jobs):
        yield judge(cases[found.number], found)


def judge(case: "SuspectedCase", found: SuspectedAnswer) -> SuspectedJudged:
    """Return whether an answer is right."""
    off = {PARAMETERS[name][0]: _in_fmu(case, name, value) for name, value in case.off.items()}
    hidden = {case.effect} - {""}
    named = {SAME.get(x, x) for x in found.effects}
    close = all(abs(found.parameters.get(x, 0.0) / value - 1.0) <= WITHIN for x, value in off.items())
    certain = found.verdict == "named"
    false = tuple(sorted((named - hidden if certain else set()) | (set(found.parameters) - set(off))))
    right = named == hidden and set(found.parameters) == set(off) and close and found.verdict != "ambiguous"
    numbers = [f"{x} {value:.4g}" for x, value in off.items()]
    said = [*found.effects, *(f"{x} {value:.4g}" for x, value in found.parameters.items())]
    return SuspectedJudged(
        case.kind,
        " + ".join([*(f"{x} {case.size:.3g}" for x in hidden), *numbers]),
        f"{found.verdict}: {found.error or ' + '.join(said) or 'nothing'}",
        right,
        false,
        found,
    )


def totals(found: Sequence[SuspectedJudged]) -> list[list[str]]:
    """Return a row for each kind and one for all: kind, cases, right, ambiguous, false names."""
    rows = []
    for kind in ("parameter", "effect", "both", "all"):
        some = [x for x in found if kind in (x.kind, "all")]
        ambiguous = sum(x.answer.verdict == "ambiguous" for x in some)
        counts = (len(some), sum(x.is_right for x in some), ambiguous, sum(len(x.false) for x in some))
        rows.append([kind, *(str(x) for x in counts)])
    return rows


def given_model(structure: str, numbers: Mapping[str, float]) -> "Model":
    """Return the model as given: a gain, and a lag or a mode with these numbers."""
    from bender_plant.blocks import BLOCKS
    from bender_plant.model import BlockSettings, Model

    chain = {"linear_transduction": {"sensitivity_um_per_V": 1.0}}
    if structure == "lag":
        chain["plant_lag"] = {"time_constant_s": numbers["time_constant_s"]}
    else:
        chain["bending_modes"] = {
            "first_frequency_Hz": numbers["frequency_Hz"],
            "damping_ratio": numbers["damping_ratio"],
        }
    blocks = tuple(BlockSettings(x, BLOCKS[x].parameters(**values)) for x, values in chain.items())
    return Model(structure, None, blocks)


def _model_fmu(structure: str, folder: Path) -> Path:
    from bender_native.ready import ready_plant_fmu
    from bender_proving.systems.suspected import GIVEN

    path = folder / f"{structure}.fmu"
    path.write_bytes(ready_plant_fmu(given_model(structure, GIVEN[structure])).read_bytes())
    return path


def _given(case: "SuspectedCase") -> tuple[str, ...]:
    """Return what is suspected: all numbers of the structure."""
    return tuple(name for name, structure in PARAMETERS.values() if structure == case.structure)


def _in_fmu(case: "SuspectedCase", name: str, value: float) -> float:
    return value / case.given[name] if name == "frequency_Hz" else value


def _written(case: "SuspectedCase", folder: Path) -> Path:
    from bender_loop.records.record import Record, write_record

    path = folder / f"case-{case.number}.csv"
    write_record(path, Record(case.time_s, case.voltage_V, case.reading_um))
    return path


def _answer(record: Path, fmu: Path, suspects: tuple[str, ...], number: int) -> SuspectedAnswer:
    """Diagnose in a process that knows nothing of what is hidden."""
    import time

    from bender_discrepancy.foreign.diagnose import diagnose_fmu
    from bender_loop.records.record import read_record

    began = time.perf_counter()
    try:
        found = diagnose_fmu(fmu, None, None, [read_record(record)], suspects=suspects)
    except (InputError, RunError) as error:
        return SuspectedAnswer(number, "error", seconds=time.perf_counter() - began, error=str(error))
    moved = {x.name: x.after for x in found.recalibrated if x.name in suspects}
    names = tuple(x.id for x in found.added)
    return SuspectedAnswer(number, found.verdict, names, moved, time.perf_counter() - began)
