"""Command lines with something wrong in them: a strange file, a strange value of an option, a word out of place."""

import argparse
import importlib
import random
from collections.abc import Callable
from pathlib import Path

from fuzzing.hostile_commands import FURTHER, NOBODY
from fuzzing.hostile_files import strange_record, strange_settings
from fuzzing.mutations import mutated
from fuzzing.program import installed
from fuzzing.strange_tables import table_case

Case = tuple[list[str], str]
Make = Callable[[Path, random.Random, "Sound"], Case]

NUMBERS = (
    "", "nan", "inf", "-inf", "1e308", "-1e308", "1e999", "5e-324", "0", "-1", "-0.0", "1e17", "9" * 400, "9" * 5000,
    "abc", "1,2", "é", "--", "0x10", "1_000", " ", "../..", "a\tb", "time=t,voltage=U", "ms,V,mm", "x" * 5000,
)  # fmt: skip
_QUICK_TUNE = [
    "tune", "--method", "zn", "--objective", "itae", "--duration", "0.2", "--setpoint", "3", "--evaluations", "4",
    "--exposure", "0",
]  # fmt: skip
_QUICK_IDENTIFY = [
    "identify",
    "sound.csv",
    "--library",
    "paper",
    "--ensemble",
    "0",
    "--keep",
    "sindy",
    "weak",
]
# options of these are tried with words that no run can begin with: a run takes minutes
_LONG = ("benchmark", "demo", "reproduce", "hil", "calibrate")


class Sound:
    """What is not wrong: the texts of settings, and an FMU.

    Attributes:
        model: a model file.
        gains: a file of gains.
        bench: a bench file, of the emulated bench.
        hardware: a bench file with an address at which no supply answers.
        fmu: the bytes of an FMU.
    """

    def __init__(self, fmu: bytes) -> None:
        import bender_hil
        import bender_plant

        self.fmu = fmu
        self.model = (Path(bender_plant.__file__).parent / "models" / "bench.toml").read_text(encoding="utf-8")
        self.gains = (Path(bender_hil.__file__).parent / "gains.toml").read_text(encoding="utf-8")
        self.bench = (
            "[guard]\nheartbeat_s = 1.0\nframe_age_s = 1.0\nmaximum_V = 45.0\n"
            "[camera]\nzero_frames = 5\n[vision]\nwire_um = 15.0\n"
            '[emulator]\nseed = 1\nmodel = "bench"\n[metadata]\nsample = "a wire"\n'
        )
        self.hardware = (
            f'[supply]\n{NOBODY}\nmodel = "9115"\ntimeout_s = 0.1\n'
            '[sensor]\nkind = "text"\nresource = "TCPIP::127.0.0.1::10::SOCKET"\nunit = "um"\nrate_Hz = 30.0\n'
            "zero_readings = 5\n[guard]\nheartbeat_s = 1.0\nframe_age_s = 1.0\n[controller]\nslack_V = 10.0\n"
        )


def made_case(k: int, folder: Path, rng: random.Random, sound: Sound) -> Case:
    """Return the words of case `k`, whose files are written into `folder`, and what is wrong with it."""
    words, wrong = MAKERS[k % len(MAKERS)](folder, rng, sound)
    if words and words[0] in installed().COMMANDS and "--no-such-option" not in words and rng.random() < 0.3:
        return [*words, "--json"], wrong
    return words, wrong


def _record(command: list[str]) -> Make:
    def make(folder: Path, rng: random.Random, _: Sound) -> Case:
        done = strange_record(folder / "record.csv", rng)
        hold = rng.choice(([], [], ["--untimed"], ["--input-hold", "linear"], ["--units", "ms,mV,nm"]))
        return [*(x.replace("sound.csv", "record.csv") for x in command), *hold], f"record: {done}"

    return make


def _table(command: list[str]) -> Make:
    def make(folder: Path, rng: random.Random, _: Sound) -> Case:
        path, options, done = table_case(folder, rng)[:3]
        return [*(x.replace("sound.csv", path.name) for x in command), *options], f"table: {done}"

    return make


def _model(command: list[str]) -> Make:
    def make(folder: Path, rng: random.Random, sound: Sound) -> Case:
        done = strange_settings(folder / "model.toml", rng, sound.model)
        return [*command, "--model", "model.toml"], f"model: {done}"

    return make


def _gains(folder: Path, rng: random.Random, sound: Sound) -> Case:
    done = strange_settings(folder / "gains.toml", rng, sound.gains)
    return ["fmu", "build", "--gains", "gains.toml", "--out", "out"], f"gains: {done}"


def _fmu(command: list[str]) -> Make:
    def make(folder: Path, rng: random.Random, sound: Sound) -> Case:
        damaged, done = mutated(sound.fmu, rng)
        (folder / "strange.fmu").write_bytes(damaged)
        return [*command], f"fmu: {done}"

    return make


