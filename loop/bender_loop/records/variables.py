"""The input and the output of an FMU that a record goes with: what their columns may be called, and their units."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import NamedTuple

from bender_loop.fmu.file import read_description
from bender_loop.fmu.ports import find_input, find_output, is_port


class Variable(NamedTuple):
    """An input or output of an FMU.

    Attributes:
        name: of the variable; a column may bear it.
        unit: that the FMU declares, or that V or um stands for in it, empty without one; a column that says none is in
            it where it is of another quantity than a record usually has.
    """

    name: str
    unit: str = ""


def variables_of(
    fmu: Path | str, input_name: str | None, output_name: str | None, has_output: bool = True
) -> Mapping[str, Variable]:
    """Return the input and the output of an FMU by the keys "voltage" and "displacement".

    Args:
        fmu: the file.
        input_name: of the input, None for the usual one.
        output_name: of the output, None for the usual one.
        has_output: whether there is one output that the record goes with.

    Raises:
        InputError: the FMU cannot be read, or has no such variables.
    """
    path = Path(fmu)
    description = read_description(path, needs_binary=False)
    found = {"voltage": find_input(path, description, input_name)}
    if has_output:
        found["displacement"] = find_output(path, description, output_name)
    return {key: Variable(port.name, port.stands_for or port.unit or "") for key, port in found.items()}


def undriven(fmu: Path | str, input_name: str | None, driven: Collection[str]) -> dict[str, str]:
    """Return the inputs of an FMU that stay as they start, with what is said where a record has a column of their name.

    Args:
        fmu: the file.
        input_name: of the input that takes the command, None for the usual one.
        driven: names of inputs that follow a column or were set.

    Raises:
        InputError: the FMU cannot be read, or has no such input.
    """
    path = Path(fmu)
    description = read_description(path, needs_binary=False)
    taken = {find_input(path, description, input_name).name, *driven}
    return {
        x.name: f"{x.name} of the FMU stays at {float(x.start or 0.0):g}; the record has a column of that name"
        for x in description.modelVariables
        if x.causality == "input" and is_port(x) and x.name not in taken
    }
