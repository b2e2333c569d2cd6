"""Strange files for the commands beside diagnose, compare, identify and tune: every command that reads a file."""

import os
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fuzzing.hostile_files import special_file, strange_record, strange_settings
from fuzzing.mutations import mutated

Case = tuple[list[str], str]
Make = Callable[[Path, random.Random, Any], Case]

SIMULATE = ["simulate", "model.toml", "--gains", "gains.toml", "--duration", "0.3"]
WATCH = ["watch", "model.toml", "record.csv", "--replay", "--learn", "200", "--no-diagnosis"]
FIT_FMU = ["calibrate-model", "record.csv", "--fmu", "model.fmu", "--suspect", "tunable"]
_HARDWARE = ["--bench", "hardware.toml", "--out", "out"]
HARDWARE_RUN = ["hil", "--duration", "0.3", *_HARDWARE]
NOBODY = 'resource = "TCPIP::127.0.0.1::9::SOCKET"'
"""An address at which no supply answers: what is wrong with a bench file shows before, or a run fails at once."""
_LINES = (
    '{"time_s": 0.0}', "{}", "[]", "nonsense", "null", "\x00", "9" * 400, '{"kind": "start"}', '{"kind": "tick"}',
    '{"kind": "end", "status": 0}', '{"n": 0, "kind": "begin", "why": "x"}', '{"n": "x", "kind": 1}', "[" * 5000,
)  # fmt: skip


def strange_run(command: list[str], names: tuple[str, ...]) -> Make:
    """Return what makes a command that reads the folder of a run, an investigation or a fleet, with strange files."""

    def make(folder: Path, rng: random.Random, _: Any) -> Case:
        what = rng.choice(("lines", "lines", "lines", "bytes", "special", "empty", "folder"))
        run = folder / "run"
        if what == "folder":
            return command, f"run: {special_file(run, rng)}"
        run.mkdir()
        for name in rng.sample(names, rng.randrange(1, len(names) + 1)):
            if what == "special":
                special_file(run / name, rng)
            elif what == "bytes":
                (run / name).write_bytes(rng.randbytes(rng.choice((1, 100, 5000))))
            else:
                few = "" if what == "empty" else "\n".join(rng.choices(_LINES, k=rng.randrange(1, 6)))
                (run / name).write_text(few, encoding="utf-8")
        return command, f"run: {what}"

    return make


def with_one_strange(command: list[str], strange: str) -> Make:
    """Return what makes a command that reads sound files and one strange one, of the kind that its name tells."""

    def make(folder: Path, rng: random.Random, sound: Any) -> Case:
        sound_files(folder, sound, command)
        path = folder / strange
        path.unlink(missing_ok=True)
        if path.suffix == ".fmu":
            done = _strange_fmu(path, rng, sound)
        elif path.suffix == ".csv":
            done = strange_record(path, rng)
        else:
            done = strange_settings(path, rng, getattr(sound, path.stem))
        return list(command), f"{path.stem}: {done}"

    return make


def manifest(folder: Path, rng: random.Random, sound: Any) -> Case:
    """Make a fleet whose list of units has strange cells, or is something else."""
    command = ["fleet", "compare", "manifest.csv", "--model", "beam", "--workers", "1", "--out", "out"]
    sound_files(folder, sound, ["record.csv"])
    path = folder / "manifest.csv"
    if rng.random() < 0.3:
        return command, f"manifest: {special_file(path, rng)}"
    cells = ("record.csv", "no.csv", "", "\x00", "../..", "record.csv;no.csv", "a" * 400, "é", "nan", "1", "/dev/zero")
    head = rng.choice(("unit,record", "unit,unit", "record", "", "unit,record,model", "a,b", "unit,record,record"))
    rows = [f"{rng.choice(('1', '1', 'a/b', '', 'é', '..'))},{rng.choice(cells)}" for _ in range(rng.randrange(3))]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return command, f"manifest: {head}"


def odd_name(folder: Path, rng: random.Random, sound: Any) -> Case:
    """Make a command that reads a file whose name is no text, too long, or means something else elsewhere."""
    name = rng.choice((b"\xff\xfe.csv", b"a\nb.csv", b"-x.csv", b"\xc3.csv", b"%s{}.csv", b" .csv", b"*.csv", b"~.csv"))
    sound_files(folder, sound, ["record.csv", "model.fmu"])
    word = os.fsdecode(name)
    if rng.random() < 0.7 and os.name == "posix":
        (folder / word).write_bytes((folder / "record.csv").read_bytes()[: rng.choice((10, 2000))])
    command = rng.choice(
        (
            ["compare", word],
            ["model", "fit", word, "--out", "m.toml"],
            ["compare", "record.csv", "--model", word],
            ["compare", "record.csv", "--fmu", word],
            ["fmu", "check", word],
            ["compare", "record.csv", "--out", word],
            ["hil", "--bench", word, "--out", "out"],
            ["hil", "replay", word],
            ["watch", "beam", word, "--replay", "--no-diagnosis"],
            ["calibrate", word],
        )
    )
    return command, f"name: {word!a}"


