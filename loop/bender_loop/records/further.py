"""Further inputs of a plant: what was measured beside the command and acts on the plant as well, a load for example."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Further:
    """One further input over a record.

    Attributes:
        name: of the variable of the FMU.
        unit: of the values, empty where the column says none: they are in the unit of the variable.
        values: (n,) in every row; each holds until the next one.
    """

    name: str
    unit: str
    values: Array


@runtime_checkable
class Followed(Protocol):
    """A plant whose further inputs follow a record."""

    def follow(self, time_s: Array, further: Sequence[Further]) -> None:
        """Take further inputs from now on as they are over these times; none for those that the plant has itself."""
        ...


def follow(plant: object, time_s: Array, further: Sequence[Further]) -> None:
    """Let the further inputs of a plant follow a record from its next reset on.

    Raises:
        InputError: the plant has no inputs but its command, or not these.
    """
    if isinstance(plant, Followed):
        plant.follow(time_s, further)
    elif further:
        raise InputError(
            f"--further-input: found {further[0].name!r} for a model of one input, expected an FMU that has it"
        )


def parsed(entries: Sequence[str], option: str) -> dict[str, str]:
    """Return `NAME=COLUMN` entries as columns by name; `NAME` alone is a column of that name.

    Raises:
        InputError: an entry is empty, or a name is there twice.
    """
    found: dict[str, str] = {}
    for entry in entries:
        name, equals, column = (x.strip() for x in entry.partition("="))
        if not name or (equals and not column):
            raise InputError(f"{option}: found {entry!r}, expected NAME or NAME=COLUMN")
        if name in found:
            raise InputError(f"{option}: found {name!r} twice, expected each variable once")
        found[name] = column or name
    return found
