"""`bender benchmark devices`: other people's devices from their records alone, no model given.

What an expert would accept as the missing effect, and what would be a mistake, is that of the table beside the records.
Where there is a second record, both models follow it freely, each from the beginning that it meets best, and what they
leave is told about its mean: an offset belongs to the record.
"""

import argparse
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bender_studies.benchmarks.records_at_hand import DATA, data_folder, missing_of, refuse_missing, wanted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from bender_discrepancy.diagnosis import Diagnosis
    from bender_loop.records.record import Record

HELP = "other people's devices from their records alone: what is named, how sure, and the residual on a second record"
WORSE = 1.02
"""Times what the first model leaves of a second record: more is worse."""
COLUMNS = ("device", "verdict", "said, most likely first", "right", "before", "after", "second before", "after", "s")


@dataclass(frozen=True, slots=True)
class Device:
    """One device.

    Attributes:
        name: for the table.
        file: the record.
        unit: of the readings.
        right: effects that an expert would accept.
        wrong: those that would be a mistake as the first name.
        other: a second record; "" where there is none.
        untimed: times are only an order.
    """

    name: str
    file: str
    unit: str
    right: frozenset[str]
    wrong: frozenset[str]
    other: str = ""
    untimed: bool = False


PLAY = frozenset({"backlash", "rate_independent_hysteresis", "hysteretic_spring", "presliding_friction"})
DEVICES: tuple[Device, ...] = (
    Device(
        "hairdryer", "hairdryer.csv", "V", frozenset({"transport_delay"}),
        frozenset({"rate_independent_hysteresis", "dead_zone", "backlash", "stiffening"}), "hairdryer_val.csv",
    ),
    Device(
        "coupled drives", "ced_abs.csv", "ticks/s", frozenset({"fold", "output_curve", "electrostriction"}),
        frozenset({"rate_independent_hysteresis", "backlash", "transport_delay", "creep"}), "ced_abs_val.csv",
    ),
    Device(
        "MR damper", "mr_damper.csv", "N", PLAY | {"saturation", "output_limit"},
        frozenset({"stiffening", "dead_zone", "creep"}), "mr_damper_val.csv",
    ),
    Device(
        "cylinder", "cylinder_friction.csv", "N", PLAY | {"coulomb_friction"},
        frozenset({"transport_delay", "creep", "sensor_lag", "source_resistance", "stiffening"}),
        "cylinder_friction_val.csv",
    ),
    Device(
        "steel", "bh_steel.csv", "T", PLAY | {"saturation"},
        frozenset({"transport_delay", "sensor_lag", "source_resistance", "creep", "dead_zone"}), untimed=True,
    ),
    Device(
        "valve", "valve_stiction.csv", "1", PLAY, frozenset({"stiffening", "transport_delay", "second_mode"}),
        "valve_stiction_val.csv",
    ),
    Device(
        "damper, earthquake", "damper_imperial.csv", "kip",
        PLAY | {"coulomb_friction", "dead_zone", "output_dead_zone"},
        frozenset({"transport_delay", "creep", "thermal_drift"}), "damper_imperial_val.csv",
    ),
    Device(
        "circuit", "silverbox_arrow.csv", "mV", frozenset({"stiffening"}),
        frozenset({"rate_independent_hysteresis", "dead_zone", "creep", "transport_delay"}),
        "silverbox_multisine_test.csv",
    ),
    Device(
        "Bouc-Wen", "boucwen_train.csv", "m", PLAY, frozenset({"dead_zone", "creep", "transport_delay", "stiffening"}),
        "boucwen_multisine.csv",
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a device, in the unit of its readings.

    Attributes:
        name: of the device.
        verdict: the contract's word.
        said: effects and the probability of each, the most likely first.
        is_right: whether one of the first two is right.
        is_wrong: whether the first would be a mistake.
        before: rms of the recalibrated first model on held-out rows.
        after: that of the corrected model.
        second_before: what the first model leaves of the second record about its mean; None without one.
        second_after: what the corrected one leaves of it.
        seconds: of wall time.
        unit: of the readings.
        certain: effects that are said to be certain.
        right: effects that an expert would accept.
    """

    name: str
    verdict: str
    said: tuple[tuple[str, float], ...]
    is_right: bool
    is_wrong: bool
    before: float
    after: float
    second_before: float | None
    second_after: float | None
    seconds: float
    unit: str
    certain: tuple[str, ...]
    right: tuple[str, ...]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which devices are diagnosed, where their records are, and where the results go."""
    names = ", ".join(repr(x.name) for x in DEVICES)
    parser.epilog = "example:\n  bender benchmark devices --only hairdryer valve"
    parser.add_argument("--only", nargs="+", metavar="NAME", help=f"default: all of {names}")
    parser.add_argument(
        "--drawn", type=int, metavar="N", help="instead: N machines drawn at random, twelve kinds in turn"
    )
    parser.add_argument("--first-seed", type=int, default=1, metavar="S", help="seed of the first machine (default: 1)")
    parser.add_argument("--data", type=Path, metavar="DIR", help=f"default: {DATA} beside the checkout")


def run(arguments: argparse.Namespace) -> int:
    """Print the table, write devices.json and the diagnosis of every device."""
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory
    from bender_loop.shell.progress import print_table

    if arguments.drawn is not None and (arguments.only or arguments.data or arguments.drawn < 1):
        raise InputError("--drawn: expected at least 1, and neither --only nor --data beside it")
    if arguments.first_seed < 0:
        raise InputError(f"--first-seed: found {arguments.first_seed}, expected at least 0")
    if arguments.drawn is None:
        devices = wanted("--only", arguments.only, {x.name: x for x in DEVICES})
        data = data_folder(arguments.data)
        refuse_missing(missing_of((y for x in devices for y in (x.file, x.other) if y), data), data, "the devices")
        out = prepare_directory(arguments.out)
    else:
        out = data = prepare_directory(arguments.out)
        devices = _drawn(range(arguments.first_seed, arguments.first_seed + arguments.drawn), data)
    found = _outcomes(devices, data, out)
    print_table("devices from their records alone: rms on held-out rows", COLUMNS, [_row(x) for x in found])
    if arguments.drawn is not None:
        sys.stdout.write("".join(f"{line}\n" for line in _counts(found)))
    sys.stdout.write(f"written: {out / 'devices.json'}\n")
    return 0


def _outcomes(devices: "Sequence[Device]", data: Path, out: Path) -> list[Outcome]:
    import json

    from bender_loop.shell.files import write_atomically
    from bender_loop.shell.progress import Progress

    found: list[Outcome] = []
    with Progress("devices") as bar:
        for k, device in enumerate(devices):
            bar.update(k, len(devices), device.name)
            found.append(outcome_of(device, data, out / device.name.replace(", ", "-").replace(" ", "-")))
            # what is complete is kept when the rest is interrupted
            write_atomically(out / "devices.json", json.dumps([asdict(x) for x in found], indent=2) + "\n")
    return found


def _drawn(seeds: "Iterable[int]", folder: Path) -> list[Device]:
    """Return machines of some seeds, their records written into a folder."""
    from bender_proving.machines import draw

    devices = []
    for seed in seeds:
        drawn = draw(seed)
        name = f"{drawn.machine.name} {seed}"
        files = [f"{name.replace(' ', '-')}-{k}.csv" for k in (1, 2)]
        for number, file in enumerate(files):
            drawn.write(folder / file, number)
        devices.append(Device(name, files[0], drawn.machine.unit, drawn.machine.right, drawn.machine.wrong, files[1]))
    return devices


def _counts(found: "Sequence[Outcome]") -> list[str]:
    """Return what is counted over drawn machines, a line each."""
    import numpy as np

    closed = [1.0 - (x.second_after / x.second_before) ** 2 for x in found if x.second_before and x.second_after]
    certain = [(name, x) for x in found for name in x.certain]
    false = [f"{name} of {x.name}" for name, x in certain if name not in x.right]
    worse = [x.name for x, share in zip(found, closed, strict=True) if share < 1.0 - WORSE**2]
    return [
        f"one of the first two names is right: {sum(x.is_right for x in found)} of {len(found)}; "
        f"the first would be a mistake: {sum(x.is_wrong for x in found)}",
        f"certain names: {len(certain)}, not accepted: {', '.join(false) or 'none'}",
        f"closed of the second record's variance, median: {100.0 * float(np.median(closed)):.0f} %; worse there: "
        f"{', '.join(worse) or 'none'}",
        f"longest: {max(x.seconds for x in found):.0f} s",
    ]


def _row(x: Outcome) -> list[str]:
    said = ", ".join(f"{name} {100.0 * probability:.0f} %" for name, probability in x.said) or "nothing"
    right = "wrong" if x.is_wrong else "yes" if x.is_right else "no"
    second = ["–" if y is None else f"{y:.3g}" for y in (x.second_before, x.second_after)]
    before, after = f"{x.before:.3g} {x.unit}", f"{x.after:.3g}"
    return [x.name, x.verdict, said, right, before, after, *second, f"{x.seconds:.0f}"]


def outcome_of(device: Device, data: Path, out: Path) -> Outcome:
    """Return what comes of one device: the diagnosis of its record without a model, and its second record."""
    import time

    from bender_discrepancy.workflow import diagnose
    from bender_inference.settings import Settings
    from bender_loop.shell.files import prepare_directory

    settings = Settings(untimed=device.untimed) if device.untimed else Settings().between_rows("auto")
    begin = time.perf_counter()
    diagnosis = diagnose(None, [_record(device.file, device, data)], settings, None, [device.file])
    diagnosis.write(prepare_directory(out))
    seconds = time.perf_counter() - begin
    said = _said(diagnosis)
    names = [name for name, _ in said]
    second = _second(device, data, diagnosis) if device.other else (None, None)
    gap = diagnosis.gap
    certain = tuple(x.id for x in diagnosis.added if x.contender is not None and x.contender.grade == "certain")
    return Outcome(
        device.name, diagnosis.verdict, said, bool(device.right & set(names[:2])),
        bool(names) and names[0] in device.wrong, gap.recalibrated.rms_um, gap.after.rms_um, *second, seconds,
        _inside(device.unit), certain, tuple(sorted(device.right)),
    )  # fmt: skip


def _inside(unit: str) -> str:
    """Return the unit in which readings are held: every length is one of micrometres."""
    from bender_loop.tables.units import LENGTH_UM, find

    return unit if find(LENGTH_UM, unit) is None else "µm"


def _said(diagnosis: "Diagnosis") -> tuple[tuple[str, float], ...]:
    """Return the effects that are said to be missing and their probabilities, then the rivals of an open answer."""
    told = [(x.id, 1.0 if x.contender is None else x.contender.probability) for x in diagnosis.added]
    rivals = [(x.id, 0.0 if x.contender is None else x.contender.probability) for x in diagnosis.effects]
    known = {name for name, _ in told}
    return (*sorted(told, key=lambda x: -x[1]), *(x for x in rivals if x[0] not in known))


def _record(file: str, device: Device, data: Path) -> "Record":
    from bender_loop.records.record import read_record

    return read_record(data / file, "time=time_s,voltage=u,displacement=y", f"s,V,{device.unit}")


def _second(device: Device, data: Path, diagnosis: "Diagnosis") -> tuple[float, float]:
    from bender_discrepancy.conclusion.measurement.corrected_model import calibrated
    from bender_studies.benchmarks.second_record import left_about_mean_um

    record = _record(device.other, device, data)
    search = diagnosis.findings.search
    first = calibrated(search.base, search.found.base.calibration)
    hold = search.settings.input_hold
    before, after = (
        left_about_mean_um(x, record, hold, untimed=device.untimed) for x in (first, diagnosis.findings.model)
    )
    return before, after
