"""`bender investigate`: the bench excites, diagnoses, plays the next experiment, retunes and proves it by itself."""

import argparse
import shutil
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.errors import InputError
from bender_loop.shell.run import doing

if TYPE_CHECKING:
    from bender_hil.bench_file import BenchFile
    from bender_investigate.outcome import Outcome
    from bender_loop.control.pid import Gains

HELP = "let the bench find out by itself what its model lacks, and prove new gains"
EXAMPLE = """\
bender investigate                                # the emulated bench against the model `bench`
bender investigate --bench bench.toml --model paper --budget-s 300
bender investigate --record weak.csv              # begin with a record that is there
bender investigate --resume --out results/investigate-20260101-090000"""

BUDGET_S, PAIRS = 600.0, 5
MODEL = "bench"
INTERRUPTED = 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare everything."""
    parser.add_argument("--bench", type=Path, metavar="FILE", help="bench file (default: the emulated bench)")
    parser.add_argument("--model", default=MODEL, help=f"model file or built-in model (default: {MODEL})")
    parser.add_argument(
        "--budget-s", type=float, default=BUDGET_S, metavar="S", help=f"time on the bench (default: {BUDGET_S:g})"
    )
    parser.add_argument("--gains", type=Path, metavar="FILE", help="gains to improve on (default: those of the bench)")
    parser.add_argument(
        "--record",
        type=Path,
        action="append",
        metavar="FILE",
        help="a record of this bench that is there already; it takes the place of the first excitation",
    )
    parser.add_argument(
        "--pairs", type=int, default=PAIRS, metavar="N", help=f"runs with old and with new gains (default: {PAIRS})"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the excitations (default: 1)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/investigate-DATE-TIME")
    parser.add_argument(
        "--watch", action="store_true", help="serve a page with picture, charts, decisions and STOP (extra live)"
    )
    parser.add_argument("--resume", action="store_true", help="continue the investigation in --out")


def run(arguments: argparse.Namespace) -> int:
    """Investigate; returns the exit status.

    Returns:
        0, whatever the verdict; 130 after an interrupt, with the output off and everything kept for --resume; 3 when
        the output could not be confirmed off.

    Raises:
        InputError: bad settings or files, or a directory that will not do.
        RunError: the guard ended a play, or the bench does not answer.
    """
    from bender_hil.bench_file import emulated_bench, read_bench
    from bender_hil.command import watched
    from bender_hil.guard.guard import Status
    from bender_hil.guard.start import OutputUnknownError
    from bender_hil.log.read_run import RUN
    from bender_inference.records.checks import read_model
    from bender_investigate.investigation import Investigation
    from bender_investigate.real_bench import RealBench
    from bender_investigate.settings import InvestigationSettings
    from bender_loop.records.record import read_record
    from bender_loop.shell.files import prepare_directory
    from bender_native.ready import ready_plant_fmu

    out = _directory(arguments)
    try:
        settings = InvestigationSettings(budget_s=arguments.budget_s, pairs=arguments.pairs, seed=arguments.seed)
    except ValueError as error:
        raise InputError(f"--{str(error).replace('_', '-', 1)}") from None
    bench = emulated_bench() if arguments.bench is None else read_bench(arguments.bench)
    bench.calibration_of_readings()
    model = read_model(arguments.model)
    given = tuple(read_record(path) for path in arguments.record or ())
    old = _gains(arguments, bench)
    is_new = not out.exists()
    prepare_directory(out)
    arguments.out = out
    go_on = f"go on with the same options and --resume --out {out}"
    try:
        with watched(arguments) as page:
            port = RealBench(bench, lambda name: ready_plant_fmu(name), page)
            outcome = Investigation(port, model, old, out, settings, _say, given).run()
    except InputError:
        # of a bench that could not be opened nothing has been played
        if is_new and not any(out.rglob(RUN)):
            shutil.rmtree(out)
        raise
    except KeyboardInterrupt:
        sys.stderr.write(f"bender: interrupted, the output is off; {go_on}\n")
        return INTERRUPTED
    except OutputUnknownError as error:
        sys.stderr.write(f"bender: {error}\nbender: when the bench is safe again, {go_on}\n")
        return Status.UNCONFIRMED
    _tell(outcome, out)
    return 0


def _directory(arguments: argparse.Namespace) -> Path:
    """Return where the investigation goes; an earlier one is gone on with, never written over."""
    from bender_investigate.journal import JOURNAL, check_decisions
    from bender_loop.shell.files import unused

    out: Path | None = arguments.out
    if arguments.resume:
        if out is None:
            raise InputError("--resume: name the investigation with --out")
        check_decisions(out / JOURNAL)
        return out
    if out is None:
        return unused(Path("results") / f"investigate-{datetime.now().astimezone():%Y%m%d-%H%M%S}")
    if (out / JOURNAL).exists():
        raise InputError(f"{out}: holds an investigation; go on with it by --resume, or choose another directory")
    return out


def _gains(arguments: argparse.Namespace, bench: "BenchFile") -> "Gains":
    from bender_hil.command import OWN_GAINS
    from bender_tuner.results.gains_file import read_gains

    named = bench.controller.gains
    path = arguments.gains or (OWN_GAINS if named is None else bench.resolve(named))
    return read_gains(path)[0]


def _say(sentence: str) -> None:
    doing(sentence)
    sys.stdout.write(f"{sentence}\n")
    sys.stdout.flush()


def _tell(outcome: "Outcome", out: Path) -> None:
    from bender_investigate.outcome import OUTCOME

    for line in outcome.lines():
        _say(line)
    _say(f"written: {out / OUTCOME}")
