"""What an investigation has played, by the journals of its runs and by the log of the supply: is any row in it twice?

A profile that was cut off goes on in a play of its own, `01-rest`, `02-rest-rest`, …, which is led from 0 V to where
the rows go on. Rows at 0 V are not counted: every play begins and ends there.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_hil.log.read_run import RUN, RunLog, read_run
from bender_hil.runner.voltages import Voltages, read_profile_file

PROFILE = "profile.csv"
LEVEL_SLACK_V = 0.005
"""The supply is told three decimals."""
_KNOWN_S = 1.0
"""A level is taken this long after it was sent, at the latest."""


@dataclass(frozen=True, slots=True)
class PlayedRows:
    """What was played.

    Attributes:
        rows: of profiles, that reached the supply.
        twice: a sentence for every play that repeats something.
        levels: that the supply has taken in a play, other than 0 V.
        unknown: of those, how many no journal knows.
    """

    rows: int
    twice: tuple[str, ...]
    levels: int
    unknown: int


def played_rows(out: Path, rate_Hz: float, arrivals: Sequence[tuple[float, float]]) -> PlayedRows:
    """Hold the plays of an investigation to each other and to the log of the supply.

    Args:
        out: directory of the investigation.
        rate_Hz: of the rows.
        arrivals: levels that the supply has taken: time in s, V.
    """
    folders = sorted(x for x in out.glob("[0-9][0-9]-*") if (x / RUN).exists() and b"\n" in (x / RUN).read_bytes())
    logs = {x: read_run(x) for x in folders}
    families: dict[str, list[Path]] = {}
    twice: list[str] = []
    for folder in folders:
        name = re.sub(r"^\d+-", "", folder.name)
        if (folder / PROFILE).exists():
            families.setdefault(re.sub(r"(-rest)+$", "", name), []).append(folder)
        elif others := [x for x in folders if x < folder and re.sub(r"^\d+-", "", x.name) == name]:
            twice.append(f"{folder.name} repeats {others[0].name}")
    count = 0
    for parts in families.values():
        rows, complaints = _family(parts, logs, rate_Hz)
        count += rows
        twice += complaints
    levels, unknown = _levels(list(logs.values()), arrivals)
    return PlayedRows(count, tuple(twice), levels, unknown)


def _family(parts: Sequence[Path], logs: dict[Path, RunLog], rate_Hz: float) -> tuple[int, list[str]]:
    """Return how many rows of one profile were played, and what was played twice of it."""
    whole = _rows(parts[0], rate_Hz)
    played = np.zeros(whole.size, dtype=int)
    complaints = []
    for part in parts:
        rows = _rows(part, rate_Hz)
        begin = whole.size - _common_end(rows, whole)
        last = _last_row(logs[part], rate_Hz) - (rows.size - (whole.size - begin))
        mine = np.zeros(whole.size, dtype=int)
        mine[begin : max(begin, begin + last + 1)] = 1
        again = np.flatnonzero((played > 0) & (mine > 0) & (whole != 0.0))
        if again.size:
            complaints.append(f"{part.name} plays {again.size} rows again, the first at {again[0] / rate_Hz:.2f} s")
        played += mine
    return int(np.count_nonzero(played)), complaints


def _rows(folder: Path, rate_Hz: float) -> NDArray[np.float64]:
    found = read_profile_file(str(folder / PROFILE))
    assert isinstance(found, Voltages)
    # the last row only says when the profile is over
    times = np.arange(max(2, round(found.times_s[-1] * rate_Hz))) / rate_Hz
    return np.array([found.at(x) for x in times.tolist()])


def _common_end(one: NDArray[np.float64], other: NDArray[np.float64]) -> int:
    count = min(one.size, other.size)
    differs = np.flatnonzero(one[one.size - count :] != other[other.size - count :])
    return count if not differs.size else int(count - 1 - differs[-1])


def _last_row(log: RunLog, rate_Hz: float) -> int:
    """Return the last row of a run's own profile that was sent to the supply, -1 for none."""
    return math.floor(float(log.ticks[-1]["time_s"]) * rate_Hz + 1e-6) if log.ticks else -1


def _levels(logs: Sequence[RunLog], arrivals: Sequence[tuple[float, float]]) -> tuple[int, int]:
    """Return how many levels the supply took while plays were on, and how many of them no journal knows."""
    count = unknown = 0
    for k, log in enumerate(logs):
        begin_s = float(log.start["t"])
        later_s = float(logs[k + 1].start["t"]) if k + 1 < len(logs) else math.inf
        ramp = log.guard_entry("ramp")
        end_s = min(later_s, math.inf if ramp is None else float(ramp["t"]))
        sent = [(float(x["sent_s"]), float(x["command_V"])) for x in log.ticks]
        sent += [(float(x["command_time_s"]), float(x["voltage_V"])) for x in log.guard if x["kind"] == "applied"]
        times, volts = (np.array(x) for x in zip(*sorted(sent), strict=True)) if sent else (np.empty(0), np.empty(0))
        for when_s, level_V in arrivals:
            if begin_s <= when_s < end_s and level_V > LEVEL_SLACK_V:
                count += 1
                near = np.abs(times - when_s) < _KNOWN_S
                unknown += not bool(np.any(np.abs(volts[near] - level_V) <= LEVEL_SLACK_V))
    return count, unknown
