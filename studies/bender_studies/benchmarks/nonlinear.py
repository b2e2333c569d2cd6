"""`bender benchmark nonlinear`: the public nonlinear system identification benchmarks, with their official splits.

Rows, units and rows that find the state are those of nonlinear-benchmarks (github GerbenBeintema/nonlinear_benchmarks,
BSD-3); figures of others are as they published them. The first model is made from the rows of the estimation part, the
diagnosis sees the same rows, and one free run over each test part is judged: rms of measured minus simulated, nothing
refitted. Without `--first-only` a network's thousands of parameters stand against a structure and named effects.
"""

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from bender_studies.benchmarks.records_at_hand import DATA, data_folder, missing_of, refuse_missing, wanted

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_loop.records.drive import InputHold
    from bender_loop.records.record import Record
    from bender_plant.model import Model

HELP = "public nonlinear benchmarks: official splits and figures, what others published beside ours"
COLUMNS = ("test part", "linear", "ours", "published", "numbers", "named", "s")


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of one file.

    Attributes:
        file: with columns of time, input and output.
        rows: of the file; the whole of it by default.
        columns: of the file.
        input_factor: from the file's input to the unit that all parts have.
    """

    file: str
    rows: slice = field(default_factory=lambda: slice(None))
    columns: str = "time=time_s,voltage=u,displacement=y"
    input_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Part:
    """One test part.

    Attributes:
        name: for the table.
        run: rows that the models follow freely.
        judged_from: of these rows: earlier ones find the state.
        published: figures of others, best first: rms in the unit of the benchmark, and whose it is.
    """

    name: str
    run: Rows
    judged_from: int
    published: tuple[tuple[float, str], ...]


@dataclass(frozen=True, slots=True)
class Benchmark:
    """One benchmark.

    Attributes:
        name: for the table and `--only`.
        unit: of the output.
        scale: units of the table in one unit of the files.
        fits: rows of the estimation part, a record each.
        parts: what is judged.
        hold: the input between two rows.
    """

    name: str
    unit: str
    scale: float
    fits: tuple[Rows, ...]
    parts: tuple[Part, ...]
    hold: "InputHold"


_SILVERBOX = Rows("silverbox_multisine.csv", columns="time_s,input_V,output_mV", input_factor=1e3)
_ARROW, _MULTISINE = "silverbox_arrow.csv", "silverbox_multisine_test.csv"
BENCHMARKS: tuple[Benchmark, ...] = (
    Benchmark(
        "silverbox", "mV", 1.0, (_SILVERBOX,),
        (
            Part("multisine", Rows(_MULTISINE), 50, ((0.30, "GP-NARX"), (0.36, "SUBNET"))),
            Part("arrow, full", Rows(_ARROW), 50, ((0.26, "PNLSS"), (14.2, "linear"))),
            Part("arrow, no extrapolation", Rows(_ARROW, slice(0, 32_000)), 50, ((0.26, "PNLSS"), (0.32, "others"))),
        ),
        "smooth",
    ),
    Benchmark(
        "bouc-wen", "m", 1.0, (Rows("boucwen_train.csv"),),
        (
            Part("multisine", Rows("boucwen_multisine.csv"), 50, ((1.9e-5, "PNLSS"), (4.5e-5, "dynoNet"))),
            Part("sine sweep", Rows("boucwen_sinesweep.csv"), 750, ()),
        ),
        "smooth",  # integrated at 15 kHz and filtered before every twentieth row was kept
    ),
    Benchmark(
        "coupled drives", "ticks/s", 1.0,
        (Rows("ced_abs.csv", slice(0, 400)), Rows("ced_abs_val.csv", slice(0, 400))),
        (
            Part("first record", Rows("ced_abs.csv"), 410, ((0.115, "published best"), (0.22, "linear"))),
            Part("second record", Rows("ced_abs_val.csv"), 410, ((0.074, "published best"), (0.33, "linear"))),
        ),
        "hold",
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a test part, rms in the unit of the benchmark.

    Attributes:
        benchmark: its name.
        part: the test part.
        unit: of the rms.
        linear: what the first model leaves.
        ours: what the corrected model leaves; None with `--first-only`.
        published: figures of others.
        numbers: fitted numbers of the corrected model, or of the first one with `--first-only`.
        named: the effects in the corrected model.
        verdict: the contract's word; None with `--first-only`.
        seconds: of wall time, first model and diagnosis.
    """

    benchmark: str
    part: str
    unit: str
    linear: float
    ours: float | None
    published: tuple[tuple[float, str], ...]
    numbers: int
    named: tuple[str, ...]
    verdict: str | None
    seconds: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which benchmarks run, where their files are, how far each goes, and where the results go."""
    names = ", ".join(repr(x.name) for x in BENCHMARKS)
    parser.epilog = "example:\n  bender benchmark nonlinear --only silverbox"
    parser.add_argument("--only", nargs="+", metavar="NAME", help=f"default: all of {names}")
    parser.add_argument("--data", type=Path, metavar="DIR", help=f"default: {DATA} beside the checkout")
    parser.add_argument("--first-only", action="store_true", help="first models alone, without a diagnosis")


def run(arguments: argparse.Namespace) -> int:
    """Print the table, write nonlinear.json and the diagnosis of every benchmark."""
    import json

    from bender_loop.shell.files import prepare_directory, write_atomically
    from bender_loop.shell.progress import Progress, print_table
    from bender_loop.shell.run import remark

    data = data_folder(arguments.data)
    asked = wanted("--only", arguments.only, {x.name: x for x in BENCHMARKS})
    present = [x for x in asked if not _missing(x, data)]
    if not present:
        refuse_missing([y for x in asked for y in _missing(x, data)], data, "the benchmarks")
    for x in asked:
        if x not in present:
            remark(f"{x.name}: skipped; {data} has no {', '.join(_missing(x, data))}")
    out = prepare_directory(arguments.out)
    found: list[Outcome] = []
    with Progress("nonlinear") as bar:
        for k, benchmark in enumerate(present):
            bar.update(k, len(present), benchmark.name)
            found += outcomes_of(benchmark, data, None if arguments.first_only else out)
    print_table("rms on official test parts, free simulation", COLUMNS, [_row(x) for x in found])
    write_atomically(out / "nonlinear.json", json.dumps([asdict(x) for x in found], indent=2) + "\n")
    sys.stdout.write(f"written: {out / 'nonlinear.json'}\n")
    return 0


def _row(x: Outcome) -> list[str]:
    published = ", ".join(f"{value:.2g} {who}" for value, who in x.published) or "–"
    ours = "–" if x.ours is None else f"{x.ours:.3g} {x.unit}"
    named = " + ".join(x.named) or (x.verdict or "–")
    return [
        f"{x.benchmark}: {x.part}", f"{x.linear:.3g} {x.unit}", ours, published, str(x.numbers), named,
        f"{x.seconds:.0f}",
    ]  # fmt: skip


def _missing(x: Benchmark, data: Path) -> list[str]:
    """Return the files of a benchmark that a folder lacks."""
    return missing_of([*(y.file for y in x.fits), *(y.run.file for y in x.parts)], data)


def outcomes_of(benchmark: Benchmark, data: Path, out: Path | None) -> list[Outcome]:
    """Return what comes of every test part of a benchmark.

    Args:
        benchmark: what is fitted and judged.
        data: folder with its files.
        out: where the diagnosis goes; None for the first model alone.
    """
    import time

    from bender_discrepancy.workflow import diagnose
    from bender_identify.first_model.choice import first_model
    from bender_identify.records.experiment import experiment_of
    from bender_identify.settings import Settings as IdentifySettings
    from bender_inference.fitting.own_numbers import own_numbers
    from bender_inference.settings import Settings
    from bender_loop.shell.files import prepare_directory

    place = None if out is None else prepare_directory(out / benchmark.name.replace(" ", "-"))
    records = [record_of(x, data) for x in benchmark.fits]
    names = [x.file for x in benchmark.fits]
    begin = time.perf_counter()
    ready = [
        experiment_of(x, name, IdentifySettings(), benchmark.hold, any_answer=True)
        for x, name in zip(records, names, strict=True)
    ]
    first = first_model(ready).chosen
    model = first.structure.model(first.values, first.gain, first.offsets[0], benchmark.name.replace(" ", "-"))
    numbers, named, verdict, diagnosis = len(first.values) + 2, (), None, None
    if place is not None:
        # test parts are judged with the offset of the estimation part
        settings = Settings(benchmark.hold != "hold", smooth=benchmark.hold == "smooth", same_zero=True)
        # from the records alone: linear structures and effects compete in one search
        diagnosis = diagnose(None, records, settings, None, names)
        diagnosis.write(place)
        named, verdict = tuple(x.id for x in diagnosis.added), diagnosis.verdict
        numbers = len(own_numbers(diagnosis.findings.search.base)) + 2 + _numbers(diagnosis)
    seconds = time.perf_counter() - begin
    corrected = None if diagnosis is None else diagnosis.findings.model
    return [
        Outcome(
            benchmark.name, part.name, benchmark.unit, _judged(model, part, benchmark, data),
            None if corrected is None else _judged(corrected, part, benchmark, data),
            part.published, numbers, named, verdict, seconds,
        )
        for part in benchmark.parts
    ]  # fmt: skip


def record_of(rows: Rows, data: Path) -> "Record":
    """Return rows of a file as a record, its input in the unit of all parts."""
    from dataclasses import replace

    from bender_loop.records.record import read_record

    whole = read_record(data / rows.file, rows.columns)
    columns = {name: values[rows.rows] for name, values in whole.columns().items()}
    found = replace(whole, **columns)  # pyright: ignore[reportArgumentType]
    return replace(found, voltage_V=rows.input_factor * found.voltage_V)


def _numbers(diagnosis: "Diagnosis") -> int:
    """Return how many numbers the effects of a diagnosis have."""
    told = (x["parameters"] for x in diagnosis.to_dict()["effects"])
    sizes: Callable[[object], int] = lambda value: len(value) if isinstance(value, list | tuple) else 1  # noqa: E731
    return sum(sizes(y["value"]) for x in told for y in x.values())


def _judged(model: "Model", part: Part, benchmark: Benchmark, data: Path) -> float:
    """Return the rms that a model leaves on a test part in a free run, nothing refitted."""
    import numpy as np

    from bender_compiled.simulation import Simulator
    from bender_inference.records.initial_motion import started
    from bender_inference.records.observations import observe

    record = record_of(part.run, data)
    seen = started(model, record, observe(record, benchmark.hold != "hold", smooth=benchmark.hold == "smooth"))
    simulated = Simulator(seen.drive).run(model).reading_um[-len(record) :]
    left = (record.displacement_um - simulated)[part.judged_from :]
    return benchmark.scale * math.sqrt(float(np.mean(left**2)))
