"""`bender gallery`: play published rigs of other fields, diagnose them, and put all of it on one page."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_proving.gallery import PublishedRig

HELP = "rigs of other fields, simulated from published equations: what the workflow says of each"
EXAMPLE = """\
bender gallery
bender gallery servo valve --seed 7"""
PAGE, FIGURES = "index.html", "gallery.json"
INTERRUPTED = 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which rigs are played, and where the results go."""
    parser.add_argument(
        "rigs", nargs="*", metavar="RIG", help="damper, duffing, servo, tanks, thermocouple, valve (default: all)"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of excitation and noise (default: 1)")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("results/gallery"), help="default: results/gallery"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the table, write the page, its figures, and a folder with record, model and report for every rig.

    Ctrl-C keeps the rigs that are complete.
    """
    import time
    from dataclasses import asdict

    from bender_discrepancy.diagnosis import REPORT
    from bender_loop.errors import InputError
    from bender_loop.shell.files import keep_earlier, prepare_directory, write_atomically, write_result
    from bender_loop.shell.progress import Progress, print_table
    from bender_loop.shell.run import answer
    from bender_report.page import render
    from bender_studies.gallery.rig_diagnosis import diagnose_rig
    from bender_studies.gallery.story import COLUMNS, row, tell

    if arguments.seed < 0:
        raise InputError(f"--seed: found {arguments.seed}, expected 0 or more")
    rigs = _wanted(arguments.rigs)
    out = prepare_directory(arguments.out)
    keep_earlier(out, FIGURES, [PAGE, *(x.name for x in rigs)])
    played, status = [], 0
    with Progress("gallery, rigs") as bar:
        try:
            for k, rig in enumerate(rigs):
                bar.update(k, len(rigs), rig.name)
                began = time.perf_counter()
                shown = diagnose_rig(rig, arguments.seed, out)
                played.append((rig, shown, time.perf_counter() - began))
        except KeyboardInterrupt:
            status = INTERRUPTED
    if not played:
        return status
    print_table("what the workflow says of rigs of other fields", COLUMNS, [row(x, s) for _, x, s in played])
    simulated = [asdict(x) for _, x, _ in played]
    write_result(out / FIGURES, {"seed": arguments.seed, "simulated": simulated})
    write_atomically(out / PAGE, render(tell(played, report=REPORT)))
    answer({"page": str(out / PAGE), "written": str(out)})
    sys.stdout.write(f"read on: {(out / PAGE).resolve().as_uri()}\n")
    return status


def _wanted(names: list[str]) -> "list[PublishedRig]":
    from bender_loop.errors import InputError
    from bender_proving.gallery import RIGS

    for name in names:
        if name not in RIGS:
            raise InputError(f"RIG: found {name!r}, expected one of {', '.join(sorted(RIGS))}")
    return [RIGS[name] for name in dict.fromkeys(names or RIGS)]
