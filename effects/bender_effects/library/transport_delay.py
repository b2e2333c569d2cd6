"""Transport delay: the command acts, or the reading arrives, some time late and otherwise unchanged."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, simple
from bender_effects.witnessed import Witnessed

COVERED = {"delay_s": (0.0005, 0.3)}
LONG_RECORDS, SHORT_RECORDS, ROWS = 0.05, 0.3, 20
"""Of another device a delay is sought as far as of the actuator, up to a part of a long record, as a longer one belongs
to its beginning, or up to so many rows of a short one, of which it may be the larger part."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    """Return the form, sought up to a period of the lowest frequency that the commands hold: more is less again."""
    longest_s, unit_s = COVERED["delay_s"][1], 1e-3
    if not sizes.piezo_bender:
        most_s = max(longest_s, LONG_RECORDS * sizes.duration_s, 0.5 * ROWS / sizes.highest_Hz)
        longest_s = min(most_s, SHORT_RECORDS * sizes.duration_s)
        unit_s = 0.1 / sizes.highest_Hz or unit_s
    if sizes.lowest_Hz > 0.0:
        longest_s = min(longest_s, 1.0 / sizes.lowest_Hz)
    delay = Free("delay_s", 0.0, 2.0 * longest_s, False, (), unit_s, vanishes_at=0.0, rings="delay")
    return (simple("transport_delay", delay, memory=True, scan="delay"),)


EFFECT = Effect(
    id="transport_delay",
    summary="the command acts, or the reading arrives, some time late and otherwise unchanged",
    signature=(
        "The residual is the delay times the speed of the tip: spikes at every step, one shape for all of "
        "them, and a loop on a sine whose area grows with amplitude squared times frequency. The phase "
        "falls in proportion to the frequency while the amplitude stays."
    ),
    resembles={
        "source_resistance": "A lag loses gain as the phase falls and spreads the step; a delay moves it whole.",
        "sensor_lag": "The same, behind the mode: the ringing is seen smaller, not only later.",
        "supply_fall_lag": "Only steps down are late.",
        "rate_independent_hysteresis": (
            "The same at one frequency and amplitude. At a tenth of the frequency the loop of the delay has a "
            "tenth of the area."
        ),
    },
    separation=("A lag loses amplitude with rising frequency, a delay none; hysteresis keeps its loop at any speed."),
    excitation="a chirp, or sines of two frequencies a decade apart",
    typical={
        "delay_s": (0.005, 0.12, "the answer of a supply to one to three frames of a camera"),
    },
    covered=COVERED,
    drive="slow_chirp",
    view="frequency",
    example={"delay_s": 0.05},
    forms=_forms,
    superposes=True,
    splits_into=(("source_resistance", "sensor_lag"), ("source_resistance", "tip_mass"), ("sensor_lag", "tip_mass")),
    witnessed=Witnessed(),
)
