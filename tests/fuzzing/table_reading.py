"""Records in other formats through the one place that reads them: a right record, or one sentence, and nothing else."""

import contextlib
import os
import random
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fuzzing.strange_tables import sound_columns, table_case

SECONDS, MEMORY_MB = 60.0, 2000.0
_ADDRESS_BYTES = 6 << 30


def table_cases(cases: int, seed: int, folder: Path) -> list[str]:
    """Read so many files in other formats; return the complaints."""
    found: list[str] = []
    _bound_memory()
    for k in range(cases):
        place = folder / str(k)
        place.mkdir()
        found += [f"table {k}: {text}" for text in read_case(random.Random(f"{seed} tables {k}"), place)]
    return found


def read_case(rng: random.Random, place: Path) -> Iterator[str]:
    """Read one file; yield what should not have been."""
    path, options, done, rows = table_case(place, rng)
    before, began_s = sorted(place.iterdir()), time.monotonic()
    about = f"{done}, {path.name} {' '.join(x[:30] for x in options)}"
    with _caught() as said:
        complaint = _read(path, options, rows)
    if complaint:
        yield f"{about}: {complaint}"
    lines = [line for line in said if not line.startswith("bender: ")]
    if lines:
        yield f"{about}: said beside its sentence: {lines[0][:200]}"
    if time.monotonic() - began_s > SECONDS:
        yield f"{about}: took {time.monotonic() - began_s:.0f} s"
    if sorted(place.iterdir()) != before:
        yield f"{about}: left files behind"
    if _peak_MB() > MEMORY_MB:
        yield f"{about}: the process has held {_peak_MB():.0f} MB"


def _read(path: Path, options: object, rows: int) -> str:
    """Return what is wrong with the outcome, "" where nothing is."""
    from bender_loop.errors import InputError
    from bender_loop.records.arguments import add_record_arguments, record_of

    parser = ArgumentParser()
    add_record_arguments(parser)
    try:
        found = record_of(parser.parse_args(list(options)), path)  # pyright: ignore[reportArgumentType]
    except InputError as error:
        return f"a sound file is refused: {error}" if rows else ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    expected = sound_columns(rows) if rows else {}
    wrong = [x for x, y in expected.items() if not np.allclose(getattr(found, x), y, rtol=1e-9, atol=1e-9)]
    return f"another record than went in: {', '.join(wrong)}" if wrong else ""


@contextlib.contextmanager
def _caught() -> Iterator[list[str]]:
    """Catch what is written to the streams of the process, by libraries in C too; its lines stand there afterwards."""
    lines: list[str] = []
    sys.stdout.flush()
    sys.stderr.flush()
    with tempfile.TemporaryFile() as file:
        kept = [os.dup(stream) for stream in (1, 2)]
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
        try:
            yield lines
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for stream, old in zip((1, 2), kept, strict=True):
                os.dup2(old, stream)
                os.close(old)
            file.seek(0)
            lines += file.read().decode("utf-8", "replace").splitlines()


def _bound_memory() -> None:
    """Let this process fail, where the platform can do that, before it takes the machine's memory."""
    if os.name == "posix":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_BYTES, _ADDRESS_BYTES))


def _peak_MB() -> float:
    if os.name != "posix":
        return 0.0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024.0 if sys.platform != "darwin" else 1024.0**2)
