"""`bender benchmark fleet`: what a fleet costs, and whether it names what its example hides."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

HELP = "a fleet: two workers against one, names right, one controller for all"
PARTS = ("speed", "names", "tune")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which parts, how many units, and where everything goes."""
    parser.add_argument(
        "--parts", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=f"of {' '.join(PARTS)}"
    )
    parser.add_argument(
        "--units", type=int, default=200, metavar="N", help="example units whose names are judged (default: 200)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of example and search (default: 0)")
    parser.add_argument("--timed", type=int, default=16, metavar="N", help="units that are timed (default: 16)")
    parser.add_argument(
        "--tuned", type=int, default=100, metavar="N", help="units that one controller is tuned for (default: 100)"
    )
    parser.add_argument(
        "--evaluations", type=int, default=150, metavar="N", help="evaluations of each search (default: 150)"
    )
    parser.add_argument("--groups", type=int, metavar="K", help="sets of gains (default: as many as are needed)")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="default: 2")


def run(arguments: argparse.Namespace) -> int:
    """Print a line a figure, write fleet.json. Names and tune go on where an earlier run of them ended."""
    from bender_fleet.cluster.settings import require_cluster
    from bender_loop.shell.files import prepare_directory, write_atomically
    from bender_studies.runner import check_least

    require_cluster()
    check_least(arguments, 1, "units", "timed", "tuned", "evaluations", "groups", "workers")
    check_least(arguments, 0, "seed")
    out: Path = prepare_directory(arguments.out)
    measured: dict[str, Any] = {}
    for part in PARTS:
        if part in arguments.parts:
            measured[part] = _MEASURES[part](arguments, out)
            write_atomically(out / "fleet.json", json.dumps(measured, indent=2, default=str) + "\n")
    sys.stdout.write(f"written: {out / 'fleet.json'}\n")
    return 0


def _line(text: str, met: bool | None = None) -> None:
    sys.stdout.write(text + {None: "", True: ": met", False: ": NOT MET"}[met] + "\n")
    sys.stdout.flush()


def _speed(arguments: argparse.Namespace, out: Path) -> Any:
    from dataclasses import asdict

    from bender_studies.fleet.speed import measure_speed, readable_units

    manifest = _example(arguments, out)
    x = measure_speed(readable_units(manifest, arguments.timed), _empty(out / "speed"), _line)
    _line(f"{x.units} units: {x.one:.1f} s with one worker, {x.two:.1f} s with two, {x.gain:.2f} times as fast "
          "(target 1.8)", x.gain >= 1.8)  # fmt: skip
    _line(f"a unit in the fleet costs {100 * x.overhead:+.1f} % of the diagnosis alone (target 5)", x.overhead <= 0.05)
    half = len(x.in_fleet) // 2
    first, last = sum(x.in_fleet[:half]) / sum(x.alone[:half]), sum(x.in_fleet[half:]) / sum(x.alone[half:])
    _line(f"  over the diagnosis alone: {first:.3f} in the first half of the units, {last:.3f} in the second")
    return asdict(x) | {"gain": x.gain, "overhead": x.overhead}


def _names(arguments: argparse.Namespace, out: Path) -> Any:
    from dataclasses import asdict

    from bender_studies.fleet.names import compare_with_truth

    manifest = _example(arguments, out)
    results = _diagnosed(manifest, arguments.workers, out / f"names{_of_seed(arguments)}")
    x = compare_with_truth(results, manifest.parent / "truth.json")
    share = x.right / max(x.readable, 1)
    _line(f"names right in {x.right} of {x.readable} readable units, {100 * share:.1f} % (target 95)", share >= 0.95)
    for unit, hidden, said in x.wrong:
        _line(f"  {unit}: hidden {hidden}; said {said}")
    _line(f"broken files with a reason: {x.told_broken} of {x.broken}", x.told_broken == x.broken)
    _line("bad batch, drift and broken files on the page", x.batch and x.drift and x.on_page)
    return asdict(x)


def _tune(arguments: argparse.Namespace, out: Path) -> Any:
    from dataclasses import asdict

    from bender_studies.fleet.tuning import compare_tunings
    from bender_tuner.task.session import Bars

    results = _diagnosed(_example(arguments, out), arguments.workers, out / f"names{_of_seed(arguments)}")
    with Bars() as bars:
        x = compare_tunings(results, arguments.tuned, arguments.evaluations, arguments.groups, bars, arguments.seed)
    sets = f"{x.groups} sets of gains" if x.groups > 1 else "one set of gains"
    _line(f"{sets}: {x.units} units ({x.unserved} more that no gains serve), {x.held_out} of them held out")
    _line(f"  {x.keeping} units keep the nominal gains, {x.own} have gains of their own")
    _line(
        f"  brought to rest: {x.at_rest[0]} against {x.at_rest[1]} of the nominal tuning", x.at_rest[0] >= x.at_rest[1]
    )
    _line(f"  settling worst of those that both bring to rest: {x.both[0]:.3f} s against {x.both[1]:.3f} s")
    for what, unit in (("Ms", ""), ("settling", " s")):
        ours, nominal = x.ours[what], x.nominal[what]
        for name in ("median", "q95", "worst"):
            met = ours[name] < nominal[name] if name == "worst" else None
            _line(
                f"  {what} {name}: {ours[name]:.3f}{unit} against {nominal[name]:.3f}{unit} of the nominal tuning", met
            )
    return asdict(x)


def _example(arguments: argparse.Namespace, out: Path) -> Path:
    """Return the manifest of the example, written where it is missing."""
    from bender_loop.shell.progress import Progress
    from bender_proving.fleet import FleetSettings, write_fleet

    folder = out / f"example-{arguments.units}{_of_seed(arguments)}"
    if (folder / "manifest.csv").is_file():
        return folder / "manifest.csv"
    with Progress("fleet example") as bar:
        return write_fleet(FleetSettings(arguments.units, arguments.seed), _empty(folder), bar.update)


def _of_seed(arguments: argparse.Namespace) -> str:
    return f"-seed{arguments.seed}" if arguments.seed else ""


def _diagnosed(manifest: Path, workers: int, out: Path) -> Path:
    """Return the results of the example; what an earlier run finished is kept."""
    from bender_fleet.asked import task_of
    from bender_fleet.cluster.settings import ClusterSettings
    from bender_fleet.page.page import write_page
    from bender_fleet.run import How, run_fleet
    from bender_fleet.sources.units import find_units
    from bender_studies.fleet.speed import ASKED

    asked = ASKED | {"source": [str(manifest.absolute())]}
    units, how = find_units(asked["source"]), How(ClusterSettings(workers=workers), out)
    count = run_fleet("diagnose", units, task_of(asked), how, asked, _line)
    if count.new:
        _line(f"{count.new} units diagnosed in {count.seconds:.0f} s, {workers} workers")
    write_page(out, "diagnose")
    if count.interrupted:
        raise KeyboardInterrupt
    return out


def _empty(folder: Path) -> Path:
    import shutil

    shutil.rmtree(folder, ignore_errors=True)
    return folder


_MEASURES: dict[str, Callable[[argparse.Namespace, Path], Any]] = {
    "speed": _speed, "names": _names, "tune": _tune,
}  # fmt: skip
