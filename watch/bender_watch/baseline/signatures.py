"""Which signatures are told apart on a training record.

Two whitened signatures whose cosine is near ±1 are one test: no record of this kind tells their effects apart, and a
change along one shows along the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ALIKE = 0.9
"""Cosine of signatures of one test: a change along the other one is found with four fifths of its information."""
MOST = 14


@dataclass(frozen=True, slots=True)
class Group:
    """Signatures of one test.

    Attributes:
        place: of the one that is computed.
        effects: ids of all of them, its own first.
    """

    place: int
    effects: tuple[str, ...]


def told_apart(effects: Sequence[str], whitened: Array, first: int) -> list[Group]:
    """Return the groups of signatures that a record tells apart.

    Args:
        effects: (j,) ids.
        whitened: (n, j) on the record.
        first: so many lead groups of their own, in any case.
    """
    norms = np.linalg.norm(whitened, axis=0)
    directions = whitened / np.where(norms > 0.0, norms, 1.0)
    leaders, members = list(range(first)), {k: [k] for k in range(first)}
    for k in range(first, len(effects)):
        if norms[k] == 0.0:
            continue
        cosines = np.abs(directions[:, leaders].T @ directions[:, k])
        nearest = int(np.argmax(cosines)) if cosines.size else -1
        if nearest >= 0 and cosines[nearest] > ALIKE:
            members[leaders[nearest]].append(k)
        elif len(leaders) < MOST:
            leaders.append(k)
            members[k] = [k]
        elif nearest >= 0:
            members[leaders[nearest]].append(k)
    return [Group(k, tuple(dict.fromkeys(effects[m] for m in members[k]))) for k in leaders]
