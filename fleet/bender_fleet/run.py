"""One run over a fleet: plan, schedule, merge, page."""

import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bender_fleet.cluster.settings import ClusterSettings
from bender_fleet.results.folder import open_folder, refuse_others, write_fleet
from bender_fleet.results.parts import find_part, part_path, write_part
from bender_fleet.results.tables import Planned, write_tables
from bender_fleet.sources.keys import folder_name, key_of
from bender_fleet.sources.places import bytes_of
from bender_fleet.sources.units import Unit
from bender_fleet.work.job import BROKEN, DONE, FAILED, Job, JobAnswer, Work, contents_of, killed, run_job
from bender_loop.shell.progress import Progress

if TYPE_CHECKING:
    from distributed import Client

_READERS = 8


class Task(NamedTuple):
    """What is done with a unit: the work, what its key is made of, and the name of the model."""

    work: Work
    known: dict[str, Any]
    model: str


@dataclass(frozen=True, slots=True)
class How:
    """How a fleet is run.

    Attributes:
        cluster: where.
        out: directory of the results.
        force: do all units, whatever an earlier run left.
        retry: do those again that failed.
        shared_disk: workers read the records and write the results themselves.
    """

    cluster: ClusterSettings
    out: Path
    force: bool = False
    retry: bool = False
    shared_disk: bool = True


@dataclass(slots=True)
class Count:
    """What a run came to.

    Attributes:
        units: in the fleet.
        kept: of an earlier run.
        new: that this run finished.
        statuses: how many units have which status, those of earlier runs among them.
        interrupted: by Ctrl-C.
        seconds: of wall time between the first unit handed out and the last answer.
    """

    units: int
    kept: int
    new: int = 0
    statuses: dict[str, int] = field(default_factory=dict)
    interrupted: bool = False
    seconds: float = 0.0

    @property
    def missing(self) -> int:
        """Units without a result."""
        return self.units - sum(self.statuses.values())


def plan(units: Sequence[Unit], task: Callable[[Unit], Task]) -> tuple[list[Planned], list[Task], list[int]]:
    """Return the units with their keys, what is done with each, and the bytes of their records."""
    tasks = [task(unit) for unit in units]

    def known(pair: tuple[Unit, Task]) -> tuple[str, int]:
        return key_of(pair[0].records, pair[1].known), sum(bytes_of(x) for x in pair[0].records)

    with Progress("reading records") as bar, ThreadPoolExecutor(_READERS) as pool:
        keys, sizes = [], []
        for found, size in pool.map(known, zip(units, tasks, strict=True)):
            keys.append(found)
            sizes.append(size)
            bar.update(len(keys), len(units))
    planned = [Planned(u, folder_name(u.name), k, t.model) for u, k, t in zip(units, keys, tasks, strict=True)]
    return planned, tasks, sizes


def largest_first(todo: Sequence[int], sizes: Sequence[int]) -> list[int]:
    """Return the units in the order in which they are handed out, those of the same size as they came.

    The last units of a fleet leave workers idle; they do so for the shorter, the less work is left in each (Graham,
    Bounds on multiprocessing timing anomalies, 1969).
    """
    return sorted(todo, key=lambda k: -sizes[k])


def run_fleet(
    action: str,
    units: Sequence[Unit],
    task: Callable[[Unit], Task],
    how: How,
    asked: dict[str, Any],
    say: Callable[[str], None],
) -> Count:
    """Do an action with all units that are new or changed, and write the tables.

    Args:
        action: diagnose, compare or identify.
        units: of the fleet.
        task: what is done with a unit.
        how: where it runs, and where the results go.
        asked: what `fleet.json` keeps of the command.
        say: is told a few lines.

    Returns:
        What came of it; complete results are written after an interrupt too.

    Raises:
        InputError: the output directory or the scheduler cannot be used; nothing was written.
        RunError: the workers cannot do the work at all.
    """
    from bender_fleet.cluster.connect import connected, dashboard

    refuse_others(how.out, action)
    how = replace(how, out=how.out.absolute())
    planned, tasks, sizes = plan(units, task)
    run = secrets.token_hex(6)
    todo = largest_first([k for k, x in enumerate(planned) if _is_open(how, x)], sizes)
    count = Count(len(planned), len(planned) - len(todo))
    told = {"action": action, "asked": asked, "run": run, "begun": datetime.now(UTC).isoformat(timespec="seconds")}
    if todo:
        with connected(how.cluster) as client:
            open_folder(how.out, told)
            say(f"{len(planned)} units: {len(todo)} to do, {count.kept} kept of an earlier run")
            link = dashboard(client, how.cluster)
            say(f"Dask dashboard: {link}" if link else "Dask dashboard: none (it needs bokeh)")
            _work_off(action, client, (_job(how, planned[k], tasks[k].work, run) for k in todo), len(todo), count, how)
    else:
        open_folder(how.out, told)
    count.statuses = write_tables(how.out, action, planned)
    write_fleet(how.out, told | {"units": count.units, "new": count.new, "kept": count.kept, **count.statuses})
    return count


def _work_off(action: str, client: "Client", jobs: Iterator[Job], total: int, count: Count, how: How) -> None:
    from bender_fleet.cluster.schedule import answers

    seen = {BROKEN: 0, FAILED: 0, DONE: 0}
    began = time.monotonic()
    try:
        with Progress(action) as bar:
            for answer in answers(client, jobs, do=run_job):
                seen[_taken(how, answer.job, answer.told, answer.reason)] += 1
                count.new += 1
                bar.update(count.new, total, _remark(count.new, total, time.monotonic() - began, seen))
    except KeyboardInterrupt:
        count.interrupted = True
    finally:
        count.seconds = time.monotonic() - began


def _taken(how: How, job: Job, told: JobAnswer | None, reason: str) -> str:
    """Write what the worker could not, and return the unit's status."""
    if told is None:
        write_part(how.out, job.folder, killed(job, reason), {})
        return FAILED
    if told.part is not None:
        write_part(how.out, job.folder, told.part, told.files)
    return told.status


def _remark(done: int, total: int, seconds: float, seen: dict[str, int]) -> str:
    rate = 60.0 * done / max(seconds, 1e-3)
    left_s = 60.0 * (total - done) / rate
    left = f"{left_s / 60.0:.0f} min" if left_s >= 90.0 else f"{left_s:.0f} s"
    shown = f"{rate:.0f}" if rate >= 100.0 else f"{rate:.3g}"
    return f"{shown} units/min, {left} left, {seen[BROKEN]} broken, {seen[FAILED]} failed"


def _is_open(how: How, planned: Planned) -> bool:
    if how.force or not part_path(how.out, planned.folder, planned.key).is_file():
        return True
    if not how.retry:
        return False
    part = find_part(how.out, planned.folder, planned.key)
    return part is None or part.status == FAILED


def _job(how: How, planned: Planned, work: Work, run: str) -> Job:
    own = how.shared_disk
    return Job(
        unit=planned.unit.name,
        folder=planned.folder,
        key=planned.key,
        run=run,
        records=planned.unit.records,
        work=work,
        out=str(how.out) if own else None,
        contents=None if own else contents_of(planned.unit.records),
        again=how.force or how.retry,
    )
