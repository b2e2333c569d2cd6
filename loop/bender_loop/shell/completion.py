"""The script that lets a shell complete commands, actions and options, made of their parsers."""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

SHELLS = ("bash", "zsh", "tcsh")


def script(shell: str, commands: Mapping[str, tuple[str, Callable[[argparse.ArgumentParser], None]]]) -> str:
    """Return the script of a shell; paths complete to files.

    Args:
        shell: one of `SHELLS`.
        commands: what each is for, and what declares its arguments.
    """
    import shtab

    parser = argparse.ArgumentParser(prog="bender")
    below = parser.add_subparsers()
    for name, (words, fill) in commands.items():
        fill(command := below.add_parser(name, help=words))
        _complete_files(command, shtab.FILE)
    return shtab.complete(parser, shell=shell) + "\n"


def _complete_files(parser: argparse.ArgumentParser, files: object) -> None:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                _complete_files(below, files)
        elif action.type is Path:
            action.complete = files  # pyright: ignore[reportAttributeAccessIssue]
