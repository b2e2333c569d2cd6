"""Thousands of units that only sleep: what scheduling costs, whether the client's memory grows, what the page takes."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bender_fleet.cluster.settings import ClusterSettings
from bender_fleet.page.page import write_page
from bender_fleet.run import How, run_fleet
from bender_loop.errors import RunError
from bender_studies.fleet.stand_in import SLEEP_S, task, units

_PATIENCE_S = 60.0


@dataclass(frozen=True, slots=True)
class Scheduled:
    """What a run of sleeping units came to.

    Attributes:
        units: how many.
        workers: processes.
        seconds: from the first unit handed out to the last answer.
        cost_ms: of a unit beside its sleep, in time of the whole run.
        memory_MB: of the client, resident, after a tenth of the units and at the end.
        page_s: to make the page.
        page_MB: its size.
    """

    units: int
    workers: int
    seconds: float
    cost_ms: float
    memory_MB: tuple[float, float]
    page_s: float
    page_MB: float


def scheduled(count: int, workers: int, out: Path, cluster: ClusterSettings | None = None) -> Scheduled:
    """Run sleeping units through a fleet, on this machine unless a cluster is named."""
    from distributed.system_monitor import SystemMonitor

    monitor = SystemMonitor()

    def memory_MB() -> float:
        return float(monitor.update()["memory"]) / 1e6

    def silent(_: str) -> None:
        return

    how = How(cluster or ClusterSettings(workers=workers), out)
    first = run_fleet("diagnose", units(count // 10), lambda _: task(), how, {}, silent)
    before = memory_MB()
    count_all = run_fleet("diagnose", units(count)[first.units :], lambda _: task(), how, {}, silent)
    after = memory_MB()
    began = time.perf_counter()
    page = write_page(out, "diagnose")
    page_s = time.perf_counter() - began
    cost_s = count_all.seconds / count_all.new - SLEEP_S / workers
    return Scheduled(
        count_all.new, workers, count_all.seconds, 1e3 * cost_s, (before, after), page_s, page.stat().st_size / 1e6
    )


@contextmanager
def cluster_of_processes(workers: int, folder: Path, options: Sequence[str] = ()) -> Iterator[ClusterSettings]:
    """Give a scheduler and workers in processes of their own, found by a scheduler file.

    Args:
        workers: how many.
        folder: of the file, and of what the workers put on the disk.
        options: of `dask scheduler` and `dask worker` alike.

    Raises:
        RunError: they do not start.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    dask = [sys.executable, "-P", "-m", "distributed.cli.dask_scheduler"]
    common = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": {**os.environ, "OMP_NUM_THREADS": "1"}}
    where = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    begun = [subprocess.Popen([*dask, *where, *options], **common)]
    try:
        _until(file.is_file, "the scheduler")
        worker = [
            sys.executable,
            "-P",
            "-m",
            "distributed.cli.dask_worker",
            "--scheduler-file",
            str(file),
            "--nthreads",
            "1",
        ]
        begun += [
            subprocess.Popen([*worker, "--no-dashboard", "--local-directory", str(folder), *options], **common)
            for _ in range(workers)
        ]
        yield ClusterSettings(scheduler_file=file)
    finally:
        for process in reversed(begun):
            process.terminate()
        for process in begun:
            process.wait(timeout=_PATIENCE_S)


def _until(there: object, what: str) -> None:
    assert callable(there)
    end = time.monotonic() + _PATIENCE_S
    while not there():
        if time.monotonic() > end:
            raise RunError(f"{what} did not start within {_PATIENCE_S:g} s")
        time.sleep(0.1)
