"""The demonstration from the FMUs to the page."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bender_loop.shell.files import prepare_directory, write_atomically
from bender_loop.shell.progress import Progress, print_table
from bender_loop.shell.run import step
from bender_report.page import render
from bender_studies.demonstration import steps
from bender_studies.demonstration.bench import on_the_bench
from bender_studies.demonstration.bench_story import COLUMNS as BENCH_COLUMNS
from bender_studies.demonstration.bench_story import (
    balance,
    bench_section,
    beside_dead_time,
    compared,
    missing_section,
    verdict,
)
from bender_studies.demonstration.story import COLUMNS, summary_rows, tell
from bender_studies.reproduction.emulated import why_not


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
    """Do everything, write it into `out`; returns the page."""
    scale = Scale() if scale is None else scale
    prepare_directory(out)
    with _step(1, "building the FMUs"):
        fmus = steps.build_fmus()
    with _step(2, "tuning the controller through the FMU, and trying it on other plants"):
        session = steps.tune(fmus, out / "tune", evaluations=scale.evaluations, plants=scale.plants)
    with _step(3, "running the search as printed, corrected, and ours"), Progress("searches") as progress:
        race = steps.race(fmus, out, seeds=range(scale.seeds), evaluations=scale.evaluations, report=progress.update)
    with _step(4, "laying the model over a record"):
        overlaid = steps.overlay(fmus, out, seed=session.settings.seed)
    reason = why_not()
    story = None
    if not reason:
        with _step(5, "running on the emulated bench, diagnosing the run, tuning again, running again"):
            story = on_the_bench(session, out)
    with _step(6, "writing the page"):
        page = out / "index.html"
        told = missing_section(reason) if story is None else bench_section(story)
        write_atomically(page, render(tell(session, race, overlaid, told)))
    print_table("ours beside the paper's, step of 10 µm", COLUMNS, summary_rows(session))
    if story is None:
        step(f"left out, the emulated bench: {reason}")
    else:
        sys.stdout.write(f"\n{verdict(story)}\n")
        figures = compared(story.before, story.after)
        print_table("before and after", BENCH_COLUMNS, [x.cells for x in figures])
        sys.stdout.write(f"{balance(figures)}\n{beside_dead_time(story)}\n")
    return page


STEPS = 6


@contextmanager
def _step(number: int, title: str) -> Iterator[None]:
    step(f"[{number}/{STEPS}] {title}")
    began = time.monotonic()
    yield
    step(f"[{number}/{STEPS}] done in {time.monotonic() - began:.1f} s")
