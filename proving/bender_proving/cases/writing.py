"""Cases as files: records for the code that is judged, the truth in another place for the judge."""

import json
from dataclasses import asdict
from pathlib import Path

from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_loop.records.record import write_record
from bender_proving.bench import Bench
from bender_proving.cases.case import Case
from bender_proving.cases.draw import strength
from bender_proving.cases.effects import effect
from bender_proving.cases.hidden import NOISE_UM, Hidden


def write_case(case: Case, directory: Path, truth_directory: Path | None = None, *, second: bool = False) -> Path:
    """Write the record of a case, and its truth where the code that is judged does not look.

    Args:
        case: what to write.
        directory: gets `record.csv` and, with `second`, `second.csv`: the same bench under another excitation.
        truth_directory: gets `<case id>.json`; without it the folder `truth` beside `directory`.
        second: whether to write a second record.

    Returns:
        The file with the truth.

    Raises:
        InputError: a directory cannot be written, or the truth would lie in the directory of the record.
    """
    directory = Path(directory)
    hiding_place = directory.resolve().parent / "truth" if truth_directory is None else Path(truth_directory).resolve()
    if hiding_place.is_relative_to(directory.resolve()):
        raise InputError(
            f"{hiding_place}: lies inside {directory}, where the truth would be seen; choose another place"
        )
    prepare_directory(directory)
    prepare_directory(hiding_place)
    bench = Bench(case)
    write_record(directory / "record.csv", bench.record(bench.excitation(), bench.noise()))
    if second:
        write_record(directory / "second.csv", bench.record(bench.excitation(1), bench.noise(1), 1))
    path = hiding_place / f"{case.id}.json"
    write_atomically(path, json.dumps(truth(case, second=second), indent=2) + "\n")
    return path


def truth(case: Case, *, second: bool = False) -> dict[str, object]:
    """All that a judge may want to know of a case, ready for JSON."""
    bench = Bench(case)
    table: dict[str, object] = {
        "id": case.id,
        "kind": case.kind,
        "seed": case.seed,
        "sensor": case.sensor,
        "effects": [_described(item) for item in case.effects],
        "rivals": list(case.weak.rivals) if case.weak else [],
        "weak": asdict(case.weak) if case.weak else None,
        "gain": case.gain,
        "offset_um": case.offset_um,
        "noise_um": case.gain * NOISE_UM[case.sensor],
        "residual_over_noise": strength(case),
        "outlying": case.outlying,
        "lost": case.lost,
        "uneven": case.uneven,
        "runner_delay": case.runner_delay,
    }
    if second:
        table["second"] = [_described(item) for item in bench.hidden(1, bench.excitation(1).setting)]
    return table


def _described(item: Hidden) -> dict[str, object]:
    entry = effect(item.id)
    return {
        "id": item.id,
        "stage": entry.stage,
        "form": item.form,
        "magnitude": item.magnitude,
        "magnitude_is": entry.magnitude,
        "unit": entry.unit,
        "parameters": dict(item.parameters),
    }
