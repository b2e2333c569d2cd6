"""Confusable effects under an excitation that cannot distinguish them.

Under one frequency at one amplitude every effect with a memory is a loop, and a family of hysteresis operators can
match any loop. After a single step, a slow course may be the material's, the supply's or the room's, and a lag may sit
before or after the rest of a chain that is nearly linear there. Cases are drawn until the simplest form of a rival
leaves so little that no criterion could prefer the truth; only hidden hysteresis is taken without that test, since no
simple rival has its loop.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

from numpy.random import Generator

from bender_proving.records import excitations
from bender_proving.cases.case import Weak
from bender_proving.chain import readings_um
from bender_proving.cases.effects import effect
from bender_proving.records.excitation import Excitation
from bender_proving.cases.hidden import NOISE_UM, Hidden, Values, log_uniform
from bender_proving.physics.lobatto import Array
from bender_proving.cases.residual import left_over_um
from bender_proving.cases.rivals import mimicked_um

MEMORY = ("rate_independent_hysteresis", "source_resistance", "sensor_lag", "transport_delay", "creep")
_LEAST = 3.0
_UNDECIDED = 6.0
_ATTEMPTS = 300
_LEAD_S = 20.0
_SINE_S, _COURSE_S = 30.0, 60.0
_HYSTERESIS = "rate_independent_hysteresis"
_LAGS = ("source_resistance", "sensor_lag", "transport_delay")
_SMALL_V = (3.0, 7.0)
_VOLTS = {_HYSTERESIS: (4.0, 20.0), "creep": (3.0, 20.0)}


@dataclass(frozen=True, slots=True)
class Step:
    """A single step that leaves an effect and its rivals apart by nothing.

    Attributes:
        form: of the hidden effect.
        draw: its magnitude and parameters.
        rivals: those that may mimic it; the record is kept if one of them does.
        volts: smallest and largest step.
        duration_s: of the record.
    """

    form: str
    draw: Callable[[Generator], tuple[float, Values]]
    rivals: tuple[str, ...]
    volts: tuple[float, float]
    duration_s: float


def _lag(rng: Generator) -> tuple[float, Values]:
    tau_s = log_uniform(rng, 0.1, 0.6)
    return tau_s, {"tau_s": tau_s, "second_tau_s": 0.0}


def _lag_of_three(rng: Generator) -> tuple[float, Values]:
    tau_s, _ = _lag(rng)
    return tau_s, {"tau_s": 0.972 * tau_s, "second_tau_s": 0.02 * tau_s, "third_tau_s": 0.008 * tau_s}


def _creep(rng: Generator) -> tuple[float, Values]:
    growth = log_uniform(rng, 0.03, 0.3)
    return growth, {"growth": growth, "tau_s": log_uniform(rng, 5.0, 40.0)}


def _leakage(rng: Generator) -> tuple[float, Values]:
    fraction = log_uniform(rng, 0.05, 0.3)
    return fraction, {"fraction": fraction, "tau_s": log_uniform(rng, 5.0, 40.0)}


def _drift(rng: Generator) -> tuple[float, Values]:
    change_um = float(rng.choice([-1.0, 1.0])) * log_uniform(rng, 0.6, 4.0)
    return change_um, {"change_um": change_um, "tau_s": log_uniform(rng, 5.0, 40.0), "span_s": _COURSE_S}


def _ageing(rng: Generator) -> tuple[float, Values]:
    faded = log_uniform(rng, 0.05, 0.3)
    return faded, {"faded": faded, "tau_s": 1.0, "span_s": _COURSE_S}


STEPS: dict[str, Step] = {
    "source_resistance": Step("lumped", _lag, ("sensor_lag",), (0.7, 1.6), 3.0),
    "sensor_lag": Step("small_poles", _lag_of_three, ("source_resistance",), (0.7, 1.6), 3.0),
    "creep": Step("one_unit", _creep, ("thermal_drift",), (10.0, 40.0), _COURSE_S),
    "charge_leakage": Step("one_path", _leakage, ("thermal_drift",), (5.0, 40.0), _COURSE_S),
    "thermal_drift": Step("exponential", _drift, ("creep", "charge_leakage"), (10.0, 40.0), _COURSE_S),
    "ageing": Step("linear", _ageing, ("thermal_drift",), (5.0, 40.0), _COURSE_S),
}
TRUTHS: tuple[str, ...] = (*MEMORY, *(name for name in STEPS if name not in MEMORY))


def played(weak: Weak, rng: Generator) -> Excitation:
    """The excitation of a weak record."""
    if weak.pattern == "step":
        return excitations.one_step(weak.volts, weak.duration_s)
    return excitations.one_sine(rng, weak.frequency_Hz, weak.volts, weak.duration_s, weak.lead_s)


def draw_weak(truth: str, rng: Generator, sine_rng: Callable[[], Generator]) -> tuple[Weak, Hidden]:
    """An excitation and a hidden effect that it cannot tell from its rivals.

    Args:
        truth: one of `TRUTHS`.
        rng: of what is drawn.
        sine_rng: the generator that the bench will hand to `played`, afresh at every call.

    Raises:
        ValueError: the effect has no rival to be confused with.
        RuntimeError: nothing drawn shows and is ambiguous.
    """
    patterns: list[Literal["sine", "step"]] = []
    if truth in MEMORY:
        patterns.append("sine")
    if truth in STEPS:
        patterns.append("step")
    if not patterns:
        raise ValueError(f"effect of a weak case must be one of {', '.join(TRUTHS)}, found {truth!r}")
    pattern = patterns[int(rng.integers(len(patterns)))]
    for _ in range(_ATTEMPTS):
        found = _sine(truth, rng, sine_rng) if pattern == "sine" else _step(truth, rng)
        if found is not None:
            return found
    raise RuntimeError(f"{truth}: nothing drawn shows under a {pattern} and is ambiguous")


def _sine(truth: str, rng: Generator, sine_rng: Callable[[], Generator]) -> tuple[Weak, Hidden] | None:
    frequency_Hz, volts = log_uniform(rng, 0.3, 3.0), log_uniform(rng, *_VOLTS.get(truth, _SMALL_V))
    weak = Weak((), "sine", frequency_Hz, volts, _SINE_S, _LEAD_S)
    short = played(weak, sine_rng())
    entry = effect(truth)
    size = log_uniform(rng, *entry.ranges["camera"])
    if truth in _LAGS:
        size = log_uniform(rng, 0.05, 0.25) / (2.0 * math.pi * frequency_Hz)
    try:
        hidden = entry.hide(str(rng.choice(entry.forms)), size, short.setting, rng)
    except ValueError:
        return None
    if _over_noise(_reading(hidden, short), short) < _LEAST:
        return None
    weak = replace(weak, lead_s=_settling_s(hidden))
    reading = _reading(hidden, played(weak, sine_rng()))
    others = [name for name in MEMORY if name not in (truth, _HYSTERESIS)]
    if truth == _HYSTERESIS:
        return replace(weak, rivals=tuple(others)), hidden
    mimics = _mimics(others, reading, short)
    if not mimics or _over_noise(reading, short) < _LEAST:
        return None
    return replace(weak, rivals=(_HYSTERESIS, *mimics)), hidden


def _step(truth: str, rng: Generator) -> tuple[Weak, Hidden] | None:
    step = STEPS[truth]
    weak = Weak((), "step", 0.0, round(float(rng.uniform(*step.volts)), 2), step.duration_s, 0.0)
    plan = played(weak, rng)
    size, values = step.draw(rng)
    hidden = Hidden(truth, step.form, size, tuple(values.items()))
    reading = _reading(hidden, plan)
    if _over_noise(reading, plan) < _LEAST:
        return None
    mimics = _mimics(step.rivals, reading, plan)
    return (replace(weak, rivals=mimics), hidden) if mimics else None


def _settling_s(hidden: Hidden) -> float:
    """How long a sine has to run until the record no longer shows that it once began."""
    return 1200.0 if hidden.id == "creep" else _LEAD_S


def _reading(hidden: Hidden, plan: Excitation) -> Array:
    return readings_um(plan.commands, (hidden,))[plan.recorded]


def _over_noise(reading: Array, plan: Excitation) -> float:
    return left_over_um(reading, readings_um(plan.commands)[plan.recorded]) / NOISE_UM["camera"]


def _mimics(names: Iterable[str], reading: Array, plan: Excitation) -> tuple[str, ...]:
    undecided_um = NOISE_UM["camera"] * (_UNDECIDED / len(reading)) ** 0.5
    return tuple(name for name in names if mimicked_um(name, reading, plan, undecided_um) <= undecided_um)
