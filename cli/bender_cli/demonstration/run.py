"""The demonstration from the FMUs to the page."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bender_cli.demonstration import steps
from bender_cli.demonstration.page import render
from bender_cli.demonstration.story import COLUMNS, summary_rows, tell
from bender_loop.files import prepare_directory, write_atomically
from bender_loop.progress import Progress, print_table


@dataclass(frozen=True, slots=True)
class Scale:
    """How much is done.

    Attributes:
        evaluations: of each search.
        plants: of Monte Carlo, for each controller.
        seeds: of the race between the searches.
    """

    evaluations: int = 151
    plants: int = 300
    seeds: int = 5


def demonstrate(out: Path, scale: Scale | None = None) -> Path:
    """Do everything, write it into `out`; returns the page.

    Raises:
        InputError: the directory cannot be written, or the FMUs nowhere.
        RunError: a plant failed.
    """
    scale = Scale() if scale is None else scale
    prepare_directory(out)
    with _step(1, "building the FMUs"):
        fmus = steps.build_fmus()
    with _step(2, "tuning the controller through the FMU, and trying it on other plants"):
        session = steps.tune(fmus, out / "tune", evaluations=scale.evaluations, plants=scale.plants)
    with _step(3, "running the search as printed, put right, and ours"), Progress("searches") as progress:
        race = steps.race(fmus, out, seeds=range(scale.seeds), evaluations=scale.evaluations, report=progress.update)
    with _step(4, "laying the model over a record"):
        overlaid = steps.overlay(fmus, out, seed=session.settings.seed)
    with _step(5, "writing the page"):
        page = out / "index.html"
        write_atomically(page, render(tell(session, race, overlaid)))
    print_table("ours beside the paper's, step of 10 um", COLUMNS, summary_rows(session))
    return page


STEPS = 5


@contextmanager
def _step(number: int, title: str) -> Iterator[None]:
    sys.stderr.write(f"[{number}/{STEPS}] {title}\n")
    sys.stderr.flush()
    began = time.monotonic()
    yield
    sys.stderr.write(f"[{number}/{STEPS}] done in {time.monotonic() - began:.1f} s\n")
    sys.stderr.flush()
