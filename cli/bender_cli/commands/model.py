"""`bender model fit`: a first model from records alone."""

import argparse

HELP = "make a first model (gain, delay, lags, modes) from records alone"
EXAMPLE = """\
bender model fit record.csv
bender model fit steps.csv sweep.csv --input-hold linear --out mine.toml
bender model fit record.csv --template gain+mode --columns time=t,voltage=U,displacement=d"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions and their arguments."""
    from bender_identify.first_model.command import add_arguments as add_fit_arguments

    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    fit = actions.add_parser("fit", help="fit structures up to the fourth order and keep the one the records support")
    add_fit_arguments(fit)


def run(arguments: argparse.Namespace) -> int:
    """Fit and write the model.

    Raises:
        InputError: a record or an option cannot be used.
        RunError: no structure follows the records.
    """
    from bender_identify.first_model.command import run as run_fit

    return run_fit(arguments)
