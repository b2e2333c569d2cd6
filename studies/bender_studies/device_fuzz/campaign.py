"""Devices drawn at random through `bender model fit` and `bender diagnose`, each in a process with a time limit.

What is counted: faults (a traceback, a status that is none of ours, a complaint that is no sentence), hangs, noise of
libraries on the standard output or the standard error, names called certain that are not in the device, and corrected
models that predict a second record worse than the first model does.
"""

import contextlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bender_loop.records.record import read_record
from bender_plant.model import ModelError, load_model
from bender_proving.devices.record import Strange, draw
from bender_studies.benchmarks.second_record import left_about_mean_um

LIMIT_S = 120.0
WORSE = 1.1
"""Times the error of the first model on the second record, from which on a corrected model is worse."""
ROUNDING = 1e-9
"""Of the range of the readings: no error of a model."""
_REFUSED = 2


@dataclass(slots=True)
class Tried:
    """What came of one device.

    Attributes:
        seed: of the device.
        kinds: what is in it.
        outcome: the verdict, or "refused" where a record was refused in a sentence.
        certain: names that were called certain.
        false: those of them that are not in it.
        faults, hangs, noise: a sentence each.
        worse: how many times the error on the second record has grown, where it has.
        told: every effect, with its grade, its probability, what that follows from, and whether it is in the device.
    """

    seed: int
    kinds: tuple[str, ...]
    outcome: str = ""
    certain: list[str] = field(default_factory=list)
    false: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    hangs: list[str] = field(default_factory=list)
    noise: list[str] = field(default_factory=list)
    worse: float | None = None
    told: list[dict[str, Any]] = field(default_factory=list)

    @property
    def complaints(self) -> list[str]:
        """Return a line for each thing that should not be."""
        who = f"device {self.seed} ({', '.join(self.kinds) or 'a gain'})"
        told = [f"{who}: {x}" for x in [*self.faults, *self.hangs, *self.noise]]
        told += [f"{who}: {x} is called certain" for x in self.false]
        return told + ([] if self.worse is None else [f"{who}: the corrected model is {self.worse:.2g} times worse"])


def try_devices(count: int, seed: int, processes: int, limit_s: float = LIMIT_S) -> Generator[Tried, None, None]:
    """Yield what came of devices of consecutive seeds; one that is closed begins no further device.

    Args:
        count: of devices.
        seed: of the first.
        processes: at a time.
        limit_s: for each command.
    """
    pool = ThreadPoolExecutor(processes)
    try:
        yield from pool.map(lambda k: try_device(draw(seed + k), limit_s), range(count))
    finally:
        pool.shutdown(cancel_futures=True)


def try_device(strange: Strange, limit_s: float = LIMIT_S) -> Tried:
    """Return what came of one device."""
    tried = Tried(strange.seed, strange.device.kinds)
    with TemporaryDirectory() as folder:
        place = Path(folder)
        for number, name in enumerate(("first.csv", "second.csv")):
            strange.write(place / name, number)
        fitted = _command(tried, ["model", "fit", "first.csv", "--out", "first.toml"], place, limit_s)
        if fitted is None:
            return tried
        words = ["diagnose", "first.csv", "--model", "first.toml", "--out", "out"]
        answer = _command(tried, words, place, limit_s)
        if answer is None:
            return tried
        tried.outcome = str(answer.get("verdict"))
        right = strange.device.right_names
        tried.told = [
            {key: x.get(key) for key in ("id", "grade", "probability", "weighed")} | {"is_there": x["id"] in right}
            for x in answer.get("effects", [])
        ]
        tried.certain = [x["id"] for x in tried.told if x["grade"] == "certain"]
        tried.false = [x for x in tried.certain if x not in right]
        if (place / "out" / "model.toml").is_file():
            tried.worse = _worse(place)
    return tried


def _worse(place: Path) -> float | None:
    """Return how many times the error on the second record, about its mean, has grown; None where it has not."""
    second = read_record(place / "second.csv")
    errors = []
    for model in ("first.toml", "out/model.toml"):
        try:
            errors.append(left_about_mean_um(load_model(place / model), second))
        except ModelError:
            errors.append(math.inf)
    readings = second.displacement_um[np.isfinite(second.displacement_um)]
    # a device without noise is simulated to the rounding of its file
    first, corrected = max(errors[0], ROUNDING * float(np.ptp(readings))), errors[1]
    return corrected / first if corrected > WORSE * first else None


def _command(tried: Tried, words: Sequence[str], place: Path, limit_s: float) -> dict[str, Any] | None:
    """Return what a command prints under --json; None where it does not come to an end as it should."""
    name = " ".join(words[:2]) if words[0] == "model" else words[0]
    command = [sys.executable, "-P", "-m", "bender_cli", *words, "--json", "--quiet"]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(command, cwd=place, env=environment, capture_output=True, timeout=limit_s, check=False)
    except subprocess.TimeoutExpired:
        tried.hangs.append(f"{name}: no end within {limit_s:g} s")
        return None
    said = done.stderr.decode("utf-8", "replace").splitlines()
    if done.returncode == _REFUSED and len(said) == 1 and said[0].startswith("bender"):
        tried.outcome = "refused"
        return None
    if done.returncode != 0:
        tried.faults.append(f"{name}: status {done.returncode}: {' | '.join(said[-2:])[:300]}")
        return None
    tried.noise += [f"{name}: {line[:200]}" for line in said]
    with contextlib.suppress(ValueError):
        return json.loads(done.stdout)
    tried.noise.append(f"{name}: the standard output is no JSON: {done.stdout[:200]!r}")
    return None
