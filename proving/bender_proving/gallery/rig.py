"""What a rig of the gallery tells of itself."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class RigRecord:
    """A record of a rig, arrays of shape (n,), input and output in the rig's units."""

    time_s: Array
    drive: Array
    reading: Array


@dataclass(frozen=True, slots=True)
class PublishedRig:
    """A rig, the linear model that is given with it, and what that model lacks.

    Attributes:
        name: of the rig, a word.
        title: in words.
        source: who published the equations.
        drive: name and unit of the input.
        reading: name and unit of the output.
        gain: static gain of the given model, in units of the output per unit of the input.
        lags_s: time constants of the given model.
        mode: frequency in Hz and damping ratio of the given model, None where it has none.
        missing: what the given model lacks, in words.
        names: the effects of the catalogue that say the same; none where the catalogue has no word for it.
        play: draws a record.
    """

    name: str
    title: str
    source: str
    drive: tuple[str, str]
    reading: tuple[str, str]
    gain: float
    lags_s: tuple[float, ...]
    mode: tuple[float, float] | None
    missing: str
    names: frozenset[str]
    play: Callable[[Generator], RigRecord]
