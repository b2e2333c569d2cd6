"""Creep: the displacement goes on creeping after every change, with the logarithm of time."""

import math

import numpy as np

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, Values, growth
from bender_plant.model import Model

COVERED = {
    "gains": (0.01, 0.4),
    "time_constants_s": (0.1, 100.0),
}

SLOWEST_s, QUICKEST_PART = 400.0, 0.01
"""Of a spectrum: its slowest relaxation, and the largest part of that which its quickest one may be."""
LARGEST = 1.0
"""Gain of one relaxation, or of two together: what goes on by more than the step itself follows as a lag."""


def _relaxations(count: int, sizes: Sizes) -> Form:
    def apply(model: Model, values: Values) -> Model:
        return model.with_block("creep", gains=values[:count], time_constants_s=values[count:])

    gains = tuple(growth(f"gains[{k + 1}]", 0.02, LARGEST / count) for k in range(count))
    low_s, high_s = _spanned_s(sizes)
    low_s, high_s = min(low_s, 0.02), max(high_s, 1e3)
    middles = ((0.1, 0.4, 1.5, 6.0, 25.0, 100.0),) if count == 1 else ((0.2, 1.0), (4.0, 40.0))
    middles = tuple(_within(x, sizes) for x in middles)
    taus = tuple(Free(f"time_constants_s[{k + 1}]", low_s, high_s, True, middles[k]) for k in range(count))
    return Form("creep", f"{count} relaxation{'s' * (count > 1)}", gains + taus, apply, memory=True)


def _spanned_s(sizes: Sizes) -> tuple[float, float]:
    """Return the quickest and the slowest relaxation that records show: of other devices from a row to the whole."""
    return (0.02, 1e3) if sizes.piezo_bender or math.isinf(sizes.highest_Hz) else sizes.relaxing()


def _within(taus: tuple[float, ...], sizes: Sizes) -> tuple[float, ...]:
    """Return time constants of 0.1 to 100 s, spread alike over what other records span instead."""
    if sizes.piezo_bender:
        return taus
    low_s, high_s = _spanned_s(sizes)
    return tuple(low_s ** (1.0 - x) * high_s**x for x in ((math.log10(tau) + 1.5) / 4.0 for tau in taus))


def _logarithmic(sizes: Sizes) -> Form:
    ends = (0.03, 1000.0) if sizes.piezo_bender else _spanned_s(sizes)
    taus = tuple(float(x) for x in np.geomspace(*ends, 10))
    unit = taus[0] / 0.03

    def apply(model: Model, values: Values) -> Model:
        gain, slope = values
        gains = tuple(min(gain * (tau / unit) ** slope, LARGEST) for tau in taus)
        return model.with_block("creep", gains=gains, time_constants_s=taus)

    free = (growth("gain_per_half_decade", 0.005, 1.0), Free("slope", -1.0, 1.0, False, (0.0,), 0.1))
    return Form("creep", "logarithmic", free, apply, memory=True)


def _spectrum(count: int, quickest_s: float, sizes: Sizes) -> Form:
    """Return relaxations spread over decades; what relaxes within a row is a gain, or in part a lag."""
    row_s = 0.5 / sizes.highest_Hz
    low_s, high_s = max(quickest_s, min(row_s, QUICKEST_PART * SLOWEST_s)), SLOWEST_s
    if not sizes.piezo_bender:
        low_s, high_s = _spanned_s(sizes)
    taus = tuple(float(x) for x in np.geomspace(low_s, high_s, count))

    def apply(model: Model, values: Values) -> Model:
        return model.with_block("creep", gains=tuple(values), time_constants_s=taus)

    free = tuple(growth(f"gains[{k + 1}]", 0.02, LARGEST) for k in range(count))
    return Form("creep", f"spectrum of {count}", free, apply, memory=True)


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    return (
        _relaxations(1, sizes),
        _relaxations(2, sizes),
        _logarithmic(sizes),
        _spectrum(7, 0.04, sizes),
        _spectrum(10, 0.04, sizes),
        _spectrum(12, 0.01, sizes),
    )


EFFECT = Effect(
    id="creep",
    summary="the displacement goes on creeping after every change, with the logarithm of time",
    in_general="the output goes on creeping after every change, with the logarithm of time",
    signature=(
        "After every step a slow tail in the direction of the step and in proportion to it, straight over "
        "the logarithm of time; earlier steps are still felt. Single relaxations are straight only over a "
        "decade or so."
    ),
    resembles={
        "charge_leakage": (
            "Its tail runs back, against the step, and ends. Behind a linear transducer it is one relaxation of "
            "negative gain: the sign decides."
        ),
        "thermal_drift": "Knows nothing of the steps; go on at zero volts.",
        "ageing": "Knows nothing of the steps; scales what is there.",
        "supply_fall_lag": "Only down, one time constant.",
        "source_resistance": (
            "One time constant, and gone; with creep most of the step is immediate. A tail larger than the step "
            "is sought as a lag."
        ),
    },
    separation=(
        "It changes sign with the step, a drift does not; leakage pulls back towards the old place, creep "
        "goes on ahead. Logarithm and exponential differ over 2.5 decades of hold."
    ),
    excitation="steps up and down of two sizes, held over 2.5 decades of time",
    typical={
        "gains": (0.002, 0.05, "1 to 2 % per decade in ceramics, a few per cent in all; more in a composite bender"),
        "time_constants_s": (0.05, 1000.0, "spread over decades; only those that the record spans can be seen"),
    },
    covered=COVERED,
    drive="long_holds",
    view="since_step_log",
    example={"gains": (0.01, 0.01, 0.01, 0.01), "time_constants_s": (0.1, 1.0, 10.0, 100.0)},
    forms=_forms,
    superposes=True,
    told_as="relaxations",
)
