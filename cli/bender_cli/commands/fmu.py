"""`bender fmu check FILE`: what is wrong with an FMU, one finding per line."""

import argparse
import sys
import zipfile
from pathlib import Path

HELP = "check any FMU against the standard"
EXAMPLE = "bender fmu check fmu/PiezoBender.fmu"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions and their arguments."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    check = actions.add_parser("check", help="print what fmpy's validation finds; exit status 1 if anything")
    check.add_argument("file", type=Path, metavar="FILE", help="an FMU of FMI 1.0, 2.0 or 3.0")


def run(arguments: argparse.Namespace) -> int:
    """Print the findings; returns 1 when there are any.

    Raises:
        InputError: the file is missing or is not an FMU.
    """
    path: Path = arguments.file
    _refuse_what_is_no_fmu(path)
    from fmpy.validation import validate_fmu

    findings = [" ".join(finding.split()) for finding in validate_fmu(str(path))]
    for finding in findings:
        sys.stdout.write(f"{path}: {finding}\n")
    sys.stdout.write(f"{path}: {len(findings)} findings\n" if findings else f"{path}: no findings\n")
    return 1 if findings else 0


def _refuse_what_is_no_fmu(path: Path) -> None:
    from bender_loop.errors import InputError

    if not path.is_file():
        raise InputError(f"{path}: found no file, expected an FMU; make one with: python build_fmu.py")
    try:
        with zipfile.ZipFile(path) as archive:
            archive.getinfo("modelDescription.xml")
    except (zipfile.BadZipFile, KeyError):
        reason = "expected an FMU, a zip archive with modelDescription.xml at its top"
        raise InputError(f"{path}: found no model description, {reason}") from None
