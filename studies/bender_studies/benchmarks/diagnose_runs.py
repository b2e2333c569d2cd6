"""Records to time `bender diagnose` on, and runs of it in processes of their own."""

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bender_loop.errors import RunError

# what is hidden in the records that are timed: something of every stage, and nothing
CAMERA = (
    ("single", ("rate_independent_hysteresis",)),
    ("single", ("source_resistance",)),
    ("single", ("thermal_drift",)),
    ("single", ("lens_distortion",)),
    ("nothing", ()),
)
# of as many stages as effects
SEVERAL = {
    "pair": ("pair", ("source_resistance", "rate_independent_hysteresis")),
    "triple": ("several", ("transport_delay", "creep", "lens_distortion")),
    "five": (
        "several",
        ("source_resistance", "saturation", "structural_damping", "thermal_drift", "lens_distortion"),
    ),
}
VIBROMETER = ("single", ("structural_damping",))
GROWING = ("single", ("rate_independent_hysteresis",))
VIBROMETER_ROWS = 32_000

_PEAK = "bender-benchmark-peak-MB:"


@dataclass(frozen=True, slots=True)
class Run:
    """One run of `bender diagnose`: how long its process took, and worked, the most memory it held, what it found."""

    record: str
    rows: int
    seconds: float
    processor_s: float
    peak_MB: float | None
    verdict: str
    effects: tuple[str, ...]

    def to_dict(self) -> dict[str, object]:
        """Return the run as JSON has it."""
        return asdict(self)


def write_camera_record(path: Path, kind: str, hidden: Sequence[str], seed: int) -> Path:
    """Write the usual record of a case before the camera: about 170 s at 30 rows a second."""
    from bender_loop.records.record import write_record
    from bender_proving import Bench, make_case

    bench = Bench(make_case(kind, hidden, seed, sensor="camera"))  # pyright: ignore[reportArgumentType]
    write_record(path, bench.record(bench.excitation(), bench.noise()))
    return path


def write_long_record(path: Path, kind: str, hidden: Sequence[str], seed: int, sensor: str, rows: int) -> Path:
    """Write a record of so many rows: one rich excitation of the bench after the other."""
    import numpy as np

    from bender_loop.records.record import Record, write_record
    from bender_proving import Bench, make_case

    bench = Bench(make_case(kind, hidden, seed, sensor=sensor))  # pyright: ignore[reportArgumentType]
    plan = bench.excitation()
    step_s = float(np.median(np.diff(plan.time_s)))
    pieces = [plan.voltage_V[plan.recorded]]
    while sum(piece.size for piece in pieces) < rows:
        plan = bench.excitation(len(pieces))
        pieces.append(plan.voltage_V[plan.recorded])
    voltage_V = np.concatenate(pieces)[:rows]
    record = bench.play(step_s * np.arange(rows), voltage_V, bench.noise(1), 1)
    write_record(path, Record(record.time_s[:rows], record.voltage_V[:rows], record.displacement_um[:rows]))
    return path


def write_beginning(path: Path, of: Path, rows: int) -> Path:
    """Write the first rows of a record."""
    with of.open(encoding="utf-8") as lines, path.open("w", encoding="utf-8") as out:
        out.writelines(line for _, line in zip(range(rows + 1), lines, strict=False))
    return path


def timed(record: Path, cache: Path) -> Run:
    """Diagnose a record in a fresh process that keeps its compiled code in a directory."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-P", "-m", __name__, "diagnose", str(record), "--out", folder + "/out"]
        begin, worked = time.perf_counter(), _children_s()
        child = subprocess.run(command, env=_with_cache(cache), capture_output=True, text=True, check=False)
        seconds, worked = time.perf_counter() - begin, _children_s() - worked
        if child.returncode:
            raise RunError(
                f"{record.name}: bender diagnose ended with {child.returncode}: {child.stderr.strip()[-300:]}"
            )
        result = json.loads((Path(folder) / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    effects = tuple(x["id"] for x in result["effects"])
    rows = sum(x["rows"] for x in result["records"])
    return Run(record.stem, rows, seconds, worked, _peak_MB(child.stderr), result["verdict"], effects)


def _children_s() -> float:
    """Return the processor time of the children that have ended."""
    spent = os.times()
    return spent.children_user + spent.children_system


def _with_cache(folder: Path) -> Mapping[str, str]:
    """Return an environment in which everything that is compiled goes to a directory.

    The interpreter keeps its own byte code where it usually does, whatever it is told here.
    """
    places = {"XDG_CACHE_HOME": folder, "LOCALAPPDATA": folder, "NUMBA_CACHE_DIR": folder / "numba"}
    known = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return known | {name: str(place) for name, place in places.items()}


def _peak_MB(said: str) -> float | None:
    found = [line.removeprefix(_PEAK) for line in said.splitlines() if line.startswith(_PEAK)]
    value = float(found[-1]) if found else math.nan
    return value if math.isfinite(value) else None


def _own_peak_MB() -> float:
    """Return the most memory that this process held, as Linux tells it (rusage counts what its parent held)."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return math.nan
    return next((float(line.split()[1]) / 1024.0 for line in lines if line.startswith("VmHWM:")), math.nan)


def _run() -> int:
    from importlib import import_module
    from importlib.metadata import entry_points

    # the program as it is installed: no room knows the command line above it
    (program,) = entry_points(group="console_scripts", name="bender")
    status = import_module(f"{program.module.rpartition('.')[0]}.main").main(sys.argv[1:])
    sys.stderr.write(f"{_PEAK}{_own_peak_MB():.1f}\n")
    return status


if __name__ == "__main__":
    sys.exit(_run())
