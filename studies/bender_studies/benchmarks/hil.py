"""`bender benchmark hil`: cadence, reaction times and faults of the emulated bench, the step and the staircase."""

import argparse
import json
import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bender_hil.runner.program import Program
    from bender_studies.bench_trials.fault_matrix import Cell

    Asked = Callable[[Sequence[Any]], list[Any]]
    Cells = Callable[..., list[Cell]]
    """Runs cells, and tells `done` of each."""

HELP = "the bench: deadlines, delays, reaction times, faults, and what a step and a staircase give"
PARTS = ("cadence", "serial", "fast", "reactions", "step", "staircase", "daq", "faults", "pairs")

ALONE = ("daq", "faults", "pairs")
"""Measured only where they are asked for: they take many minutes."""

KILOHERTZ_P99_MS = 0.6

Row = list[str | float | int | None]
Pairs = list[tuple[str, str]]
_AT_ONCE = 3
"""Benches: their runs mostly wait."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what to measure and for how long."""
    parser.add_argument(
        "--parts",
        type=lambda text: text.split(","),
        metavar="PART,...",
        help=f"of {', '.join(PARTS)} (default: all but {', '.join(ALONE)})",
    )
    parser.add_argument("--faults", action="store_true", help="every fault in every state of a run, and nothing else")
    parser.add_argument(
        "--only",
        nargs="+",
        default=[],
        metavar="WORD",
        help="of faults and pairs those cells whose fault, state, source and sensor have all these words",
    )
    parser.add_argument(
        "--piece", type=_piece, default=(1, 1), metavar="K/N", help="of these every N-th cell, from the K-th on"
    )
    parser.add_argument("--realtime", action="store_true", help="real-time priority for controller and guard (Linux)")
    parser.add_argument(
        "--minutes", type=float, default=10.0, metavar="N", help="length of the long runs (default: 10)"
    )
    parser.add_argument(
        "--repeats", type=int, default=10, metavar="N", help="repetitions of each reaction (default: 10)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the tables, write hil.json; 1 when a target is missed."""
    from bender_export.build import ensure_plant_fmu
    from bender_loop.errors import InputError
    from bender_loop.shell.files import finite, prepare_directory, result_text, write_atomically

    parts = ["faults"] if arguments.faults else arguments.parts or [part for part in PARTS if part not in ALONE]
    for part in parts:
        if part not in PARTS:
            raise InputError(f"--parts: found {part!r}, expected some of {', '.join(PARTS)}")
    if not 0.01 <= arguments.minutes <= 1000.0 or arguments.repeats < 1:
        raise InputError("--minutes and --repeats: expected numbers above 0")
    out: Path = prepare_directory(arguments.out)
    fmu = ensure_plant_fmu("bench")
    facts: dict[str, object] = {}
    met = []
    for part in parts:
        facts[part], is_met = _measured(part, arguments, fmu, out)
        met.append(is_met)
        write_atomically(out / "hil.json", result_text(finite(facts), default=str))
    sys.stdout.write(f"written: {out / 'hil.json'}\n")
    return 0 if all(met) else 1


def _measured(part: str, arguments: argparse.Namespace, fmu: Path, out: Path) -> tuple[object, bool]:
    minutes: float = arguments.minutes
    match part:
        case "cadence":
            return _cadence(arguments, "30 frames/s over TCP", "tcp", 30.0, 60.0 * minutes, fmu, p99_ms=15.0, late=0)
        case "serial":
            seconds = 60.0 * min(minutes, 1.0)
            return _cadence(arguments, "30 frames/s, 57600 baud", "pty", 30.0, seconds, fmu, p99_ms=25.0, late=0)
        case "fast":
            seconds = 60.0 * min(minutes, 1.0)
            return _cadence(arguments, "90 frames/s over TCP", "tcp", 90.0, seconds, fmu, p99_ms=None, late=1)
        case "daq":
            return _kilohertz(arguments, 60.0 * minutes, fmu)
        case "reactions":
            return _reactions(arguments.repeats, fmu)
        case "step" | "staircase":
            return _run_command(part, out)
        case "pairs":
            return _pairs(partial(_asked, arguments.only, arguments.piece), fmu, out)
        case _:
            return _faults(partial(_asked, arguments.only, arguments.piece), fmu, out)


def _cadence(
    arguments: argparse.Namespace,
    title: str,
    link: str,
    rate_Hz: float,
    seconds: float,
    fmu: Path,
    *,
    p99_ms: float | None,
    late: int,
) -> tuple[object, bool]:
    from bender_hil.emulated import EmulationSettings
    from bender_loop.shell.progress import print_table
    from bender_studies.bench_trials.cadence import measure_cadence

    folder, emulation = _free(arguments.out / f"{link}-{rate_Hz:g}"), EmulationSettings(link=link)
    found = measure_cadence(_walk(seconds), emulation, rate_Hz, fmu, folder, realtime=arguments.realtime)
    median, high, most = found.photon_to_command_ms
    is_met = found.late <= late and found.skipped == 0 and found.unsent == 0 and found.ended.code is None
    is_met = is_met and (p99_ms is None or high <= p99_ms)
    rows: list[Row] = [
        ["ended", found.ended.code or "by no rule", None],
        ["ticks, per second", f"{found.ticks}, {found.rate_Hz:.3f}", None],
        ["frames dropped by us", found.skipped + found.unsent, "0"],
        ["ticks late", found.late, f"<= {late}"],
        ["frames that the emulated camera drew late", found.late_frames, None],
        ["photon to command, ms: median", median, None],
        ["photon to command, ms: p99", high, None if p99_ms is None else f"<= {p99_ms:g}"],
        ["photon to command, ms: max", most, None],
        ["photon to frame, ms: median, p99", "{:.2f}, {:.2f}".format(*found.photon_to_frame_ms), None],
        ["tip error, µm rms", found.tip_error_um, None],
    ]
    how = ", with priority" if arguments.realtime else ""
    print_table(f"{title}, {seconds:g} s{how}: {_verdict(is_met)}", ["what", "found", "target"], rows)
    return asdict(found), is_met


def _kilohertz(arguments: argparse.Namespace, seconds: float, fmu: Path) -> tuple[object, bool]:
    from bender_loop.shell.progress import print_table
    from bender_studies.bench_trials.kilohertz import measure_kilohertz

    folder = _free(arguments.out / "daq")
    found = measure_kilohertz(_walk(seconds), fmu, folder, realtime=arguments.realtime)
    median_ms, high_ms, most_ms = found.delay_ms
    is_met = found.code is None and found.late == 0 and found.skipped == 0 and high_ms <= KILOHERTZ_P99_MS
    rows: list[Row] = [
        ["ended", found.code or "by no rule", None],
        ["ticks", found.ticks, f"{seconds * 1e3:.0f}"],
        ["readings passed over", found.skipped, "0"],
        ["ticks late", found.late, "0"],
        ["complete reading to command, ms: median", median_ms, None],
        ["complete reading to command, ms: p99", high_ms, f"<= {KILOHERTZ_P99_MS:g}"],
        ["complete reading to command, ms: max", most_ms, None],
        ["load of the machine before, processors", f"{found.load:.1f}, {found.processors}", None],
    ]
    how = ", with priority" if arguments.realtime else ""
    print_table(f"1 kHz on a DAQ, {seconds:g} s{how}: {_verdict(is_met)}", ["what", "found", "target"], rows)
    return asdict(found), is_met


def _reactions(repeats: int, fmu: Path) -> tuple[object, bool]:
    from bender_hil.emulated import EmulationSettings
    from bender_loop.shell.progress import print_table
    from bender_studies.bench_trials.reactions import REACTIONS, measure_reactions

    targets = {"kill -9": ("off_ms", 150.0), "frozen": ("off_ms", 250.0), "camera stall": ("ramp_ms", 150.0)}
    rows: list[Row] = []
    facts = {}
    met = True
    for event in REACTIONS:
        found = measure_reactions(event, repeats, EmulationSettings(), fmu)
        facts[event] = [asdict(one) for one in found]
        name, bound = targets[event]
        worst = {key: max(getattr(one, key) for one in found) for key in ("ramp_ms", "off_ms", "harmless_ms")}
        met = met and worst[name] <= bound
        what = "off" if name == "off_ms" else "ramp"
        target = f"{what} <= {bound:g} ms"
        rows.append([event, worst["ramp_ms"], worst["off_ms"], worst["harmless_ms"], target, found[0].code])
    columns = ["event", "ramp begins, ms", "OUTP? off, ms", "below 1 V, ms", "target", "reason"]
    print_table(f"Reaction from 45 V, worst of {repeats}: {_verdict(met)}", columns, rows)
    return facts, met


def _hil(*words: str) -> int:
    """Run the bench's own command; returns its exit status."""
    from bender_export.build import ensure_plant_fmu
    from bender_hil.command import add_arguments, run
    from bender_tuner.results.gains_file import read_gains

    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return run(parser.parse_args(words), fmu=lambda model: ensure_plant_fmu(model), read_gains=read_gains)


def _run_command(part: str, out: Path) -> tuple[object, bool]:
    """A run by the command itself, which prints its own table."""
    folder = _free(out / part)
    words = ["--setpoint", "20"] if part == "step" else ["--profile", "staircase"]
    status = _hil(*words, "--out", str(folder))
    if status != 0:
        return {"status": status}, False
    facts = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    if part == "staircase":
        return facts["staircase"], _hil("replay", str(folder)) == 0
    step = facts["step"]
    met = step["overshoot_percent"] <= 5.0 and step["settling_time_s"] is not None and step["settling_time_s"] <= 1.0
    sys.stdout.write(f"step to 20 µm: overshoot <= 5 %, settling <= 1 s: {_verdict(met)}\n")
    return step, met and _hil("replay", str(folder)) == 0


def _faults(asked: "Asked", fmu: Path, out: Path) -> tuple[object, bool]:
    from itertools import product

    from bender_studies.bench_trials.camera_faults import CAMERA_FAULTS, CAMERA_STATES
    from bender_studies.bench_trials.fault_matrix import STATES, WITHIN_S, cells, run_cell
    from bender_studies.bench_trials.matrix import run_matrix

    folder = _free(out / "faults")
    matrices: list[tuple[str, Sequence[str], Pairs, Cells]] = [
        ("the supply", STATES, cells(), partial(run_matrix, run=run_cell, fmu=fmu, folder=folder / "supply"))
    ]
    if sys.platform == "linux":
        # whether a process was stopped is read from the kernel's table
        from bender_studies.bench_trials.process_faults import process_faults, run_process_cell

        run = partial(run_matrix, run=run_process_cell, fmu=fmu, folder=folder / "process")
        matrices.append(("processes and files", STATES, process_faults(), run))
    camera: Pairs = list(product(CAMERA_FAULTS, CAMERA_STATES))
    matrices.append(("the camera", CAMERA_STATES, camera, partial(_camera_cells, fmu=fmu, folder=folder)))
    found: list[Cell] = []
    for title, states, pairs, run in matrices:
        found += _matrix(title, states, asked(pairs), run)
    broken = [cell for cell in found if cell.broken]
    names = {cell.fault for cell in found}
    longest_s = max((cell.seconds for cell in found if cell.seconds is not None), default=0.0)
    sys.stdout.write(
        f"{len(names)} faults, {len(found)} cells, {len(broken)} broken; in the others status and last line are the "
        f"truth; output off or alarm within {longest_s:.2f} s, allowed: {WITHIN_S:g} s: {_verdict(not broken)}\n"
    )
    return [asdict(cell) for cell in found], not broken


def _matrix(title: str, states: "Sequence[str]", pairs: Pairs, run: "Cells") -> "list[Cell]":
    """Run some cells and print their table."""
    from bender_loop.shell.progress import Progress

    if not pairs:
        return []
    count = 0
    with Progress(f"faults of {title}") as progress:

        def show(fault: str, state: str) -> None:
            nonlocal count
            count += 1
            progress.update(count, len(pairs), f"{fault}, {state}")

        found = run(pairs, done=show)
    _print_matrix(title, found, states)
    return found


def _camera_cells(pairs: Pairs, fmu: Path, folder: Path, done: "Callable[[str, str], object]") -> "list[Cell]":
    from bender_hil.emulated import EmulatedBench, EmulationSettings
    from bender_loop.errors import RunError
    from bender_studies.bench_trials.camera_faults import run_camera_cell
    from bender_studies.bench_trials.fault_matrix import Cell

    found: list[Cell] = []
    with EmulatedBench(EmulationSettings(), fmu, 30.0) as bench:
        for fault, state in pairs:
            try:
                found.append(run_camera_cell(bench, fault, state, folder / f"{fault}-{state}"))
            except RunError as error:
                found.append(Cell(fault, state, "not reached", None, str(error)))
            done(fault, state)
    return found


def _piece(text: str) -> tuple[int, int]:
    first, _, count = text.partition("/")
    if not (first.isdecimal() and count.isdecimal() and 1 <= int(first) <= int(count)):
        raise argparse.ArgumentTypeError(f"found {text!r}, expected a piece such as 2/10")
    return int(first), int(count)


def _asked(only: list[str], piece: tuple[int, int], cells: "Sequence[Any]") -> list[Any]:
    """Return the cells in whose names every word stands that was asked for, and of these one piece."""
    return [names for names in cells if all(word in ", ".join(names) for word in only)][piece[0] - 1 :: piece[1]]


def _pairs(asked: "Asked", fmu: Path, out: Path) -> tuple[object, bool]:
    """Every fault of every pair of source and sensor, one run each; a table with a row for each pair."""
    from concurrent.futures import ThreadPoolExecutor

    from bender_loop.shell.files import finite, result_text, write_atomically
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.bench_trials.pair_faults import LIMITS, PAIRS, PairCell, faults_of, pair_bench, run_pair_cell

    folder = _free(out / "pairs")
    cells: dict[tuple[str, str], list[str]] = {}
    for source, sensor, fault in asked([(*pair, fault) for pair in PAIRS for fault in faults_of(pair[1])]):
        cells.setdefault((source, sensor), []).append(fault)

    def run(pair: tuple[str, str]) -> list[PairCell]:
        source, sensor = pair
        with pair_bench(source, sensor, fmu) as bench:
            return [
                run_pair_cell(bench, source, sensor, fault, folder / source / sensor / str(k))
                for k, fault in enumerate(cells[pair])
            ]

    found: list[PairCell] = []
    rows: list[Row] = []
    with Progress("pairs of source and sensor") as progress, ThreadPoolExecutor(_AT_ONCE) as pool:
        for number, part in enumerate(pool.map(run, cells), 1):
            source, sensor = part[0].source, part[0].sensor
            found += part
            outcomes = [cell.outcome for cell in part]
            longest_s = max((cell.seconds for cell in part if cell.seconds is not None), default=0.0)
            broken = "; ".join(f"{cell.fault}: {cell.broken}" for cell in part if cell.broken)
            counts = (outcomes.count(word) for word in ("off", "alarm", "refused"))
            rows.append([source, sensor, len(part), *counts, f"{longest_s:.2f}", broken or "-"])
            so_far = {"cells": [asdict(cell) for cell in found]}
            write_atomically(folder / "cells.json", result_text(finite(so_far), default=str))
            progress.update(number, len(cells), f"{source}, {sensor}")
    columns = ["source", "sensor", "faults", "off", "alarm", "refused", "longest, s", "broken"]
    print_table("faults of pairs of source and sensor", columns, rows)
    broken_cells = [cell for cell in found if cell.broken]
    allowed_s = LIMITS.shutdown_limit_s + 1.0
    sys.stdout.write(
        f"{len(cells)} pairs, {len(found)} cells, {len(broken_cells)} broken; in the others status and last line are "
        f"the truth; output off or alarm allowed within {allowed_s:g} s: {_verdict(not broken_cells)}\n"
    )
    return [asdict(cell) for cell in found], not broken_cells


def _print_matrix(title: str, found: "list[Cell]", states: "Sequence[str]") -> None:
    from bender_loop.shell.progress import print_table

    by_pair = {(cell.fault, cell.state): cell for cell in found}
    faults = list(dict.fromkeys(cell.fault for cell in found))
    rows: list[Row] = [[fault, *(_cell_words(by_pair.get((fault, state))) for state in states)] for fault in faults]
    print_table(f"faults of {title}", ["fault", *states], rows)


def _cell_words(cell: "Cell | None") -> str:
    if cell is None:
        return ""
    if cell.broken:
        return f"BROKEN: {cell.broken}"
    seconds = "" if cell.seconds is None else f" {cell.seconds:.2f} s"
    return cell.outcome + seconds + ("" if cell.code is None else f" ({cell.code})")


def _walk(seconds: float) -> "Program":
    """A closed loop on setpoints that change every two seconds, with the gains of the package."""
    import numpy as np

    from bender_hil.command import OWN_GAINS
    from bender_hil.runner.program import ClosedLoop
    from bender_loop.control.references import Profile
    from bender_tuner.results.gains_file import read_gains

    gains, limits, _ = read_gains(OWN_GAINS)
    levels: Sequence[float] = np.random.default_rng(0).uniform(3.0, 18.0, int(seconds / 2.0) + 1).tolist()
    times = tuple(2.0 * k for k in range(len(levels)))
    return ClosedLoop(Profile(times, tuple(levels)), gains, limits, 225.0, seconds)


def _free(folder: Path) -> Path:
    """The folder itself, or with a number behind it when there is a run already."""
    candidates = [folder, *(folder.with_name(f"{folder.name}-{k}") for k in range(2, 1000))]
    return next(candidate for candidate in candidates if not candidate.exists())


def _verdict(is_met: bool) -> str:
    return "met" if is_met else "NOT MET"