def _bench(option: str, name: str) -> Make:
    def make(folder: Path, rng: random.Random, sound: Sound) -> Case:
        if option == "--profile":
            done = strange_record(folder / name, rng)
        else:
            done = strange_settings(folder / name, rng, sound.gains if option == "--gains" else sound.bench)
        return ["hil", "--duration", "0.3", option, name, "--out", "out"], f"{option}: {done}"

    return make


def _replay(folder: Path, rng: random.Random, _: Sound) -> Case:
    run = folder / "run"
    run.mkdir()
    lines = ['{"time_s": 0.0}', "{}", "[]", "nonsense", '{"kind": "frame", "tick": ' + "9" * 400 + "}", "\x00", "null"]
    text = "\n".join(rng.choices(lines, k=rng.randrange(5)))
    for name in rng.sample(("run.jsonl", "guard.jsonl", "record.csv", "summary.json"), rng.randrange(5)):
        (run / name).write_text(text, encoding="utf-8")
    return ["hil", "replay", "run"], "log"


def _option(folder: Path, rng: random.Random, _: Sound) -> Case:
    name = rng.choice([name for name in installed().COMMANDS if name not in _LONG])
    base = {
        "tune": _QUICK_TUNE,
        "identify": _QUICK_IDENTIFY,
        "compare": ["compare", "sound.csv"],
        "diagnose": ["diagnose", "flat.csv"],
        "effects": ["effects"],
        "fmu": ["fmu", "build", "--model", "beam"],
    }.get(name, [name])
    option = rng.choice(_options(name) or ["--out"])
    _sound_records(folder)
    value = rng.choice(NUMBERS)
    if option in ("--out",):
        value = rng.choice(("sound.csv", "sound.csv/below", "\x00", "/dev/null", "/proc/x", "x" * 300))
    return [*base, f"{option}={value}"], f"{name} {option}={value[:20]!r}"


def _long_option(_folder: Path, rng: random.Random, _: Sound) -> Case:
    name = rng.choice(_LONG)
    first = {"benchmark": [rng.choice(("tuner", "speed", "fuzz", "identify"))]}.get(name, [])
    option = rng.choice(_options(name) or ["--out"])
    word = rng.choice((f"{option}={rng.choice(NUMBERS)}", "--bogus", "bogus"))
    return [name, *first, word, "--no-such-option"], f"{name} {word[:30]!r}"


def _word(folder: Path, rng: random.Random, _: Sound) -> Case:
    _sound_records(folder)
    pool = [
        *installed().COMMANDS,
        "sound.csv",
        "--out",
        "--",
        "-",
        "",
        "\x00",
        "creep",
        "--json",
        "x" * 500,
        "--model",
        "é",
        "-h1",
    ]
    words = rng.choices(pool, k=rng.randrange(1, 5))
    if words[0] in (*_LONG, "tune"):
        words.append("--no-such-option")
    return words, "words"


def _options(name: str) -> list[str]:
    program = installed()
    parser = program.command_parser(name, importlib.import_module(program.COMMANDS[name]))
    actions = [x for x in parser._actions if not isinstance(x, argparse._SubParsersAction)]
    return [option for x in actions for option in x.option_strings if option.startswith("--") and option != "--help"]


def _sound_records(folder: Path) -> None:
    rows = [(k / 30, float(k % 20), 0.5 * (k % 20)) for k in range(60)]
    for name, keep in (("sound.csv", 1.0), ("flat.csv", 0.0)):
        text = "".join(f"{t!r},{v!r},{d * keep!r}\n" for t, v, d in rows)
        (folder / name).write_text(f"time_s,voltage_V,displacement_um\n{text}", encoding="utf-8")


_CHECK = ["fmu", "check", "strange.fmu", "--no-run"]
MAKERS: tuple[Make, ...] = (
    _record(["compare", "sound.csv"]),
    _record(_QUICK_IDENTIFY),
    _record(["diagnose", "sound.csv"]),
    _record(["compare", "sound.csv"]),
    _table(["compare", "sound.csv"]),
    _table(["diagnose", "sound.csv"]),
    _model(["fmu", "build", "--out", "out"]),
    _model(_QUICK_TUNE),
    _model(["fmu", "build", "--out", "out"]),
    _gains,
    _gains,
    _fmu(_CHECK),
    _fmu(_CHECK),
    _fmu([*_QUICK_TUNE, "--fmu", "strange.fmu"]),
    _option,
    _option,
    _option,
    _long_option,
    _word,
    _bench("--bench", "bench.toml"),
    _bench("--profile", "profile.csv"),
    _bench("--gains", "gains.toml"),
    _replay,
    *FURTHER,
)
"""One after the other, so that every run of some dozens has every command and every kind of file."""
