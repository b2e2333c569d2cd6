"""One device watched, and what the optimal test would have done that knows the change and not its time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from bender_effects.catalogue import EFFECTS
from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_proving.cases.hidden import NOISE_UM
from bender_studies.watching.devices import SENSOR, Change
from bender_watch.baseline.learn import Baseline
from bender_watch.follow.rows import Rows
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher


@dataclass(frozen=True, slots=True)
class Trial:
    """What a watch made of a change.

    Attributes:
        effect, size, shape: of the change.
        optimal_rows: delay of the optimal test; None where it does not find the change.
        rows: delay of the watch; None where it does not.
        early: it alarmed before the change.
        suspected: the effects that the alarm suspects first, once it is explained.
        named: the effects of the diagnosis, the first first; None without one.
        either: effects that the diagnosis says to be the same as the first one, on the other side of the device.
    """

    effect: str
    size: float
    shape: str
    optimal_rows: int | None
    rows: int | None
    early: bool
    suspected: tuple[str, ...]
    named: tuple[str, ...] | None
    either: tuple[str, ...] = ()

    @property
    def is_named(self) -> bool:
        """Whether the diagnosis names the effect first."""
        return self.effect in (self.named or ())[:1]

    @property
    def is_either(self) -> bool:
        """Whether it names it, or says that the first is the same on the other side: the nominal device is linear."""
        return self.is_named or self.effect in self.either


def other_sides(effects: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Return the effects that a diagnosis reports as rivals of the first one, the same on the other side of the device.

    Args:
        effects: of the diagnosis, the first first.
    """
    first = effects[0]["id"] if effects else ""
    rivals = [x["id"] for x in effects if x.get("rival_of") == first]
    return tuple(x for x in rivals if x in EFFECTS and EFFECTS[x].same_on_other_side == first)


def optimal_row(change: Change, rows_between_false_alarms: float) -> int | None:
    """Return the row at which the CUSUM of the true log-likelihood ratio exceeds ln(rows between false alarms).

    At that threshold its mean time between false alarms is at least that many rows, and none that knows as much has a
    shorter delay (Lorden 1971, Moustakides 1986). Of a step it knows what the effect would add at every row; of a ramp
    it knows the ramp as well, from the row on where it begins.
    """
    noise = NOISE_UM[SENSOR]
    known = change.added_um / noise
    clean_e = change.noise_um / noise
    total = 0.0
    for k in range(change.row, known.size):
        total = max(0.0, total + known[k] * (clean_e[k] + known[k]) - 0.5 * known[k] ** 2)
        if total >= math.log(rows_between_false_alarms):
            return k
    return None


def judged(model: Model, training: Record, baseline: Baseline, change: Change, how: Settings) -> Trial:
    """Watch a device that changes, until the alarm of the change has been explained."""
    watcher = Watcher(model, training, baseline, how)
    rows = Rows.of(change.record)
    alarms: list[int] = []
    first: dict[str, Any] | None = None
    told: dict[str, Any] = {"suspects": []}
    for event in chain(watcher.begin_record("changed", rows), watcher.take(rows), watcher.finish()):
        if event["event"] == "alarm":
            alarms.append(event["row"] - 1)
            first = first or (event if alarms[-1] >= change.row else None)
        elif event["event"] == "explained" and first is not None and event["alarm"] == first["number"]:
            told = event
            break
    suspected = tuple(told["suspects"][0]["effects"]) if told["suspects"] else ()
    named = tuple(x["id"] for x in told["effects"]) if "effects" in told else None
    optimal = optimal_row(change, how.rows_between_false_alarms)
    return Trial(
        change.effect,
        change.size,
        change.shape,
        None if optimal is None else optimal - change.row + 1,
        None if first is None else first["row"] - change.row,
        any(x < change.row for x in alarms),
        suspected,
        named,
        other_sides(told.get("effects", ())),
    )


def median(values: Sequence[float | None]) -> float:
    """Return the median of delays, where those that never end count as longer than all."""
    return float(np.median([math.inf if x is None else x for x in values])) if values else math.nan
