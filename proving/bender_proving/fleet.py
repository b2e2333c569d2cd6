"""Records of many units of one design, as a maker's test bench would write them; the truth lies in a file of its own.

Each unit hides one to three effects of spread sizes, and reads with a gain of its own. One batch is bad: the material
of all its units saturates. The gain of the bench falls from one day on. One file in twenty is broken.
"""

import csv
import io
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
from numpy.random import Generator

from bender_loop.errors import InputError
from bender_loop.records.record import Record, write_record
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_proving.bench import Bench, stream
from bender_proving.cases.case import Case, identified
from bender_proving.cases.draw import DrawError, draw_hidden
from bender_proving.cases.effects import effect
from bender_proving.records.excitations import rich

MANIFEST, TRUTH, RECORDS = "manifest.csv", "truth.json", "records"
MOST_UNITS, SHORTEST_S, LONGEST_S = 100_000, 20.0, 170.0

EFFECTS = (
    "creep", "transport_delay", "rate_independent_hysteresis", "thermal_drift", "periodic_disturbance",
    "supply_quantisation", "dead_zone", "slew_limit",
)  # fmt: skip
"""What a unit may hide beside what its batch has: what a camera sees in a short record."""
SLOW = {"creep", "thermal_drift"}
"""A unit has one of these at most: in a record of some tens of seconds nobody can distinguish two slow motions."""
HOW_MANY = {1: 0.7, 2: 0.25, 3: 0.05}
BATCHES, BAD_BATCH, BAD_EFFECT = 8, "B5", "saturation"
FIRST_DAY, DAYS, DRIFT_FROM = date(2026, 1, 5), 120, 40
GAIN_AT_END, GAIN_SPREAD = 0.85, 0.02
BROKEN_SHARE, LEAST_OVER_NOISE, _DRAWS = 0.05, 8.0, 20


@dataclass(frozen=True, slots=True)
class FleetSettings:
    """What is drawn.

    Attributes:
        units: how many.
        seed: the same seed gives the same records.
        seconds: of each record, at 30 rows a second.

    Raises:
        InputError: a value is out of its range.
    """

    units: int = 200
    seed: int = 0
    seconds: float = 40.0

    def __post_init__(self) -> None:
        if not 1 <= self.units <= MOST_UNITS:
            raise InputError(f"--units: found {self.units}, expected 1 to {MOST_UNITS}")
        if self.seed < 0:
            raise InputError(f"--seed: found {self.seed}, expected 0 or more")
        if not SHORTEST_S <= self.seconds <= LONGEST_S:
            raise InputError(f"--seconds: found {self.seconds:g}, expected {SHORTEST_S:g} to {LONGEST_S:g}")


@dataclass(frozen=True, slots=True)
class DrawnUnit:
    """One unit.

    Attributes:
        name: of the unit.
        case: what it hides, and its gain.
        day: on which it was tested.
        batch: that it is from.
        broken: what is wrong with its file, "" where nothing is.
        seconds: of its record.
    """

    name: str
    case: Case
    day: date
    batch: str
    broken: str
    seconds: float

    def record(self) -> Record:
        """Return what the bench recorded of the unit."""
        bench = Bench(self.case)
        return bench.record(rich("camera", _played(self.case), self.seconds), bench.noise())


def draw_unit(settings: FleetSettings, number: int) -> DrawnUnit:
    """Return one unit of a fleet; it does not depend on how many there are, but for its day.

    Raises:
        DrawError: nothing that was drawn shows in the record.
    """
    entropy = (settings.seed << 20) + number
    rng = stream(entropy, "fleet")
    batch = f"B{1 + int(rng.integers(BATCHES))}"
    day = int(number * DAYS / settings.units)
    late = max(0, day - DRIFT_FROM) / (DAYS - DRIFT_FROM)
    gain = float(1.0 - late * (1.0 - GAIN_AT_END) + GAIN_SPREAD * rng.standard_normal())
    broken = BREAKS[int(rng.integers(len(BREAKS)))][0] if rng.random() < BROKEN_SHARE else ""
    blank = Case("", "pair", (), settings.seed, "camera", gain=gain, entropy=entropy)
    plan = rich("camera", _played(blank), settings.seconds)
    for _ in range(_DRAWS):
        try:
            hidden = draw_hidden(_names(rng, batch), plan, "camera", rng, LEAST_OVER_NOISE)
        except DrawError:
            continue
        case = identified(replace(blank, effects=hidden))
        return DrawnUnit(
            f"unit-{number + 1:04d}", case, FIRST_DAY + timedelta(days=day), batch, broken, settings.seconds
        )
    raise DrawError(f"unit {number}: nothing drawn shows in {settings.seconds:g} s; use longer records")


