"""The diagnosis of the rows since a change, the old model as its base, and what it means for who owns the device."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.workflow import diagnose
from bender_effects.catalogue import EFFECTS
from bender_inference.settings import Settings
from bender_loop.control.pid import Gains, Limits
from bender_loop.errors import InputError, RunError
from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_watch.alarm.history import History
from bender_watch.alarm.loop_effect import LoopFigures, loop_figures, worth_tuning

FEWEST_ROWS = 64
NOISE_DEVIATIONS = 3.0
"""Deviations by which the mean square of the residual may exceed that of the noise."""
OPEN = ("ambiguous", "unexplained")
"""Verdicts that name nothing."""
CALIBRATION = ("gain_error", "offset")


@dataclass(frozen=True, slots=True)
class Loop:
    """The loop that the device is in: the present gains.

    Attributes:
        gains: of the PID block.
        limits: of the command.
        period_s: of the loop.
    """

    gains: Gains
    limits: Limits
    period_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """What the rows since a change say.

    Attributes:
        verdict: of the diagnosis; "not diagnosed" where there was none.
        effects: as `diagnosis.json` has them.
        recalibrated: gain and offset before and after.
        sentence: of the diagnosis, or why there is none.
        model: the corrected one; None where it is no better.
        loop: figures before and after, None without gains or a corrected model.
        advice: what to do.
        rows: that were diagnosed.
        left_um: rms that the corrected model leaves on them, nan where there was no diagnosis.
        diagnosis: itself, for its files.
    """

    verdict: str
    effects: tuple[dict[str, Any], ...]
    recalibrated: dict[str, Any]
    sentence: str
    model: Model | None
    loop: tuple[LoopFigures, LoopFigures] | None
    advice: tuple[str, ...]
    rows: int
    left_um: float = math.nan
    diagnosis: Diagnosis | None = None

    def is_settled(self, noise_um: float, white: float = 1.0, *, suspected: bool = False) -> bool:
        """Return whether the rows suffice: an effect is likely at least, or none is found and the residual is noise.

        A diagnosis learns the noise from the rows that it explains. The watch knows it from the training record, and
        that there is a change: "nothing is missing" beside more than that noise says that the rows were too few, and so
        do several effects of which none is likely.

        Args:
            noise_um: deviation of the noise.
            white: part of its variance that the last rows do not foretell.
            suspected: an effect explains the rows better than level and gain do, by its signature.
        """
        most = 1.0 + NOISE_DEVIATIONS * math.sqrt(2.0 / max(self.rows * white, 1.0))
        if self.effects:
            return any(x["grade"] != "possible" for x in self.effects)
        return not suspected and not self.left_um > noise_um * math.sqrt(most)

    def to_dict(self) -> dict[str, Any]:
        """Return what stands in the line of events."""
        loop = None if self.loop is None else {"before": self.loop[0].to_dict(), "after": self.loop[1].to_dict()}
        return {
            "verdict": self.verdict,
            "effects": list(self.effects),
            "recalibrated": self.recalibrated,
            "sentence": self.sentence,
            "loop": loop,
            "advice": list(self.advice),
            "rows": self.rows,
            "corrected": self.model is not None,
        }


def record_since(history: History, place: int) -> Record:
    """Return the rows from a place of the history on as a record."""
    part = slice(place, None)
    acting = history.column("command_time_s")[part]
    time = history.column("time_s")[part]
    columns = [history.column(x)[part] for x in ("voltage_V", "displacement_um")]
    late = np.any(acting > time)
    return Record(time, *columns, command_time_s=acting if late else None)


def first_rows(record: Record, rows: int) -> Record:
    """Return the first rows of a record, all where there are no more."""
    if len(record) <= rows:
        return record
    columns: dict[str, Any] = {name: values[:rows] for name, values in record.columns().items()}
    return Record(**columns, quantities=record.quantities)


def unread_before(record: Record, rows: int) -> Record:
    """Return a record without its first readings; their commands lead to the others."""
    read = record.displacement_um.copy()
    read[:rows] = np.nan
    return replace(record, displacement_um=read)


def explain(
    base: Model,
    record: Record,
    rows: int,
    loop: Loop | None,
    suspects: Sequence[str],
    *,
    linear: bool = False,
    tell: Callable[[str], None] = lambda _: None,
) -> Explanation:
    """Return what the rows since a change say, with the old model as base.

    Args:
        base: the model that the device no longer is.
        record: the rows since the change, behind those that lead to it without a reading.
        rows: since the change.
        loop: that the device is in; None where nobody said.
        suspects: effects that the alarm itself suspects, the likeliest first.
        linear: the command runs straight from row to row.
        tell: is told what is being done.
    """
    if rows < FEWEST_ROWS:
        few = f"found {rows} rows since the change, a diagnosis takes {FEWEST_ROWS}"
        return not_diagnosed(few, advice("", suspects, None), rows)
    try:
        found = diagnose(base, [record], Settings(linear=linear), tell, ["the rows since the change"])
    except (InputError, RunError, ValueError, ArithmeticError) as error:
        return not_diagnosed(str(error), advice("", suspects, None), rows)
    facts = found.to_dict()
    effects = tuple(x for x in facts["effects"])
    corrected = None if facts.get("fmu") is None or facts["verdict"] == "no_gap" else found.model
    figures = None
    if loop is not None and corrected is not None:
        before, after = (loop_figures(x, loop.gains, loop.limits, loop.period_s) for x in (base, corrected))
        figures = (before, after)
    names = [x["id"] for x in effects] or [x for x in CALIBRATION if facts["verdict"] == "recalibrated"]
    told = advice(facts["verdict"], names, figures)
    return Explanation(
        facts["verdict"],
        effects,
        facts["recalibrated"],
        facts["sentence"],
        corrected,
        figures,
        told,
        rows,
        float(found.gap.after.all_rms_um),
        found,
    )


def not_diagnosed(why: str, told: tuple[str, ...], rows: int) -> Explanation:
    """Return that so many rows were not diagnosed, why not, and what to do."""
    return Explanation("not diagnosed", (), {}, why, None, None, told, rows)


def advice(verdict: str, effects: Sequence[str], loop: tuple[LoopFigures, LoopFigures] | None) -> tuple[str, ...]:
    """Return what to do, by where the change sits in the chain and by what it does to the loop.

    An open verdict names no effect: there the advice is to record more.
    """
    found = ["record more of the device: these rows do not tell what has changed"] if verdict in OPEN else []
    stages = {EFFECTS[x].stage for x in effects[:1] if x in EFFECTS} if verdict not in OPEN else set[str]()
    if verdict == "recalibrated" or "calibration" in stages:
        found.append("recalibrate the sensor, or take the corrected model")
    if "supply" in stages:
        found.append("look at the wire, the connectors and the amplifier")
    if "sensor" in stages:
        found.append("look at the sensor: its focus, its filter, its resolution")
    if "structure" in stages:
        found.append("look at the clamp, the glue and what the tip carries")
    if "material" in stages:
        found.append("the device's own material has changed: take the corrected model, or replace it")
    if "surroundings" in stages:
        found.append("look at the surroundings: temperature, draught, hum")
    if loop is not None and worth_tuning(*loop):
        found.append("tune again, with the corrected model")
    elif loop is not None:
        found.append("the present gains still hold")
    return tuple(found) or ("look at the rows since the change",)
