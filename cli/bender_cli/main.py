"""`bender COMMAND ...`: find the command, read its arguments, map every failure to an exit status.

Exit status: 0 done; 1 the run failed; 2 bad usage or bad input; 3 an output is not confirmed off, whatever else there
is; 130 interrupted; 141 a pipe's reader left.
"""

import argparse
import contextlib
import difflib
import gc
import importlib
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import NoReturn

from bender_loop.shell.failures import BAD_INPUT, FAILED, in_one_line, status_and_sentence
from bender_loop.shell.last_word import UNCONFIRMED, number_of_outputs, status_at_last
from bender_loop.shell.options import add_common_options, command_run
from bender_loop.shell.readable import make_readable

COMMANDS: Mapping[str, str] = {
    "demo": "bender_studies.demonstration.command",
    "compare": "bender_cli.commands.compare",
    "diagnose": "bender_discrepancy.command",
    "model": "bender_cli.commands.model",
    "tune": "bender_cli.commands.tune",
    "simulate": "bender_cli.commands.simulate",
    "hil": "bender_cli.commands.hil",
    "live": "bender_hil.live.command",
    "bench": "bender_cli.commands.bench",
    "investigate": "bender_investigate.command",
    "watch": "bender_watch.command",
    "effects": "bender_cli.commands.effects",
    "identify": "bender_identify.command",
    "calibrate": "bender_hil.calibration.command",
    "calibrate-model": "bender_discrepancy.foreign.calibrate_command",
    "fmu": "bender_cli.commands.fmu",
    "fleet": "bender_cli.commands.fleet",
    "gallery": "bender_studies.gallery.command",
    "reproduce": "bender_cli.commands.reproduce",
    "cache": "bender_cli.commands.cache",
    "completion": "bender_cli.commands.completion",
    "benchmark": "bender_cli.commands.benchmark",
}
"""Where each command lives, the daily ones first; nothing is imported before it is asked for."""

INTERRUPTED, PIPE_CLOSED = 130, 141
_DESCRIPTION = "Simulate a piezo bending actuator as an FMU, tune its controller, run a bench, diagnose measured data."
_CLOCK_S = 0.02
"""By which the clock of a file system may lag behind; a process takes longer than that to start."""
SELDOM = 50_000
"""New objects between two collections of garbage."""


class Parser(argparse.ArgumentParser):
    """An argument parser that complains in one line and accepts no abbreviated options."""

    def __init__(self, **settings: object) -> None:
        super().__init__(
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
            **settings,  # pyright: ignore[reportArgumentType]
        )

    def error(self, message: str) -> NoReturn:
        """Leave with exit status 2 and one line on the standard error."""
        self.exit(BAD_INPUT, f"{self.prog}: {message} (see: {self.prog} --help)\n")


def entry(begin: Callable[[], None] = lambda: None) -> NoReturn:
    """Run as a process: `bender` on the command line.

    Args:
        begin: is called when the command is loaded and its words are read, before it does anything.
    """
    for stream in (sys.stdout, sys.stderr):
        make_readable(stream)
    # imports make tens of thousands of objects that stay: looking through them after every few hundred finds nothing
    gc.set_threshold(SELDOM)
    status = main(pulse=True, begin=begin)
    if status == UNCONFIRMED:
        # nothing that the interpreter does at its end may put another status in the place of this one
        os._exit(status)
    _silence_unless_written()
    # Python remembers an interrupt that left an `exec` of a text, as imports have them, and `python -m` would end by
    # SIGINT in place of the status; another `exec` makes it forget
    exec("")
    # the interpreter would collect garbage among all objects before it ends; the process frees them at once
    gc.freeze()
    sys.exit(status)


def main(argv: list[str] | None = None, pulse: bool = False, begin: Callable[[], None] = lambda: None) -> int:
    """Run one command line; returns its exit status and lets no exception through.

    The last word is that of the outputs that the command has switched on, not that of the command.

    Args:
        argv: the words after `bender`, those of the process unless given.
        pulse: whether a thread says what is going on while the command is silent.
        begin: is called before the command does anything.
    """
    before = number_of_outputs()
    status = FAILED
    try:
        status = _judged_run(sys.argv[1:] if argv is None else argv, pulse, begin)
    except BaseException as error:  # even to say what was wrong has failed
        with contextlib.suppress(BaseException):
            _say(type(error).__name__)
    return status_at_last(status, before)


