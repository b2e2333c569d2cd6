"""`bender fleet`: arguments, and what each action does with them."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_discrepancy.foreign.suspects import add_suspect_argument
from bender_fleet.cluster.settings import ClusterSettings, require_cluster
from bender_loop.fmu.start_values import add_set_argument
from bender_loop.records.arguments import OneAtATime, add_record_arguments
from bender_loop.shell.run import remark

if TYPE_CHECKING:
    from bender_fleet.run import How

HELP = "diagnose, compare, identify, watch and tune over the records of many units, on a Dask cluster"
EXAMPLE = """\
bender fleet example --units 20 --out results/example
bender fleet diagnose results/example/manifest.csv --out results/fleet
bender fleet diagnose 'records/*.csv' --workers 4 --memory 2
bender fleet diagnose manifest.parquet --scheduler-file scheduler.json
bender fleet watch manifest.csv --no-diagnosis
bender fleet report unit-0007 --out results/fleet
bender fleet tune results/fleet --groups 2"""

INTERRUPTED = 130
ACTIONS = {
    "diagnose": "the diagnosis of every unit, the tables and the page",
    "compare": "the model laid over the records of every unit",
    "identify": "a hysteresis model learned from the records of every unit",
    "watch": "the later records of every unit watched with what its first one is like: which changed, what they share",
}
_SOURCE = "directory or glob (a unit a file), or manifest: CSV or Parquet with unit, record and what you add"


def add_arguments(parser: argparse.ArgumentParser) -> Any:
    """Declare the actions and their arguments; return what further actions are added to."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, about in ACTIONS.items():
        own = actions.add_parser(name, help=about, description=about)
        own.add_argument("source", nargs="+", metavar="SOURCE", help=_SOURCE)
        _add_model(own, name)
        _add_reading(own, name)
        _add_run(own, name)
        _add_cluster(own)
    report = actions.add_parser("report", help="draw the report pages of single units of a fleet that was diagnosed")
    report.add_argument("unit", nargs="+", metavar="UNIT", help="as the table names it")
    report.add_argument(
        "--out", type=Path, default=Path("results/fleet-diagnose"), metavar="DIR",
        help="output directory of bender fleet diagnose (default: results/fleet-diagnose)",
    )  # fmt: skip
    tune = actions.add_parser("tune", help="one controller for the units of a fleet that was diagnosed")
    from bender_fleet.tuning.arguments import add_tune_arguments

    add_tune_arguments(tune)
    return actions


def _add_model(parser: argparse.ArgumentParser, action: str) -> None:
    parser.add_argument("--model", help="model file or built-in model of all units that the manifest names none for")
    if action == "identify":
        parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the resampling (default: 1)")
        return
    parser.add_argument("--fmu", type=Path, metavar="FILE", help="a co-simulation FMU instead of a model")
    parser.add_argument(
        "--input", action=OneAtATime, metavar="NAME", help="input of the FMU (default: its only one, or `voltage`)"
    )
    parser.add_argument("--output", action=OneAtATime, metavar="NAME", help="output of the FMU (default: its only one)")
    add_set_argument(parser)
    if action == "diagnose":
        add_suspect_argument(parser)


def _add_reading(parser: argparse.ArgumentParser, action: str) -> None:
    add_record_arguments(parser)
    if action == "watch":
        _add_watch(parser)
        return
    parser.add_argument(
        "--input-hold", choices=("hold", "linear", "smooth"), default="hold",
        help="voltage between two rows: held (default), linear or smooth (band-limited)",
    )  # fmt: skip
    parser.add_argument("--untimed", action="store_true", help="the times are only an order")
    if action == "diagnose":
        parser.add_argument(
            "--start", choices=("auto", "rest", "motion"), default="auto",
            help="how the records begin: from rest, in motion, or as the readings say (auto, the default)",
        )  # fmt: skip
        parser.add_argument(
            "--confidence", type=float, default=0.99, metavar="P",
            help="one minus the error rate of what is said of each unit (default: 0.99)",
        )  # fmt: skip
        parser.add_argument(
            "--highest-voltage", type=float, metavar="V",
            help="that a next experiment may ask for (default: no more than the records of the unit reached)",
        )  # fmt: skip
        parser.add_argument(
            "--reports", action="store_true", help="draw every unit's report page at once (later: bender fleet report)"
        )


