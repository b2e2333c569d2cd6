"""`bender completion SHELL`: the script that lets a shell complete commands and options."""

import argparse
import importlib
import sys
from functools import partial

from bender_loop.shell.completion import SHELLS, script

HELP = "print the script that completes commands and options in your shell"
EXAMPLE = """\
bender completion bash    # > ~/.local/share/bash-completion/completions/bender
bender completion zsh     # > ~/.zfunc/_bender"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the shell."""
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))


def run(arguments: argparse.Namespace) -> int:
    """Print the script, made of the parsers as they are."""
    from bender_cli.main import COMMANDS, fill_parser

    modules = {name: importlib.import_module(path) for name, path in COMMANDS.items()}
    sys.stdout.write(
        script(arguments.shell, {k: (x.HELP, partial(fill_parser, command=x)) for k, x in modules.items()})
    )
    return 0
