"""The experiment that would settle most of the units whose effects cannot be distinguished yet."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bender_fleet.population.features import Population


@dataclass(frozen=True, slots=True)
class Undecided:
    """Units that are ambiguous between the same effects.

    Attributes:
        rivals: the effects.
        units: with these rivals, one that has a profile first.
        why: what the experiment of the first unit does; None where none has one.
    """

    rivals: tuple[str, ...]
    units: tuple[str, ...]
    why: str | None


def undecided(population: Population) -> list[Undecided]:
    """Return the open units by their rivals, the commonest first.

    The profile that was designed for one unit separates the same two effects of the others as far as their sizes are
    alike; it is proposed for all of them, and judged on none but its own.
    """
    alike: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for x in population.units:
        if x.get("verdict") in ("ambiguous", "likely"):
            alike.setdefault(tuple(sorted(x["effects"])), []).append(x)
    found = []
    for rivals, own in sorted(alike.items(), key=lambda pair: (-len(pair[1]), pair[0])):
        own.sort(key=lambda x: x["next_experiment"] is None)
        found.append(Undecided(rivals, tuple(x["unit"] for x in own), own[0]["next_experiment"]))
    return found
