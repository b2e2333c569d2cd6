"""Workers against one worker, and a unit in a fleet against the same diagnosis alone."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bender_compiled.parallel_map import THREADS
from bender_fleet.asked import task_of
from bender_fleet.cluster.settings import ClusterSettings
from bender_fleet.results.tables import TIME_TABLE
from bender_fleet.run import How, run_fleet
from bender_fleet.sources.units import Unit, find_units
from bender_loop.errors import RunError

ASKED = {
    "action": "diagnose", "model": None, "fmu": None, "input": None, "output": None, "set": {}, "suspect": [],
    "input_hold": "hold", "untimed": False, "columns": None, "units": None, "delimiter": None, "decimal": None,
    "encoding": None,
    "skip_rows": None, "no_header": False, "start": "auto", "confidence": 0.99, "highest_voltage": None,
    "reports": False,
}  # fmt: skip
_ALONE = """
import sys, tempfile, time
from pathlib import Path
from threadpoolctl import threadpool_limits
from bender_inference.records.checks import read_model
from bender_discrepancy.workflow import diagnose
from bender_loop.records.record import read_record
with threadpool_limits(1):
    for name in sys.argv[1:]:
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            diagnose(read_model("paper"), [read_record(Path(name))]).write(Path(folder), report=False)
        print(time.perf_counter() - began, flush=True)
"""


@dataclass(frozen=True, slots=True)
class Speed:
    """Times of the same units, in seconds.

    Attributes:
        units: how many.
        one: wall time with one worker, from the first unit handed out to the last answer.
        two: with two workers.
        in_fleet: of each unit in the fleet of one worker, but for the first.
        alone: of the same units, one after the other in one thread of one process without a cluster, but for the first.
    """

    units: int
    one: float
    two: float
    in_fleet: tuple[float, ...]
    alone: tuple[float, ...]

    @property
    def gain(self) -> float:
        """How many times as fast two workers are."""
        return self.one / self.two

    @property
    def overhead(self) -> float:
        """What a unit costs more in a fleet, as a share."""
        return sum(self.in_fleet) / sum(self.alone) - 1.0


def readable_units(manifest: Path, count: int) -> list[Unit]:
    """Return the first units of an example whose record is whole."""
    import json

    told = json.loads((manifest.parent / "truth.json").read_text(encoding="utf-8"))["units"]
    return [x for x in find_units([str(manifest)]) if not told[x.name]["broken"]][:count]


def measure_speed(units: list[Unit], out: Path, tell: Callable[[str], None]) -> Speed:
    """Diagnose units with one worker, with two, and alone."""
    tell("alone, without a cluster")
    alone = _alone(units)
    tell("one worker")
    one = _run(units, 1, out / "one")
    tell("two workers")
    two = _run(units, 2, out / "two")
    times = _times(out / "one")
    return Speed(len(units), one, two, tuple(times[x.name] for x in units[1:]), alone[1:])


def _alone(units: list[Unit]) -> tuple[float, ...]:
    command = [sys.executable, "-P", "-c", _ALONE, *(x.records[0] for x in units)]
    # a worker of a fleet computes in one thread, since its neighbours have the other processors
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | {THREADS: "1"})
    if done.returncode:
        raise RunError(f"a diagnosis alone failed: {done.stderr.strip().splitlines()[-1:]}")
    return tuple(float(x) for x in done.stdout.split())


def _run(units: list[Unit], workers: int, out: Path) -> float:
    how = How(ClusterSettings(workers=workers), out, force=True)
    return run_fleet("diagnose", units, task_of(ASKED), how, ASKED, lambda _: None).seconds


def _times(out: Path) -> dict[str, float]:
    import pyarrow.parquet as pq

    return {x["unit"]: x["seconds"] for x in pq.read_table(out / TIME_TABLE).to_pylist()}
