"""`bender watch MODEL RECORD…`: arguments, what is printed, exit status."""

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_loop.records.arguments import OneAtATime
from bender_loop.shell.run import remark_held

if TYPE_CHECKING:
    from bender_watch.session import Session
    from bender_watch.watcher import Watcher

HELP = "keep a model beside the running device: alarms that say what changed, since when and how much"
EXAMPLE = """\
bender watch model.toml today.csv --training lastweek.csv
bender watch model.toml results/hil --training lastweek.csv --gains gains.toml
bender watch model.toml records/ --training first.csv --replay --between-false-alarms 30d"""

ALARMED = 3
"""Exit status where an alarm was raised."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the model, the records, the training record, and how the device is watched."""
    parser.add_argument("model", metavar="MODEL", help="model file, built-in name, or an FMU (.fmu)")
    parser.add_argument(
        "record",
        nargs="+",
        metavar="RECORD|FOLDER|RUN|-",
        help="CSV that grows, folder of them, run on the bench, or stdin",
    )
    parser.add_argument(
        "--training",
        type=Path,
        metavar="FILE",
        help="record of the device while all was well (default: the first rows)",
    )
    parser.add_argument(
        "--learn",
        type=int,
        default=2000,
        metavar="N",
        help="first rows to learn from without --training (default: 2000)",
    )
    parser.add_argument(
        "--between-false-alarms", default="1e6", metavar="ROWS|TIME",
        help="mean between two false alarms, of all tests together, as 1e6 rows or 30d (default: 1e6)",
    )  # fmt: skip
    parser.add_argument("--replay", action="store_true", help="read what is there and end, instead of waiting for more")
    parser.add_argument("--no-diagnosis", action="store_true", help="say what is suspected at once, and no more")
    parser.add_argument(
        "--keep-model", action="store_true", help="do not go on with the corrected model of a diagnosis"
    )
    parser.add_argument(
        "--explain-after", type=int, default=1000, metavar="N", help="rows since a change that a diagnosis waits for"
    )
    parser.add_argument(
        "--tolerance", type=float, default=5.0, metavar="PERCENT", help="of the stroke, for trends (default: 5)"
    )
    parser.add_argument("--gains", type=Path, metavar="FILE", help="gains of the loop that the device is in")
    parser.add_argument(
        "--input", action=OneAtATime, metavar="NAME", help="input of the FMU (default: its only one, or `voltage`)"
    )
    parser.add_argument("--output", action=OneAtATime, metavar="NAME", help="output of the FMU (default: its only one)")
    parser.add_argument(
        "--input-hold", choices=("hold", "linear"), default="hold", help="voltage between two rows (default: held)"
    )
    parser.add_argument("--columns", metavar="NAMES", help="other names, as time=t,voltage=U,displacement=d")
    parser.add_argument("--units", metavar="UNITS", help="other units of these columns, as ms,V,mm")
    parser.add_argument("--jsonl", action="store_true", help="print every event as a line of JSON")
    parser.add_argument(
        "--out", type=Path, default=Path("results/watch"), metavar="DIR",
        help="default: results/watch; a watch that ended or was killed there goes on",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Watch; return 0 where no alarm was raised, 3 where one was.

    Raises:
        InputError: a model, a record or an option will not do.
    """
    from bender_watch.report.page import write_report
    from bender_watch.session import EVENTS, REPORT, SUMMARY

    session = _session(arguments)
    try:
        watcher = session.run()
    except KeyboardInterrupt:
        if session.watcher is None:
            raise
        watcher = session.watcher
    facts = summary(session, watcher)
    from bender_loop.shell.files import write_result

    write_result(arguments.out / SUMMARY, facts)
    write_report(arguments.out / REPORT, session, watcher, facts)
    if not arguments.jsonl:
        _print(arguments, facts, [EVENTS, SUMMARY, REPORT])
    return ALARMED if watcher.alarms else 0


def _session(arguments: argparse.Namespace) -> "Session":
    from bender_loop.errors import InputError
    from bender_loop.records.common_units import in_units_of
    from bender_loop.records.record import read_record
    from bender_loop.shell.bounded import refuse_no_file
    from bender_loop.tables.quantities import Quantities
    from bender_plant.model import Model
    from bender_watch.follow.heading import Naming
    from bender_watch.follow.sources import Source
    from bender_watch.session import Session
    from bender_watch.settings import Settings, rows_of

    unread = _unread(arguments)
    training = None
    if arguments.training is not None:
        training = read_record(arguments.training, arguments.columns, arguments.units, tell=remark_held, unread=unread)
    model = _model(arguments)
    stated = model.units if isinstance(model, Model) else None
    interval_s = None
    if training is not None:
        training = in_units_of([training], stated, [str(arguments.training)])[0]
        interval_s = float((training.time_s[-1] - training.time_s[0]) / (len(training) - 1))
    try:
        every = rows_of(arguments.between_false_alarms, interval_s)
    except InputError as error:
        raise InputError(f"--between-false-alarms: {error}") from None
    settings = Settings(
        rows_between_false_alarms=every,
        learn_rows=arguments.learn,
        linear=arguments.input_hold == "linear",
        diagnose=not arguments.no_diagnosis,
        adopt=not arguments.keep_model,
        explain_rows=arguments.explain_after,
        tolerance=arguments.tolerance / 100.0,
    )
    paths = [] if arguments.record == ["-"] else [Path(x) for x in arguments.record]
    kept = training.quantities if training is not None else None if stated is None else Quantities(*stated)
    naming = Naming(arguments.columns, arguments.units, kept, tuple(unread.items())).checked()
    source = Source(paths, naming, follow=not arguments.replay)
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: no such file, expected a record, a folder of records, a run, or - for stdin")
        refuse_no_file(path, "a record, a folder of records, a run, or - for stdin")
    return Session(model, source, settings, arguments.out, training, _loop(arguments), _say(arguments), _tell)


def _model(arguments: argparse.Namespace) -> Any:
    from bender_loop.errors import InputError
    from bender_plant.model import load_model
    from bender_plant.parameter import ModelError
    from bender_watch.baseline.expectation import OfFmu

    if arguments.model.lower().endswith(".fmu"):
        return OfFmu(Path(arguments.model), arguments.input, arguments.output)
    if arguments.input or arguments.output:
        raise InputError("--input, --output: found beside a model, expected with an FMU only")
    try:
        return load_model(arguments.model)
    except ModelError as error:
        raise InputError(str(error)) from None


def _unread(arguments: argparse.Namespace) -> dict[str, str]:
    """Return the inputs of an FMU that nothing drives, and what is said where a record has a column of their name."""
    if not arguments.model.lower().endswith(".fmu"):
        return {}
    from bender_loop.records.variables import undriven

    stays = undriven(arguments.model, arguments.input, ())
    return {name: f"{sentence}, and a watch drives one input alone" for name, sentence in stays.items()}


def _loop(arguments: argparse.Namespace) -> Any:
    if arguments.gains is None:
        return None
    from bender_tuner.results.gains_file import read_gains
    from bender_watch.alarm.explain import Loop

    return Loop(*read_gains(arguments.gains))


def _tell(sentence: str) -> None:
    from bender_loop.shell.run import step

    step(f"bender watch: {sentence}")


def _say(arguments: argparse.Namespace) -> Any:
    from bender_watch.session import finite
    from bender_watch.words import sentence

    def as_json(event: dict[str, Any]) -> None:
        sys.stdout.write(json.dumps(finite(event)) + "\n")
        sys.stdout.flush()

    def in_words(event: dict[str, Any]) -> None:
        sys.stdout.write(sentence(event) + "\n")
        sys.stdout.flush()

    return as_json if arguments.jsonl else in_words


def summary(session: "Session", watcher: "Watcher") -> dict[str, Any]:
    """Return what `watch.json` holds."""
    return summary_of(watcher, session.events) | {"bad_rows": session.source.bad}


def summary_of(watcher: "Watcher", events: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what a watch has come to, by its events."""
    from dataclasses import asdict

    from bender_watch.session import finite

    return finite(
        {
            "rows": watcher.rows,
            "judged": watcher.judged,
            "lost": watcher.lost,
            "outside_training_range": watcher.excursions.rows,
            "alarms": watcher.alarms,
            "rows_between_false_alarms": watcher.settings.rows_between_false_alarms,
            "events": [x for x in events if x["event"] in ("alarm", "explained", "trend")],
            "trends": [asdict(x) for x in watcher.trend()],
            "baseline": watcher.baseline.facts(),
        }
        | watcher.units
    )


def _print(arguments: argparse.Namespace, facts: dict[str, Any], files: list[str]) -> None:
    lost, beyond, bad = facts["lost"], facts["outside_training_range"], facts["bad_rows"]
    told = [f"{facts['rows']} rows, {facts['judged']} judged"]
    told += [f"{lost} lost"] if lost else []
    told += [f"{beyond} outside the training range"] if beyond else []
    told += [f"{bad} bad"] if bad else []
    count = facts["alarms"]
    told.append("no alarm" if not count else f"{count} alarm{'s' if count > 1 else ''}")
    sys.stdout.write(f"{', '.join(told)}\n")
    sys.stdout.write(f"written: {', '.join(str(arguments.out / x) for x in files)}\n")
