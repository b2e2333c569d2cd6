"""The table of an investigation that was killed again and again: phases down, processes across."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from bender_studies.investigations.kills import PHASES, Chain, Kill

WHO = ("investigation", "guard", "microscope", "supply", "page server", "STOP button")
COLUMNS = ("kill -9 in", *WHO)


def rows(chains: Sequence[Chain]) -> list[list[str]]:
    """Return a row for each phase in which somebody was killed; a process that does not live there has no word."""
    kills = [x for chain in chains for x in chain.kills]
    missed = {x for chain in chains for x in chain.missed}
    found = []
    for phase in PHASES:
        cells = [_cell([x for x in kills if (x.phase, x.who) == (phase, who)], (phase, who) in missed) for who in WHO]
        if any(cells):
            found.append([phase, *(x or "-" for x in cells)])
    return found


def _cell(kills: Sequence[Kill], is_missed: bool) -> str:
    if any(x.broken for x in kills):
        return "BROKEN"
    if is_missed or not kills:
        return "not reached" if is_missed else ""
    words = [x.outcome if x.seconds is None else f"{x.outcome}, {x.seconds:.1f} s" for x in kills]
    return "; ".join(dict.fromkeys(words))


def sentences(chains: Sequence[Chain]) -> list[str]:
    """Return how each investigation ended, what it played, and all that is not as it should be."""
    lines = []
    for chain in chains:
        played = chain.played
        lines.append(
            f"{chain.name}: {len(chain.kills)} kills in {chain.sittings} sittings, {chain.mishaps} of "
            f"them ended by a busy machine; {played.rows} rows of profiles "
            f"played, {len(played.twice)} plays repeat something; the supply took {played.levels} levels, "
            f"{played.unknown} that no journal knows; verdict {chain.verdict or 'none'}, {chain.ended}"
        )
        lines += [f"  {x.phase}, {x.who}: {x.broken}" for x in chain.kills if x.broken]
        lines += [f"  at the end: {chain.broken}"] if chain.broken else []
    return lines


def is_whole(chains: Sequence[Chain]) -> bool:
    """Return whether every kill and every end is as it should be, and none was missed."""
    return not any(chain.broken or chain.missed or any(x.broken for x in chain.kills) for chain in chains)


def to_list(chains: Sequence[Chain]) -> list[dict[str, Any]]:
    """Return everything for a file."""
    return [asdict(x) for x in chains]
