"""Which signatures are told apart on a training record.

Two whitened signatures whose cosine is near ±1 are one test: no record of this kind distinguishes their effects, and a
change along one shows along the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ALIKE = 0.9
"""Cosine of signatures of one test: a change along the other one is found with four fifths of its information."""
LEAST_APART = 0.1
"""Of a signature beside those that come first: what is less is no signature of its own."""
MOST = 18


@dataclass(frozen=True, slots=True)
class Group:
    """Signatures of one test.

    Attributes:
        place: of the one that is computed.
        effects: ids of all of them, its own first.
    """

    place: int
    effects: tuple[str, ...]


def distinct_groups(effects: Sequence[str], whitened: Array, first: int) -> list[Group]:
    """Return the groups of signatures that a record distinguishes.

    Whoever asks what a change was has level and gain free beside every effect, so effects are compared by what they add
    to these; one that adds next to nothing belongs to the nearer of them.

    Args:
        effects: (j,) ids.
        whitened: (n, j) on the record.
        first: so many lead groups of their own, in any case; the others are compared beside them.
    """
    norms = np.linalg.norm(whitened, axis=0)
    directions = whitened / np.where(norms > 0.0, norms, 1.0)
    base, _ = np.linalg.qr(directions[:, :first])
    apart = directions - base @ (base.T @ directions)
    own = np.linalg.norm(apart, axis=0)
    apart = apart / np.where(own > 0.0, own, 1.0)
    leaders, members = list(range(first)), {k: [k] for k in range(first)}
    for k in _each_effect_once(effects, apart, first):
        if norms[k] == 0.0:
            continue
        if own[k] < LEAST_APART:
            nearest = int(np.argmax(np.abs(directions[:, :first].T @ directions[:, k])))
            members[nearest].append(k)
            continue
        cosines = np.abs(apart[:, leaders[first:]].T @ apart[:, k])
        nearest = int(np.argmax(cosines)) if cosines.size else -1
        full, led = len(leaders) == MOST, effects[k] in {effects[x] for x in leaders}
        if nearest >= 0 and (cosines[nearest] > ALIKE or (full and not led)):
            members[leaders[first + nearest]].append(k)
        elif not full:
            leaders.append(k)
            members[k] = [k]
    return [Group(k, tuple(dict.fromkeys(effects[m] for m in members[k]))) for k in leaders]


def _each_effect_once(effects: Sequence[str], apart: Array, first: int) -> list[int]:
    """Return places from one on: of every effect the form most like its others, then these, if there is room.

    An effect comes in a form that nobody has chosen: what stands for it has to be like as many of them as can be. Of
    the others those come first that are least like the ones before them.

    Args:
        effects: (j,) ids.
        apart: (n, j) what each adds to level and gain, of unit size or none.
        first: place of the first effect.
    """
    leaders: list[int] = []
    others: list[tuple[float, int]] = []
    for effect in dict.fromkeys(effects[first:]):
        places = [k for k in range(first, len(effects)) if effects[k] == effect]
        alike = np.abs(apart[:, places].T @ apart[:, places])
        order = [int(np.argmax(alike.sum(axis=0)))]
        while len(order) < len(places):
            nearest = np.max(alike[order], axis=0)
            nearest[order] = np.inf
            order.append(int(np.argmin(nearest)))
            others.append((float(nearest[order[-1]]), places[order[-1]]))
        leaders.append(places[order[0]])
    return [*leaders, *(k for _, k in sorted(others))]
