"""Periodic disturbance: hum, a fan or a shaking table adds one sine, often seen as its alias."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, amplitude, simple

COVERED = {
    "sine_um": (0.0, 5.0),
    "cosine_um": (0.0, 5.0),
    # any other frequency is found as well, a higher one at its alias; of a record only what comes back within it
    "frequency_Hz": (1e-4, 1e5),
}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    sine, cosine = (sizes.sized(amplitude(x, 0.1, 100.0), COVERED[x], "um") for x in ("sine_um", "cosine_um"))
    lowest_Hz, highest_Hz = COVERED["frequency_Hz"]
    # what the rows cannot show is found at its alias; a sensor that lags would have to be simulated in steps of it
    highest_Hz = min(highest_Hz, sizes.quickest_line_Hz)
    once_Hz = 1.0 / sizes.duration_s
    # what has not come back once has not been seen to be periodic
    frequency = Free("frequency_Hz", max(lowest_Hz, once_Hz), highest_Hz, False, (), once_Hz, no_answer_at="low")
    return (simple("periodic_disturbance", sine, cosine, frequency, scan="swing"),)


EFFECT = Effect(
    id="periodic_disturbance",
    summary="hum, a fan or a shaking table adds one sine, often seen as its alias",
    signature=(
        "One narrow line in the spectrum of the residual, there during holds as well. 60 Hz in a camera of "
        "29.97 frames per second is a slow swing of 0.06 Hz."
    ),
    resembles={
        "thermal_drift": "Does not come back.",
        "second_mode": "Only after edges, and dies.",
        "creep": "Only after steps.",
    },
    separation="It repeats; and a frame rate that is changed by 1 % moves an aliased line, not a true one.",
    excitation="any record with long holds; twice, at two frame rates",
    typical={
        "sine_um": (0.0, 1.0, "hum and tables below a micrometre"),
        "cosine_um": (0.0, 1.0, "as the sine: together they are one amplitude and a phase"),
        "frequency_Hz": (0.01, 130.0, "mains and twice mains, fans, or their aliases"),
    },
    covered=COVERED,
    drive="staircase_2997",
    view="spectrum",
    example={"sine_um": 0.3, "cosine_um": 0.15, "frequency_Hz": 60.0},
    forms=_forms,
    superposes=True,
    of_the_record=True,
)