def _add_watch(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(untimed=False)
    parser.add_argument(
        "--input-hold", choices=("hold", "linear"), default="hold", help="voltage between two rows (default: held)"
    )
    parser.add_argument(
        "--between-false-alarms", default="1e6", metavar="ROWS|TIME",
        help="mean between two false alarms of a unit, as 1e6 rows or 30d (default: 1e6)",
    )  # fmt: skip
    parser.add_argument(
        "--learn", type=int, default=2000, metavar="N",
        help="first rows to learn from, of a unit with a single record (default: 2000)",
    )  # fmt: skip
    parser.add_argument("--no-diagnosis", action="store_true", help="say what is suspected, and no more")


def _add_run(parser: argparse.ArgumentParser, action: str) -> None:
    out = Path("results") / f"fleet-{action}"
    parser.add_argument(
        "--out", type=Path, default=out, metavar="DIR", help=f"default: {out}, which a second run goes on"
    )
    parser.add_argument("--force", action="store_true", help="do all units, not only the new and changed ones")
    parser.add_argument("--retry", action="store_true", help="do the units again that failed")


def _add_cluster(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("cluster (default: this machine, a worker a processor, on the loopback only)")
    group.add_argument("--workers", type=int, metavar="N", help="processes on this machine")
    group.add_argument("--memory", type=float, metavar="GB", help="that a worker may take (default: its part)")
    group.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler that runs: tcp://… or tls://…")
    group.add_argument("--scheduler-file", type=Path, metavar="FILE", help="that `dask scheduler` wrote")
    for name, what in (("ca", "certificate of the authority"), ("cert", "our certificate"), ("key", "our key")):
        group.add_argument(f"--tls-{name}", type=Path, metavar="FILE", help=f"{what}, for tls://")
    group.add_argument(
        "--no-shared-disk", action="store_true",
        help="send records to the workers and results back, where they do not see our files",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Do one action; return the exit status.

    Raises:
        InputError: a source, a setting, the scheduler or the output directory cannot be used; nothing was written.
        RunError: the workers cannot do the work at all, or a plant failed.
    """
    require_cluster()
    if arguments.action == "report":
        from bender_fleet.on_demand import write_reports

        return write_reports(arguments.out, arguments.unit, remark)
    if arguments.action == "tune":
        from bender_fleet.tuning.command import run_tune

        return run_tune(arguments)
    return _run_all(arguments)


def _run_all(arguments: argparse.Namespace) -> int:
    from bender_fleet.asked import asked_of, task_of
    from bender_fleet.page.page import write_page
    from bender_fleet.run import run_fleet
    from bender_fleet.sources.units import find_units

    how = _how(arguments)
    asked = asked_of(arguments)
    task = task_of(asked)
    units = find_units(arguments.source)
    for unit in units:
        task(unit)
    count = run_fleet(arguments.action, units, task, how, asked, remark)
    page = write_page(how.out, arguments.action)
    told = {"units": count.units, "new": count.new, "kept": count.kept, "missing": count.missing, **count.statuses}
    counts = [f"{number} {name}" for name, number in told.items() if number]
    words = ", ".join([*counts, f"{count.seconds:.0f} s"])
    sys.stdout.write(f"{words}\npage: {page}\ntables: {how.out / 'units.parquet'}, {how.out / 'effects.parquet'}\n")
    if count.interrupted:
        remark(f"interrupted; what is complete is in {how.out}, the same command goes on")
        return INTERRUPTED
    return 0


def _how(arguments: argparse.Namespace) -> "How":
    from bender_fleet.run import How

    cluster = ClusterSettings(
        arguments.workers, arguments.memory, arguments.scheduler, arguments.scheduler_file,
        arguments.tls_ca, arguments.tls_cert, arguments.tls_key,
    )  # fmt: skip
    return How(cluster, arguments.out, arguments.force, arguments.retry, not arguments.no_shared_disk)
