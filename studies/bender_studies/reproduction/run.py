"""All exhibits one after the other, then the page, the data and the table."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bender_loop.errors import RunError
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_loop.shell.progress import Progress, print_table
from bender_loop.shell.run import step
from bender_report.page import render
from bender_studies.reproduction.document import COLUMNS, counted, lines, to_json
from bender_studies.reproduction.exhibit import Exhibit
from bender_studies.reproduction.registry import EXHIBITS, show_of
from bender_studies.reproduction.shared_work import Scale, SharedWork
from bender_studies.reproduction.story import tell


def reproduce(out: Path, seed: int = 0, scale: Scale | None = None) -> tuple[Path, tuple[str, ...]]:
    """Compute every exhibit and write `index.html`, `reproduction.json` and the folder `records` into `out`.

    An exhibit whose run fails says so in its place, the others stand.
    """
    began = time.monotonic()
    prepare_directory(out)
    shared = SharedWork(out, Scale() if scale is None else scale, seed)
    _say("building the FMUs")
    # all at once and first: an FMU that is open brings its own copy of PythonFMU along
    _ = shared.fmus
    failed: list[str] = []
    exhibits = [_shown(shared, number, name, failed) for number, name in enumerate(EXHIBITS, 1)]
    bench = shared.bench.how
    page = out / "index.html"
    write_atomically(out / "reproduction.json", to_json(exhibits, seed, bench, shared.measured is not None))
    write_atomically(page, render(tell(exhibits, bench, time.monotonic() - began)))
    print_table("the paper beside ours (✓ rounds to the printed digits)", COLUMNS, lines(exhibits))
    met, held = counted(exhibits)
    sys.stdout.write(f"in paper mode {met} of {held} printed results come out to their last digit\n")
    return page, tuple(failed)


def _shown(shared: SharedWork, number: int, name: str, failed: list[str]) -> Exhibit:
    with _step(number, name) as told, Progress(name) as progress:
        shared.progress = progress.update
        try:
            exhibit = show_of(name)(shared)
        except RunError as error:
            failed.append(name)
            exhibit = Exhibit(name, f"the run failed: {error}", "not run", "not run", ())
        told.append(exhibit.finding)
    return exhibit


@contextmanager
def _step(number: int, name: str) -> Iterator[list[str]]:
    place = f"[{number}/{len(EXHIBITS)}] {name}"
    _say(place)
    began = time.monotonic()
    told: list[str] = []
    yield told
    _say(f"{place}: {told[0] if told else 'done'} ({time.monotonic() - began:.1f} s)")


def _say(line: str) -> None:
    step(line)
