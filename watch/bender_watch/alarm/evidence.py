"""What the last rows say of a change: since when, which signature, how large; and whether a reading moves at all."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_watch.alarm.history import History
from bender_watch.alarm.onset import Onset, onset_of, onset_of_variance, wide_clip
from bender_watch.alarm.still import is_still, moves
from bender_watch.alarm.suspects import compared
from bender_watch.baseline.learn import Baseline
from bender_watch.sequential.detector import COLOURS

Array = NDArray[np.float64]
Facts = dict[str, Any]

SUSPECTED = 3
DECIDED = 0.5
"""Weight of the first suspect from which on the size of a change is that along it."""
LEAST_WEIGHT = 1e-3
"""Of a suspect: what is less likely beside the others is not told."""
ALARMS_OF_VARIANCE = ("louder", "quieter")


@dataclass(frozen=True, slots=True, eq=False)
class Looked:
    """Judged rows that are looked back on.

    Attributes:
        places: (n,) in the history.
        innovations: (n,) of them.
        whitened: (n, j) signatures.
    """

    places: NDArray[np.int64]
    innovations: Array
    whitened: Array

    def where(self, kept: NDArray[np.bool_]) -> "Looked":
        """Return some of them."""
        return Looked(self.places[kept], self.innovations[kept], self.whitened[kept])


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """The last rows beside what is normal.

    Attributes:
        history: the rows.
        baseline: what is normal.
        repeats: part of the readings of the training record that equal the one before.
    """

    history: History
    baseline: Baseline
    repeats: float

    def looked_back(self, rows: int) -> Looked:
        """Return the last rows that were judged."""
        places = np.flatnonzero(self.history.column("judged") > 0.0)
        places = places[np.isfinite(self.history.column("innovation")[places])][-rows:]
        return Looked(places, self.history.column("innovation")[places], self.history.whitened()[places])

    def onset(self, test: str, seen: Looked, since: int | None = None) -> tuple[Onset, list[Facts]]:
        """Return when the change began along what shows it best, and the effects that it suspects.

        The test that found it does not say what it is: a loop that grows is louder first.

        Args:
            test: that found the change.
            seen: the rows that are looked at.
            since: place of a row that the change was there in; None while it has just begun.
        """
        names, e, z = self.baseline.tests.names, seen.innovations, seen.whitened
        count = len(names) - len(COLOURS)
        clips = [None if since is None else wide_clip(e[since:], z[since:, j]) for j in range(count)]
        own = [onset_of(e, z[:, j], clips[j]) for j in range(count)]
        likelihood, own = compared(e, z[:, : len(own)], own, self.baseline.grows_only)
        best = int(np.argmax(likelihood))
        if test in ALARMS_OF_VARIANCE:
            other = onset_of_variance(e, test == "louder")
        else:
            other = onset_of(e, z[:, names.index(test)]) if test in COLOURS else None
        if other is not None and other.log_likelihood > likelihood[best]:
            return other, []
        weights = np.exp(likelihood - likelihood[best])
        weights /= weights.sum()
        order = np.argsort(-weights)[:SUSPECTED]
        suspects = [
            {"effects": list(self.baseline.effects[names[j]]), "weight": float(weights[j])}
            for j in order.tolist()
            if weights[j] > LEAST_WEIGHT
        ]
        # along one of several that are as likely it is the size of nothing
        return own[best] if weights[best] > DECIDED else replace(own[best], std=math.inf), suspects

    def since(self, places: NDArray[np.int64], onset: Onset) -> Facts:
        """Return rows and times of the beginning of a change, with their interval."""
        rows, times = self.history.column("row"), self.history.column("time_s")
        at = {"": onset.place, "_low": onset.low, "_high": onset.high}
        return {f"row{name}": int(rows[places[x]]) for name, x in at.items()} | {
            f"time{name}_s": float(times[places[x]]) for name, x in at.items()
        }

    def size(self, test: str, onset: Onset) -> Facts:
        """Return how large a change is: rms of what it adds while moving as in training; of a variance, its ratio.

        Args:
            test: whose change it is; "" for one along a signature.
            onset: of it.
        """
        growth = {"grows": onset.grows, "shape": "ramp" if onset.ramp else "step"}
        if test in ALARMS_OF_VARIANCE:
            return {"noise_ratio": float(np.sqrt(max(1.0 + onset.amplitude, 0.0))), "std": onset.std} | growth
        if test in COLOURS:
            return {"correlation": onset.amplitude, "std": onset.std} | growth
        noise_um = self.baseline.noise_um
        return {"rms_um": abs(onset.amplitude) * noise_um, "std_um": onset.std * noise_um} | growth

    def stands(self, row: int) -> bool:
        """Return whether the reading has not moved since a row, while the device should."""
        return is_still(*self._since_row(row), self.baseline.noise_um, self.baseline.stroke_um, self.repeats)

    def moves(self, row: int) -> bool:
        """Return whether the reading moves with the device since a row."""
        return moves(*self._since_row(row), self.baseline.noise_um, self.baseline.stroke_um)

    def _since_row(self, row: int) -> tuple[Array, Array]:
        """Return readings and what is expected of them, in um, from a row on."""
        since = self.history.column("row") >= row
        return self.history.column("displacement_um")[since], self.history.column("expected_um")[since]