def write_fleet(settings: FleetSettings, out: Path, tell: Callable[[int, int], None] = lambda *_: None) -> Path:
    """Write the records, the manifest, and the truth beside them; return the manifest.

    Raises:
        InputError: the directory is not empty or cannot be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out}: found files, expected an empty directory; choose another one with --out")
    prepare_directory(out)
    prepare_directory(out / RECORDS)
    truth: dict[str, object] = {}
    lines = [("unit", "record", "date", "batch", "operator")]
    for number in range(settings.units):
        unit = draw_unit(settings, number)
        path = out / RECORDS / f"{unit.name}.csv"
        write_record(path, unit.record())
        if unit.broken:
            dict(BREAKS)[unit.broken](path)
        lines.append((unit.name, f"{RECORDS}/{path.name}", unit.day.isoformat(), unit.batch, f"shift {1 + number % 3}"))
        truth[unit.name] = _truth(unit)
        tell(number + 1, settings.units)
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(lines)
    write_atomically(out / TRUTH, json.dumps({"bad_batch": BAD_BATCH, "units": truth}, indent=1) + "\n")
    write_atomically(out / MANIFEST, text.getvalue())
    return out / MANIFEST


def _played(case: Case) -> Generator:
    return stream(case.entropy, "excitation")


def _names(rng: Generator, batch: str) -> tuple[str, ...]:
    """Return effects of different stages; what the batch has comes first."""
    count = int(rng.choice(list(HOW_MANY), p=list(HOW_MANY.values())))
    names = [BAD_EFFECT] if batch == BAD_BATCH else []
    for name in rng.permutation(np.array(EFFECTS)).tolist():
        fits = effect(name).stage not in {effect(x).stage for x in names} and not (name in SLOW and SLOW & set(names))
        if len(names) < count and fits:
            names.append(name)
    return tuple(names)


def _truth(unit: DrawnUnit) -> dict[str, object]:
    return {
        "effects": [
            {"id": x.id, "form": x.form, "magnitude": x.magnitude, "parameters": dict(x.parameters)}
            for x in unit.case.effects
        ],
        "gain": unit.case.gain,
        "batch": unit.batch,
        "date": unit.day.isoformat(),
        "broken": unit.broken,
    }


def _cut(path: Path) -> None:
    """Leave the header and a few rows, as a disk that was full."""
    write_atomically(path, "\n".join(path.read_text(encoding="utf-8").splitlines()[:12]) + "\n")


def _without_column(path: Path) -> None:
    """Leave the voltage out."""
    rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    write_atomically(path, "".join(f"{row[0]},{row[2]}\n" for row in rows))


def _with_text(path: Path) -> None:
    """Put a word where a number belongs."""
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[len(lines) // 2] = "overflow,overflow,overflow"
    write_atomically(path, "\n".join(lines) + "\n")


def _dead_sensor(path: Path) -> None:
    """Let the sensor read one value all the time."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    write_atomically(path, "\n".join([lines[0], *(f"{row[0]},{row[1]},0.0" for row in rows)]) + "\n")


BREAKS: tuple[tuple[str, Callable[[Path], None]], ...] = (
    ("cut", _cut),
    ("column", _without_column),
    ("text", _with_text),
    ("sensor", _dead_sensor),
    ("lost", Path.unlink),
)
"""What goes wrong with files; the last one is in the manifest and not on the disk."""
