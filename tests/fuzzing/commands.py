"""`bender fmu check` and `bender tune` on a damaged FMU: an exit status and sentences, never more."""

import contextlib
import io
import math
import random
import tomllib
from pathlib import Path

from fuzzing.mutations import mutated
from fuzzing.program import installed

_TUNE = ("--evaluations", "4", "--duration", "0.2", "--setpoint", "3", "--exposure", "0", "--method", "random")
_BAD_INPUT = 2


def command_cases(fmu: Path, cases: int, seed: int, folder: Path) -> list[str]:
    """Check and tune so many damaged copies of an FMU in turn; return the complaints."""
    found: list[str] = []
    for k in range(cases):
        place = folder / str(k)
        place.mkdir()
        case = (check_case, tune_case)[k % 2]
        found += [f"{k}: {text}" for text in case(fmu.read_bytes(), random.Random(f"{seed} damaged {k}"), place)]
    return found


def check_case(fmu: bytes, random_numbers: random.Random, folder: Path) -> list[str]:
    """Check a damaged FMU; returns what should not have been."""
    path, done = _written(fmu, random_numbers, folder)
    # loading takes a hundred times as long as reading: a part of the cases runs the FMU as well
    words = ["fmu", "check", str(path)] + (["--no-run"] if random_numbers.random() < 0.85 else [])
    return [f"fmu check: {done}: {text}" for text in _complaints(words)]


def tune_case(fmu: bytes, random_numbers: random.Random, folder: Path) -> list[str]:
    """Tune against a damaged FMU; returns what should not have been."""
    path, done = _written(fmu, random_numbers, folder)
    out = folder / "out"
    found = _complaints(["tune", "--fmu", str(path), *_TUNE, "--out", str(out)], out)
    gains = out / "gains.toml"
    if gains.is_file() and not _finite(tomllib.loads(gains.read_text(encoding="utf-8"))):
        found.append("gains that are no numbers")
    return [f"tune: {done}: {text}" for text in found]


def _written(fmu: bytes, random_numbers: random.Random, folder: Path) -> tuple[Path, str]:
    damaged, done = mutated(fmu, random_numbers)
    path = folder / "damaged.fmu"
    path.write_bytes(damaged)
    return path, done


def _complaints(words: list[str], out: Path | None = None) -> list[str]:
    standard, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(standard), contextlib.redirect_stderr(errors):
        status = installed().main(words)
    said = errors.getvalue()
    found = []
    if status not in (0, 1, _BAD_INPUT):
        found.append(f"exit status {status}")
    if "Traceback" in said + standard.getvalue() or "a fault in bender itself" in said:
        found.append(f"an exception got out: {said.strip()[-400:]}")
    if status == _BAD_INPUT and len(said.splitlines()) != 1:
        found.append(f"bad input in {len(said.splitlines())} lines: {said[-400:]}")
    if status == _BAD_INPUT and out is not None and out.exists():
        found.append("bad input, and something was written")
    return found


def _finite(value: object) -> bool:
    if isinstance(value, dict):
        return all(_finite(item) for item in value.values())
    if isinstance(value, list):
        return all(_finite(item) for item in value)
    return not isinstance(value, float) or not math.isnan(value)
