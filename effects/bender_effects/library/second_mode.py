"""A second mode carries part of the displacement: of a bender above the first, of other devices anywhere."""

import math
from dataclasses import replace

import numpy as np

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, amplitude, simple

COVERED = {"share": (0.01, 0.3)}
PERIODS, PER_DECADE = 2.0, 4.0
"""Of a mode that a record can show: how many it is long; starts in every decade of the frequency."""
HIGHEST_Hz = 1e6


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    if not sizes.piezo_bender:
        return _anywhere(sizes)
    first_Hz = sizes.first_Hz
    overtones = tuple(first_Hz * x for x in (1.4, 1.8, 2.3, 3.0, 4.0, 5.2, 6.267, 8.0, 11.0))
    # an alias has no frequency of its own: one that falls on a multiple of the frame rate does not ring at all
    lowest_Hz, highest_Hz = 1.2 * first_Hz, min(20.0 * first_Hz, sizes.highest_Hz)
    overtones = tuple(x for x in overtones if x < highest_Hz)
    if not overtones:
        return ()
    frequency = Free("frequency_Hz", lowest_Hz, highest_Hz, True, overtones, rings="Hz")
    damping = Free("damping_ratio", 0.0005, 0.5, True, (0.02,))
    return (simple("second_mode", amplitude("share", 0.02, 0.9), frequency, damping, memory=True, scan="ring"),)


def _anywhere(sizes: Sizes) -> tuple[Form, ...]:
    """Return the form of other devices: below, between or above the model's own modes, with any damping."""
    lowest_Hz, highest_Hz = PERIODS / sizes.duration_s, min(sizes.highest_Hz, 1e3 * sizes.first_Hz, HIGHEST_Hz)
    if not lowest_Hz < highest_Hz:
        return ()
    count = 2 + round(PER_DECADE * math.log10(highest_Hz / lowest_Hz))
    starts = tuple(float(x) for x in np.geomspace(1.2 * lowest_Hz, 0.9 * highest_Hz, count))
    # what rings within a row, or hardly comes back within the record, has not been seen to ring
    frequency = Free("frequency_Hz", lowest_Hz, highest_Hz, True, starts, no_answer_at="both")
    # what does not ring is two lags, what rings on for ever a disturbance
    damping = Free("damping_ratio", 0.0005, 0.94, True, (0.03, 0.3), no_answer_at="both")
    share = replace(amplitude("share", 0.02, 1.0), no_answer_at="low")
    return (simple("second_mode", share, frequency, damping, memory=True),)


EFFECT = Effect(
    id="second_mode",
    summary="a second mode carries part of the displacement and rings above the first",
    in_general="a second mode carries part of the output and rings at a frequency of its own",
    signature=(
        "After steps a quick ringing on top of the slow one; in the spectrum a line at 6.27 times the first "
        "resonance, with a zero between the two."
    ),
    resembles={
        "periodic_disturbance": "There in holds as well; the mode rings only after edges and dies.",
        "tip_mass": "Shifts the first line and adds none.",
        "sensor_lag": "Falls smoothly, without a line and without a zero.",
    },
    separation="It rings only after edges, a hum always; a camera sees an alias that moves with the frame rate.",
    excitation="steps or a chirp past 7 times the first resonance, read at twice that and more",
    typical={
        "share": (0.02, 0.12, "7.9 % of the static tip for a uniform cantilever"),
        "frequency_Hz": (600.0, 1600.0, "6.267 times a first resonance of 100 to 250 Hz"),
        "damping_ratio": (0.005, 0.1, "as for the first mode"),
    },
    covered=COVERED,
    drive="high_chirp",
    view="frequency",
    example={"share": 0.079, "frequency_Hz": 654.1},
    forms=_forms,
    superposes=True,
)
