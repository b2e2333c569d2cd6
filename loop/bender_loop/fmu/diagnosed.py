"""What the diagnosis beside a corrected model says of it."""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from bender_loop.tables.quantities import MICROMETRE, VOLT

DIAGNOSIS, _DELAY, _OWN_DELAY = "diagnosis.json", "transport_delay", "transport_delay.delay_s"
_SPREAD = math.sqrt(12.0)
"""A motion that is spread evenly over its span has a standard deviation of this part of it."""
_DEVIATIONS = 2.0
LEAST_GAIN_ERROR_PERCENT = 5.0
"""What the gain of a device changes by from one day to the next, whatever a record says."""
LEAST_PROBABILITY = 0.01
"""A rival that is less likely is none to be designed for."""


@dataclass(frozen=True, slots=True)
class RivalModel:
    """A model that the records do not rule out beside the corrected one.

    Attributes:
        effects: that it has, by their ids.
        model: its file.
        fmu: of it.
    """

    effects: tuple[str, ...]
    model: Path
    fmu: Path

    @property
    def name(self) -> str:
        """For people."""
        return " + ".join(self.effects) or "no effect"


class Known(NamedTuple):
    """How far a device may be from its model: its gain in per cent, its dead time in s."""

    gain_error_percent: float
    delay_error_s: float


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """What a diagnosis says of the model that it left.

    Attributes:
        rms_um: residual of the model on held-out rows; 0 where it was not measured.
        units: of command and reading, in which that and the model's V and um are.
        rivals: what the records leave open beside the model, and what a controller is to be designed for.
        unlikely: the names of those for which none is.
        known: how well the device is known by its records; None where they do not bound gain and dead time both, or
            the model is no longer as it was written.
        vouched_for: the model is as the diagnosis left it.
        source: by which file and which numbers the device is known so well, or why it is not, in words.
    """

    rms_um: float = 0.0
    units: tuple[str, str] = (VOLT, MICROMETRE)
    rivals: tuple[RivalModel, ...] = ()
    known: Known | None = None
    vouched_for: bool = False
    unlikely: tuple[str, ...] = ()
    source: str = field(default=f"no {DIAGNOSIS} beside the model says more", compare=False)

    def with_fmus_of(self, fmu_of: Callable[[Path], Path]) -> "Diagnosed":
        """Return the same with FMUs that `fmu_of` makes of the files of the rivals."""
        return replace(self, rivals=tuple(replace(x, fmu=fmu_of(x.model)) for x in self.rivals))


NOTHING = Diagnosed()


def diagnosed(model: Path | str | None) -> Diagnosed:
    """Return what the diagnosis in the folder of a model or FMU says of it; nothing where it is not of this model."""
    if model is None:
        return NOTHING
    folder = Path(model).parent
    try:
        told = json.loads((folder / DIAGNOSIS).read_text(encoding="utf-8"))
        if Path(model).name not in (told["model"], told["fmu"]):
            return NOTHING
        units = str(told["input_unit"]), str(told["unit"])
        open_ = [(_rival(folder, x), float(x.get("probability", 1.0))) for x in told.get("rival_models", ())]
        rivals = tuple(x for x, likely in open_ if likely >= LEAST_PROBABILITY)
        unlikely = tuple(x.name for x, likely in open_ if likely < LEAST_PROBABILITY)
        vouched_for = _is_as_written(Path(model), told)
        known = _known(told) if vouched_for else None
        source = f"{folder / DIAGNOSIS}{_source(told, known, vouched_for=vouched_for)}"
        return Diagnosed(float(told["gap"]["after"]["rms"]), units, rivals, known, vouched_for, unlikely, source)
    except (OSError, ValueError, LookupError, TypeError):
        return NOTHING


def _is_as_written(model: Path, told: dict[str, Any]) -> bool:
    """Whether a file is as the diagnosis left it: what was found of one does not hold for another."""
    digest = told.get("sha256", {}).get(model.name)
    return digest is not None and model.is_file() and digest == hashlib.sha256(model.read_bytes()).hexdigest()


def _known(told: dict[str, Any]) -> Known | None:
    left, delay_s = told["gap"]["after"].get("nrmse_percent"), _delay_error_s(told)
    if left is None or delay_s is None:
        return None
    return Known(max(_gain_error_percent(float(left), told), LEAST_GAIN_ERROR_PERCENT), delay_s)


def _source(told: dict[str, Any], known: Known | None, *, vouched_for: bool) -> str:
    """Return what a diagnosis says of gain and dead time, or which of them it does not bound, behind its name."""
    if not vouched_for:
        return " is of another file than this one"
    left, gain = told["gap"]["after"].get("nrmse_percent"), told.get("recalibrated", {}).get("gain")
    if left is None:
        return " does not bound the gain: gap.after.nrmse_percent is null"
    if known is None:
        return (
            " does not bound the dead time: no interval of transport_delay stands in effects, refitted or "
            "smallest_visible"
        )
    said = f": gap.after.nrmse_percent is {left:.3g}"
    if gain and gain.get("std") and gain.get("after"):
        said += f", recalibrated.gain {gain['after']:.4g} ± {gain['std']:.2g}"
    least = f"; a gain is taken as known to {LEAST_GAIN_ERROR_PERCENT:g} % at best"
    said = f"{said}, and the dead time is known to {known.delay_error_s:.2g} s"
    return said + (least if known.gain_error_percent == LEAST_GAIN_ERROR_PERCENT else "")


def _gain_error_percent(left_percent: float, told: dict[str, Any]) -> float:
    """Return the error of the gain that would leave twice of what the model leaves on held-out rows, noise included.

    What a wrong gain leaves of a motion is that part of it. A residual is what all numbers of the model are wrong by
    together, which their own intervals are not. A gain that was recalibrated is known no better than its interval.
    """
    error = _DEVIATIONS * _SPREAD * left_percent
    gain = told.get("recalibrated", {}).get("gain")
    if gain and gain.get("std") and gain.get("after"):
        error += _DEVIATIONS * 100.0 * abs(float(gain["std"]) / float(gain["after"]))
    return error


def _delay_error_s(told: dict[str, Any]) -> float | None:
    """Return half the interval of a dead time that was found or fitted again, or the shortest that would have shown."""
    for effect in told.get("effects", ()):
        if effect["id"] == _DELAY:
            low_s, high_s = effect["parameters"]["delay_s"]["interval_95"]
            return 0.5 * (float(high_s) - float(low_s))
    own = told.get("refitted", {}).get(_OWN_DELAY)
    if own and own.get("std") is not None:
        return _DEVIATIONS * float(own["std"])
    visible = told.get("smallest_visible", {}).get(_DELAY)
    return None if not visible or visible["value"] is None else float(visible["value"])


def _rival(folder: Path, told: dict[str, Any]) -> RivalModel:
    return RivalModel(tuple(map(str, told["effects"])), folder / told["model"], folder / told["fmu"])
