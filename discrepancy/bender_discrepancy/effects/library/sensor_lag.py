"""Sensor lag: the reading follows the tip with a first-order lag: a filter, a tracker, a long exposure."""

from bender_discrepancy.effects.effect import Effect, Sizes
from bender_discrepancy.effects.form import Form, Free, simple, time_constant

COVERED = {"time_constant_s": (0.0005, 1.0)}
MOST_SHARE = 0.1
"""Of the lag: a second one of a larger share may as well be an effect of its own, before the plant."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    lag = time_constant(*sizes.lasting(COVERED["time_constant_s"]))
    share = Free("second_share", 1e-4, MOST_SHARE, True, (0.003, 0.03))
    plain = simple("sensor_lag", lag, memory=True)
    return plain, simple("sensor_lag", lag, share, memory=True, name="sensor_lag, of two", refines=plain.name)


EFFECT = Effect(
    id="sensor_lag",
    summary="the reading follows the tip with a first-order lag: a filter, a tracker, a long exposure",
    signature=(
        "After each step an exponential, up and down alike; the ringing is seen smaller and later. On a "
        "sine amplitude and phase fall together."
    ),
    resembles={
        "source_resistance": (
            "Before the hysteresis and the modes instead of behind them: the same where the chain is "
            "linear; on fast records the residuals differ by a factor of 2 to 3, no more."
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
)
