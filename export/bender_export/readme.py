"""The tables of variables in `fmu/README.md`, made from the tables that make the FMUs.

`python -m bender_export.readme` writes them afresh.
"""

from collections.abc import Sequence

from bender_export.build import checkout_folder
from bender_export.documentation import HEAD, cells
from bender_export.slaves.controller import TABLE
from bender_export.slaves.plant import table_of
from bender_export.slaves.shell import Row
from bender_loop.errors import InputError
from bender_loop.shell.files import write_atomically
from bender_plant.model import load_model


def variable_table(table: Sequence[Row]) -> str:
    """Return a Markdown table of FMI variables."""
    lines = [f"| {' | '.join(HEAD)} |", "|---|---|---|---|---|---|---|"]
    lines += [f"| {' | '.join(_cells(row))} |" for row in table]
    return "\n".join(lines)


def refreshed(text: str) -> str:
    """Return the README with its tables made afresh.

    Raises:
        InputError: a mark between which a table stands is missing.
    """
    for mark, table in (("plant", table_of(load_model("paper"))), ("controller", TABLE)):
        begin, end = f"<!-- {mark} variables -->\n", f"<!-- end of {mark} variables -->\n"
        head, found_begin, rest = text.partition(begin)
        _, found_end, tail = rest.partition(end)
        if not (found_begin and found_end):
            raise InputError(f"fmu/README.md: found no {begin.strip()} with its end, expected the table between them")
        text = f"{head}{begin}{variable_table(table)}\n{end}{tail}"
    return text


def _cells(row: Row) -> tuple[str, ...]:
    name, *between, text = cells(row)
    return f"`{name}`", *between, text.replace("|", "\\|")


def main() -> None:
    """Rewrite the README of the checkout that this code runs from."""
    folder = checkout_folder()
    if folder is None:
        raise InputError("found an installed package, expected a checkout with fmu/README.md")
    readme = folder / "README.md"
    write_atomically(readme, refreshed(readme.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()
