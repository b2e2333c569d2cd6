"""Charge leakage: charge leaks off while the voltage is held, and the field in the film sags."""

import math

import numpy as np

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, growth, simple

STARTS = 8
COVERED = {
    "fraction": (0.02, 0.6),
    "time_constant_s": (1.0, 100.0),
}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    tau = Free("time_constant_s", 0.3, 500.0, True, (1.0, 3.0, 10.0, 30.0, 100.0))
    if not sizes.piezo_bender and math.isfinite(sizes.highest_Hz):
        low_s, high_s = sizes.relaxing()
        middles_s = tuple(float(x) for x in np.geomspace(low_s, high_s, STARTS + 2)[1:-1])
        # what is over within a row is a gain
        tau = Free("time_constant_s", low_s, high_s, True, middles_s, no_answer_at="low")
    return (simple("charge_leakage", growth("fraction", 0.02, 0.95), tau, memory=True),)


EFFECT = Effect(
    id="charge_leakage",
    summary="charge leaks off while the voltage is held, and the field in the film sags",
    in_general="a held input fades: the output sags back during each hold",
    signature=(
        "During each hold the reading sags back towards where it came from, exponentially with one time "
        "constant, and after the return to zero it overshoots by as much."
    ),
    resembles={
        "creep": (
            "Runs on with the step instead of back, and does not end. Behind a linear transducer only the sign "
            "of the gain separates the two."
        ),
        "rate_independent_hysteresis": "Stands still in a hold.",
        "thermal_drift": "Does not change sign with the step.",
        "ageing": "Does not come back after zero volts.",
    },
    separation=(
        "The tail runs against the step (creep runs with it) and stops after a few time constants. Behind a "
        "linear transducer a leak is one relaxation of negative creep: only the sign tells."
    ),
    excitation="holds of several time constants, then zero volts",
    typical={
        "fraction": (0.0, 0.02, "a film on a supply; a charge amplifier or a moist film leaks more"),
        "time_constant_s": (1000.0, 10000.0, "resistivity above 1e13 ohm m times permittivity 110 pF/m"),
    },
    covered=COVERED,
    unusual=(
        "unusual for this actuator: rho eps of the film is above 1 100 s, and a supply that stays connected "
        "replaces what leaks"
    ),
    elsewhere="Leakage",
    drive="long_holds",
    view="since_step_log",
    example={"fraction": 0.1, "time_constant_s": 10.0},
    forms=_forms,
    superposes=True,
)
