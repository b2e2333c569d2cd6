"""The options of every command that reads records: names, units and layout of the columns."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_loop.records.record import Record
    from bender_loop.records.variables import Variable
    from bender_loop.tables.text_layout import TextLayout


def add_record_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how the files of records are read; what is not given is found and said in one line."""
    group = parser.add_argument_group("records in other forms")
    group.add_argument("--columns", metavar="NAMES", help="other names, as time=t,voltage=U,displacement=d or as t,U,d")
    group.add_argument("--units", metavar="UNITS", help="other units of these columns, as ms,V,mm")
    group.add_argument("--delimiter", metavar="SIGN", help="between columns: tab, semicolon, comma, bar, spaces")
    group.add_argument("--decimal", metavar="SIGN", help="the decimal sign: . or ,")
    group.add_argument("--encoding", metavar="NAME", help="of a text file, as utf-8, utf-16, cp1252")
    group.add_argument("--skip-rows", type=int, metavar="N", help="lines to skip at the top")
    group.add_argument(
        "--exposure", type=float, metavar="S", help="exposure: each reading is the mean over this time around its own"
    )
    group.add_argument(
        "--no-header", action="store_true", help="the file has no header: --columns takes numbers, as 1,2,3"
    )


def add_port_arguments(parser: argparse.ArgumentParser, several: bool = False) -> None:
    """Declare the input and the output of an FMU, each with its column in the records; `several` outputs, or one."""
    about = "of the FMU (default: its only one, or `{0}`), and its column in the records (default: {0}, or of its name)"
    parser.add_argument("--input", action=_PortAction, metavar="NAME[=COLUMN]", help=f"input {about.format('voltage')}")
    words = f"output {about.format('displacement')}"
    if several:
        more = "; more than one are diagnosed each by itself and together"
        parser.add_argument("--output", action="append", default=[], metavar="NAME[=COLUMN]", help=words + more)
    else:
        parser.add_argument("--output", action=_PortAction, metavar="NAME[=COLUMN]", help=words)


class OneAtATime(argparse.Action):
    """Keeps the name of an input or an output, and refuses a second one."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, *_: object
    ) -> None:
        """Take the name.

        A second one ends the command with status 2.
        """
        before = getattr(namespace, self.dest, None)
        if before is not None:
            parser.error(f"--{self.dest}: found {str(values)!r} beside {before!r}, expected one {self.dest} at a time")
        setattr(namespace, self.dest, values)


class _PortAction(OneAtATime):
    """Keeps the name of a variable as `input`, and the column that stands behind it as `input_column`."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, *_: object
    ) -> None:
        name, equals, column = (x.strip() for x in str(values).partition("="))
        if not name or (equals and not column):
            parser.error(f"--{self.dest}: found {values!r}, expected NAME or NAME=COLUMN")
        super().__call__(parser, namespace, name)
        setattr(namespace, f"{self.dest}_column", column or None)


def add_further_argument(parser: argparse.ArgumentParser) -> None:
    """Declare inputs of an FMU that follow columns of the record beside the command."""
    parser.add_argument(
        "--further-input",
        action="append",
        default=[],
        metavar="NAME[=COLUMN]",
        help="an input of the FMU beside the command, and the column that it follows (default: one of its name); "
        "without it the input stays at its start value, even where the record has a column of its name",
    )


def layout_of(arguments: argparse.Namespace) -> "TextLayout":
    """Return how text files are read, as the options say.

    Raises:
        InputError: an option cannot be used.
    """
    from bender_loop.errors import InputError
    from bender_loop.tables.text_layout import TextLayout, with_options

    try:
        return with_options(
            TextLayout(),
            delimiter=arguments.delimiter,
            decimal=arguments.decimal,
            encoding=arguments.encoding,
            skip_rows=arguments.skip_rows,
            header=False if arguments.no_header else None,
        )
    except ValueError as error:
        raise InputError(f"--{str(error).replace('skip_rows', 'skip-rows')}") from None


def record_of(
    arguments: argparse.Namespace, path: Path, reading: str | None = None, output: str | None = None
) -> "Record":
    """Return the record of a file, read as the options say; how it was read goes to the standard error.

    Args:
        arguments: of a command that declares `add_record_arguments`.
        path: of the file.
        reading: the column that was read, in the place of the displacement.
        output: of the FMU, where there are several.

    Raises:
        InputError: the file or an option cannot be used.
    """
    from dataclasses import replace

    from bender_loop.errors import InputError
    from bender_loop.records.further import parsed
    from bender_loop.records.record import read_record
    from bender_loop.shell.progress import Progress

    layout = layout_of(arguments)
    further = parsed(getattr(arguments, "further_input", []), "--further-input")
    if further and getattr(arguments, "fmu", None) is None:
        raise InputError("--further-input: found without --fmu, expected with it: a model has one input")
    if further and getattr(arguments, "untimed", False):
        raise InputError("--further-input: found with --untimed, expected a record whose times are known")
    reading = reading or getattr(arguments, "output_column", None)
    command: str | None = getattr(arguments, "input_column", None)
    if (command or reading) and getattr(arguments, "fmu", None) is None:
        raise InputError("--input, --output: found without --fmu, expected with it: they name variables of an FMU")
    with Progress(f"reading {path.name}") as bar:
        variables, undriven = _variables(arguments, output), _undriven(arguments, further)
        record = read_record(
            path, arguments.columns, arguments.units, layout, _tell, bar.update, reading, further, variables, command,
            undriven,
        )  # fmt: skip
    if reading is None and "displacement" in variables and not variables["displacement"].unit:
        _tell_unit(path, variables["displacement"].name, record)
    if arguments.exposure is None:
        return record
    try:
        return replace(record, exposure_s=[arguments.exposure] * len(record))
    except ValueError:
        longest_s = record.time_s[-1] - record.time_s[0]
        raise InputError(f"--exposure: found {arguments.exposure:g} s, expected 0 to {longest_s:.4g} s") from None


def _variables(arguments: argparse.Namespace, output: str | None) -> "Mapping[str, Variable]":
    """Return the input and the output of the FMU that a record goes with, by the keys of its columns."""
    if getattr(arguments, "fmu", None) is None:
        return {}
    from bender_loop.records.further import parsed
    from bender_loop.records.variables import variables_of

    outputs = [arguments.output] if isinstance(arguments.output, str) else list(parsed(arguments.output or [], ""))
    name = output or (outputs[0] if outputs else None)
    return variables_of(arguments.fmu, arguments.input, name, output is not None or len(outputs) < 2)


def _undriven(arguments: argparse.Namespace, further: "Mapping[str, str]") -> dict[str, str]:
    """Return the inputs of the FMU that nothing drives, and what is said where a record has a column of their name."""
    if getattr(arguments, "fmu", None) is None:
        return {}
    from bender_loop.records.variables import undriven

    held = [str(x).rpartition("=")[0] for x in getattr(arguments, "start_values", [])]
    return {
        name: f"{sentence}: --further-input {name}"
        for name, sentence in undriven(arguments.fmu, arguments.input, [*further, *held]).items()
    }


def _tell_unit(path: Path, output: str, record: "Record") -> None:
    said = record.quantities.stated[1] or record.quantities.reading
    _tell(f"{output}: the FMU declares no unit for this output; it is taken in {said}, as {path.name} has it (--units)")


def _tell(line: str) -> None:
    from bender_loop.shell.run import remark_held

    remark_held(line)
