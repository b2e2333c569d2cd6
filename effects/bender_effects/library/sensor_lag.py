"""Sensor lag: the reading follows the tip with a first-order lag: a filter, a tracker, a long exposure."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, lag_of_two, simple, time_constant

COVERED = {"time_constant_s": (0.0005, 1.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    plain = simple("sensor_lag", time_constant(*sizes.lasting(COVERED["time_constant_s"])), memory=True)
    return plain, lag_of_two(plain)


EFFECT = Effect(
    id="sensor_lag",
    summary="the reading follows the tip with a first-order lag: a filter, a tracker, a long exposure",
    in_general="the reading follows with a first-order lag: a filter, a slow sensor",
    signature=(
        "After each step an exponential, up and down alike; the ringing is seen smaller and later. On a "
        "sine amplitude and phase fall together."
    ),
    resembles={
        "source_resistance": (
            "Acts before the hysteresis and the modes: the same in a linear chain, a factor of 2 to 3 in the "
            "residuals of fast records."
        ),
        "transport_delay": "Its gain does not fall.",
        "creep": "Has no single time constant; most of the step is immediate.",
        "structural_damping": "Changes the decay; a lag lowers the ringing from its first period on.",
        "rate_independent_hysteresis": "Keeps its loop when slow.",
    },
    separation=(
        "A lag before the material softens the edge that enters the hysteresis and the mode; this one "
        "smooths what comes out. On fast records the two differ by a factor of 2 to 3 in the residual, no "
        "more."
    ),
    excitation="steps read at some kHz, or a chirp through the resonance",
    typical={
        "time_constant_s": (0.0005, 0.035, "the filter of a vibrometer to the exposure of a camera"),
    },
    covered=COVERED,
    drive="resonance_chirp",
    view="frequency",
    example={"time_constant_s": 0.002},
    forms=_forms,
    same_on_other_side="source_resistance",
    superposes=True,
)