def pictures(folder: Path, rng: random.Random, _: Any) -> Case:
    """Make a calibration by a picture that is none, or by points of a sensor that are none."""
    if rng.random() < 0.5:
        points = ("0:0", "1:10", "1:", ":", "nan:1", "1e999:0", "a:b", "0:0", "2:20:3", "1:1e308", "-5e-324:1", "x.csv")
        return ["calibrate", "--sensor", *rng.choices(points, k=rng.randrange(1, 5))], "points"
    path = folder / "ruler.png"
    head = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\xff\xff\x00\x00\xff\xff\x08\x00\x00\x00\x00"
    data = rng.choice((b"", head, head + rng.randbytes(300), rng.randbytes(3000), b"BM" + rng.randbytes(60), b"GIF89a"))
    if rng.random() < 0.3:
        return ["calibrate", "ruler.png"], f"picture: {special_file(path, rng)}"
    path.write_bytes(data)
    return ["calibrate", "ruler.png"], "picture: bytes"


def sound_files(folder: Path, sound: Any, words: list[str]) -> None:
    """Write those of the sound files that the words name."""
    count = 260 if "watch" in words else 80
    rows = [(k / 30, float(k % 20), 0.4 * (k % 20) + 0.01 * (k % 7)) for k in range(count)]
    text = "time_s,voltage_V,displacement_um\n" + "".join(f"{t!r},{v!r},{d!r}\n" for t, v, d in rows)
    files: dict[str, str | bytes] = {
        "record.csv": text,
        "training.csv": text,
        "profile.csv": "time_s,setpoint_um\n0.0,1.0\n0.1,2.0\n0.3,0.0\n",
        "model.toml": sound.model,
        "gains.toml": sound.gains,
        "bench.toml": sound.bench,
        "hardware.toml": sound.hardware,
        "model.fmu": sound.fmu,
    }
    for name, content in files.items():
        if name in words:
            (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def _strange_fmu(path: Path, rng: random.Random, sound: Any) -> str:
    if rng.random() < 0.15:
        return special_file(path, rng)
    damaged, done = mutated(sound.fmu, rng)
    path.write_bytes(damaged)
    return done


_RUN = ("run.jsonl", "guard.jsonl", "record.csv", "summary.json", "rescue.jsonl")
_FLEET = ("results.parquet", "results.csv", "fleet.json", "units", "manifest.csv")
FURTHER: tuple[Make, ...] = (
    with_one_strange(FIT_FMU, "record.csv"),
    with_one_strange(FIT_FMU, "model.fmu"),
    with_one_strange(["model", "fit", "record.csv", "--template", "gain+lag", "--out", "m.toml"], "record.csv"),
    with_one_strange(["model", "fit", "record.csv", "--template", "gain", "--out", "m.toml"], "record.csv"),
    with_one_strange(SIMULATE, "model.toml"),
    with_one_strange(SIMULATE, "gains.toml"),
    with_one_strange([*SIMULATE[:-2], "--profile", "profile.csv"], "profile.csv"),
    with_one_strange([x.replace(".toml", ".fmu") if x == "model.toml" else x for x in SIMULATE], "model.fmu"),
    with_one_strange(WATCH, "record.csv"),
    with_one_strange(WATCH, "model.toml"),
    with_one_strange([*WATCH, "--training", "training.csv"], "training.csv"),
    with_one_strange([*WATCH, "--gains", "gains.toml"], "gains.toml"),
    with_one_strange([x.replace(".toml", ".fmu") for x in WATCH], "model.fmu"),
    with_one_strange(["compare", "record.csv", "--model", "model.toml"], "model.toml"),
    with_one_strange(["compare", "record.csv", "--fmu", "model.fmu"], "model.fmu"),
    with_one_strange(["diagnose", "record.csv", "--model", "model.toml"], "model.toml"),
    with_one_strange(["diagnose", "record.csv", "--fmu", "model.fmu"], "model.fmu"),
    with_one_strange(["fmu", "linearise", "--model", "model.toml", "--out", "a.json"], "model.toml"),
    with_one_strange(["hil", "--duration", "0.3", "--controller", "model.fmu", *_HARDWARE], "model.fmu"),
    with_one_strange(["hil", "--duration", "0.3", "--gains", "gains.toml", *_HARDWARE], "gains.toml"),
    with_one_strange(HARDWARE_RUN, "hardware.toml"),
    with_one_strange(["bench", "check", *_HARDWARE], "hardware.toml"),
    with_one_strange(["investigate", *_HARDWARE], "hardware.toml"),
    with_one_strange(["investigate", "--record", "record.csv", *_HARDWARE], "record.csv"),
    with_one_strange(["investigate", "--model", "model.toml", *_HARDWARE], "model.toml"),
    strange_run(["hil", "recover", "run"], _RUN),
    strange_run(["hil", "nexus", "run"], _RUN),
    strange_run(["investigate", "--resume", "--out", "run", "--bench", "missing.toml"], ("journal.jsonl", *_RUN)),
    strange_run(["diagnose", "record.csv", "--resume", "run"], ("archive.jsonl", "diagnosis.json", "model.toml")),
    strange_run(["fleet", "tune", "run"], _FLEET),
    strange_run(["fleet", "report", "unit-1", "--out", "run"], _FLEET),
    strange_run(["watch", "beam", "run", "--replay", "--no-diagnosis"], _RUN),
    manifest,
    odd_name,
    odd_name,
    pictures,
)
"""Makers of one case each, in turn."""
