"""Units that sleep and then say something like a diagnosis, and a cluster of processes: a fleet without its work."""

import os
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bender_fleet.cluster.settings import ClusterSettings
from bender_fleet.run import Task
from bender_fleet.sources.units import Unit
from bender_fleet.work.job import UnitResult
from bender_loop.errors import InputError, RunError
from bender_loop.shell.files import write_atomically

SLEEP_S = 0.02
EFFECTS = (
    "creep", "transport_delay", "rate_independent_hysteresis", "thermal_drift", "periodic_disturbance",
    "supply_quantisation", "dead_zone", "slew_limit", "saturation", "sensor_lag", "charge_leakage", "backlash",
)  # fmt: skip
BATCHES = 12
_PATIENCE_S = 60.0


@dataclass(frozen=True, slots=True)
class Sleeping:
    """Sleeps, then answers what the name of the unit gives.

    Attributes:
        sleep_s: how long.
        fatal: records that end the process that works on them, as a crash of a library does.
        log: a folder that gets a file with the worker's process id each time a unit is begun; None for none.
    """

    sleep_s: float = SLEEP_S
    fatal: tuple[str, ...] = ()
    log: str | None = None

    def do(self, paths: Sequence[Path], names: Sequence[str]) -> UnitResult:
        """Return a row as a diagnosis has it; see `bender_fleet.work.job.Work`."""
        if self.log is not None:
            write_atomically(Path(self.log) / f"{names[0]}.{secrets.token_hex(4)}", str(os.getpid()))
        time.sleep(self.sleep_s)
        if names[0] in self.fatal:
            os.kill(os.getpid(), signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
        number = int(names[0].rpartition("-")[2])
        return _said(np.random.default_rng(number), number)


def units(count: int) -> list[Unit]:
    """Return units whose records are nowhere; nobody reads them."""
    return [
        Unit(
            f"unit-{k:05d}", (f"none-{k}",), None, f"2026-{1 + k * 9 // count:02d}-{1 + k % 28:02d}", f"B{k % BATCHES}"
        )
        for k in range(count)
    ]


def task(work: Sleeping | None = None) -> Task:
    """Return the work of every unit; how long it sleeps is no part of its key."""
    return Task(work or Sleeping(), {"stand_in": True}, "paper")


def _said(rng: np.random.Generator, number: int) -> UnitResult:
    if rng.random() < 0.05:
        raise InputError(f"none-{number}, line 3, column voltage_V: no such column; name it with --columns")
    names = [str(x) for x in rng.choice(EFFECTS, int(rng.integers(1, 4)), replace=False)]
    if number % BATCHES == 4:
        names = ["saturation", *(x for x in names if x != "saturation")]
    verdict = str(rng.choice(["named", "named", "named", "named", "ambiguous", "unexplained", "recalibrated"]))
    if verdict in ("unexplained", "recalibrated"):
        names = []
    before, after = float(rng.lognormal(0.5, 0.6)), float(0.06 * rng.lognormal(0.0, 0.1))
    row: dict[str, Any] = {
        "verdict": verdict, "complete": verdict == "named", "effects": names,
        "sentence": f"The model lacks {', '.join(names) or 'nothing'}: {before:.3g} µm of gap become {after:.3g} µm",
        "before_um": 1.4 * before, "recalibrated_um": before, "after_um": after, "noise_floor_um": 0.06,
        "after_percent": 0.3, "gain": float(rng.normal(1.0 - 2e-6 * number, 0.02)), "offset_um": 0.0,
        "next_experiment": "Hold 30 V for 60 s." if verdict == "ambiguous" else None,
        "has_model": False, "warnings": [],
    }  # fmt: skip
    effects = [
        {
            "effect": x, "stage": "material", "certain": verdict == "named", "share_of_gap": float(rng.uniform(0.2, 1)),
            "rivals": [], "evidence": "a stand-in", "parameters": [
                {"name": "size", "value": float(rng.lognormal()), "std": 0.01, "unit": "1"},
                {"name": "time_s", "value": float(rng.uniform(1, 9)), "std": 0.1, "unit": "s"},
            ],
        }
        for x in names
    ]  # fmt: skip
    return UnitResult(row, effects)


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
    # the workers find this module as well
    path = os.pathsep.join([str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    dask = [sys.executable, "-P", "-m", "distributed.cli.dask_scheduler"]
    common = {
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "env": os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": path},
    }
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