def _judged_run(words: list[str], pulse: bool, begin: Callable[[], None]) -> int:
    began_s = time.time()
    arguments = argparse.Namespace(pulse=pulse)
    try:
        try:
            status = _run(words, arguments, begin)
        except SystemExit as leaving:
            status = leaving.code if isinstance(leaving.code, int) else 0 if leaving.code is None else BAD_INPUT
        sys.stdout.flush()
    except KeyboardInterrupt:
        _say(f"interrupted{_what_is_kept(arguments, began_s)}")
        return INTERRUPTED
    except BrokenPipeError:
        _silence_stdout()
        return PIPE_CLOSED
    except Exception as error:
        status, sentence = status_and_sentence(error)
        _say(sentence)
        _silence_unless_written()
    return status


def _run(words: list[str], arguments: argparse.Namespace, begin: Callable[[], None]) -> int:
    name = words[0] if words else None
    if name is None or name.startswith("-"):
        parser = _top_parser()
        parser.parse_args(words)
        parser.error(f"name a command: {', '.join(COMMANDS)}")
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else f"; there are: {', '.join(COMMANDS)}"
        Parser(prog="bender", add_help=False).error(f"unknown command {name!r}{hint}")
    for word in words:
        if "\0" in word:
            Parser(prog=f"bender {name}", add_help=False).error(f"found a zero byte in {word[:40]!r}")
        if word.startswith("--") and word.endswith("=--"):  # argparse makes an empty list of that value
            Parser(prog=f"bender {name}", add_help=False).error(f"found {word!r}, expected a value after the =")
    command = importlib.import_module(COMMANDS[name])
    command_parser(name, command).parse_args(words[1:], arguments)
    begin()
    # a run on a bench has threads and deadlines of its own
    beat = contextlib.nullcontext() if name == "hil" or not arguments.pulse else _heartbeat(f"bender {name}", arguments)
    with command_run(words, arguments) as run, beat:
        try:
            status = command.run(arguments)
        except BaseException as error:
            run.note(f"ended by {type(error).__name__}: {error}")
            raise
        run.note(f"exit status {status}")
        return status


def _heartbeat(title: str, arguments: argparse.Namespace) -> contextlib.AbstractContextManager[None]:
    from bender_loop.shell.progress import heartbeat

    return heartbeat(title, vars(arguments).values())


def command_parser(name: str, command: ModuleType) -> Parser:
    """The parser of one command, with its HELP on top and its EXAMPLE below."""
    example = "\n".join(f"  {line}" for line in command.EXAMPLE.strip().splitlines())
    parser = Parser(prog=f"bender {name}", description=command.HELP, epilog=f"example:\n{example}")
    fill_parser(parser, command)
    return parser


def fill_parser(parser: argparse.ArgumentParser, command: ModuleType) -> None:
    """Declare the arguments of a command and the options that all commands share."""
    command.add_arguments(parser)
    add_common_options(parser)


def _top_parser() -> Parser:
    width = max(len(name) for name in COMMANDS)
    lines = [f"  {name:<{width}}  {importlib.import_module(path).HELP}" for name, path in COMMANDS.items()]
    parser = Parser(
        prog="bender",
        usage="bender COMMAND [OPTIONS]",
        description=_DESCRIPTION,
        epilog="\n".join(["commands:", *lines, "", "Options and an example of a command: bender COMMAND --help"]),
    )
    parser.add_argument("-V", "--version", action=_Version, nargs=0, help="print the version")
    return parser


class _Version(argparse.Action):
    """Prints the installed version, looked up only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import PackageNotFoundError, version

        try:
            found = version("piezo-bender")
        except PackageNotFoundError:
            found = "unknown (the distribution is not installed)"
        sys.stdout.write(f"piezo-bender {found}\n")
        parser.exit()


def _what_is_kept(arguments: argparse.Namespace, began_s: float) -> str:
    """Name the output directory where this run, and not an earlier one, has put something there."""
    out = getattr(arguments, "out", None)
    if out is None or not Path(out).is_dir():
        return ""
    with contextlib.suppress(OSError):
        for path in Path(out).rglob("*"):
            if path.is_file() and path.stat().st_mtime > began_s - _CLOCK_S:
                return f"; what is complete is in {out}"
    return ""


def _say(sentence: str) -> None:
    with contextlib.suppress(OSError):
        sys.stderr.write(f"bender: {in_one_line(sentence)}\n")
        sys.stderr.flush()


def _silence_unless_written() -> None:
    try:
        sys.stdout.flush()
    except OSError:
        _silence_stdout()


def _silence_stdout() -> None:
    """Let the interpreter's last flush go nowhere instead of complaining about the closed pipe."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
