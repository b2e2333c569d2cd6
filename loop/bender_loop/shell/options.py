"""The options that every command has, declared once: what is printed, how much is said, and a log."""

import argparse
import contextlib
import io
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TextIO

from bender_loop.errors import InputError
from bender_loop.shell.bounded import MOST_RECORD_BYTES
from bender_loop.shell.run import Run, command_line, note_input, running, with_provenance
from bender_loop.shell.silence import STANDARD_OUTPUT, silence_below_python

OPTIONS = {
    "--json": "print one JSON document and nothing else, with the keys of the file that is written",
    "--quiet": "no progress, no remarks; results and errors only",
    "--verbose": "say every step, with the seconds since the beginning",
}


def add_common_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options on a command, or on its actions where it has some."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                add_common_options(below)
            return
    group = parser.add_argument_group("options of every command")
    for option, words in OPTIONS.items():
        if option not in parser._option_string_actions:
            group.add_argument(option, action="store_true", help=words)
    group.add_argument("--log", type=Path, metavar="FILE", help="append every step, with its time, to FILE")


def add_results_arguments(parser: argparse.ArgumentParser, default: Path) -> None:
    """Declare where the results of a command go, for `results_folder`."""
    about = f"a new or empty folder (default: {default}, with a number where it exists)"
    parser.add_argument("--out", type=Path, metavar="DIR", help=about)
    parser.set_defaults(usual_out=default)
    parser.add_argument("--force", action="store_true", help="write into --out even if it holds earlier results")


@contextlib.contextmanager
def command_run(words: Sequence[str], arguments: argparse.Namespace) -> Iterator[Run]:
    """Open the run of a command line that was read; under `--json` its text goes to where its document is made.

    Raises:
        InputError: options exclude each other, or there can be no log.
    """
    from bender_loop.errors import InputError

    told = vars(arguments)
    if told.get("quiet") and told.get("verbose"):
        raise InputError("--quiet and --verbose: found both, expected one of them")
    with contextlib.ExitStack() as stack:
        run = Run(command_line(words), bool(told.get("quiet")), bool(told.get("verbose")))
        if told.get("log") is not None:
            run.log = stack.enter_context(_opened(told["log"]))
        stack.enter_context(running(run))
        if told.get("json"):
            stack.enter_context(_one_document(run))
        for path in _named(told):
            note_input(path)
        yield run


def _named(told: Mapping[str, object]) -> Iterator[Path]:
    """Yield the files among the arguments: records, models, FMUs, gains, benches."""
    for name, value in told.items():
        for word in value if isinstance(value, list) else [value]:
            if name in ("out", "log") or not isinstance(word, str | Path):
                continue
            with contextlib.suppress(OSError, ValueError):
                path = Path(word)
                if path.is_file() and path.stat().st_size <= MOST_RECORD_BYTES:
                    yield path


@contextlib.contextmanager
def _one_document(run: Run) -> Iterator[None]:
    """Hold back what is printed; at the end print the answer of the run, or make a document of what was printed."""
    out, text = sys.stdout, io.StringIO()
    try:
        with silence_below_python(STANDARD_OUTPUT):
            sys.stdout = text
            yield
    except BaseException as error:
        run.answer = None
        sys.stdout = out
        # bad input is one line; of what was done before anything else failed, the words are worth keeping
        if not isinstance(error, InputError):
            sys.stderr.write(text.getvalue())
        raise
    sys.stdout = out
    out.write(_document(run, text.getvalue()))


def _document(run: Run, printed: str) -> str:
    facts = run.answer
    if facts is None:
        with contextlib.suppress(ValueError):
            json.loads(printed)
            return printed
        there = [name for name in run.written if Path(name).is_file()]
        facts = {"lines": printed.splitlines(), "written": there}
    if isinstance(facts, dict) and "provenance" not in facts:
        facts = with_provenance(facts)
    # a terminal may not show every sign of a sentence; JSON has another way to write it
    return json.dumps(facts, indent=2, allow_nan=False) + "\n"


def _opened(path: Path) -> TextIO:
    from bender_loop.errors import InputError

    try:
        if path.exists() and not path.is_file():
            raise InputError(f"--log: found {path}, which is no file; expected the name of a file to write to")
        return path.open("a", encoding="utf-8", errors="backslashreplace")
    except (OSError, ValueError) as error:
        raise InputError(f"--log: {path}: cannot be written ({error}); choose another place") from error
