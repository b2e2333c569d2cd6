"""A second bending mode: a second bending mode carries part of the displacement and rings above the first."""

from bender_discrepancy.effects.effect import Effect, Sizes
from bender_discrepancy.effects.form import Form, Free, amplitude, simple

COVERED = {"share": (0.01, 0.3)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    first_Hz = sizes.first_Hz
    overtones = tuple(first_Hz * x for x in (1.4, 1.8, 2.3, 3.0, 4.0, 5.2, 6.267, 8.0, 11.0))
    # an alias has no frequency of its own: one that falls on a multiple of the frame rate does not ring at all
    lowest_Hz, highest_Hz = 1.2 * first_Hz, min(20.0 * first_Hz, sizes.highest_Hz)
    overtones = tuple(x for x in overtones if x < highest_Hz)
    if not overtones:
        return ()
    frequency = Free("frequency_Hz", lowest_Hz, highest_Hz, True, overtones)
    damping = Free("damping_ratio", 0.0005, 0.5, True, (0.02,))
    return (simple("second_mode", amplitude("share", 0.02, 0.9), frequency, damping, memory=True),)


EFFECT = Effect(
    id="second_mode",
    summary="a second bending mode carries part of the displacement and rings above the first",
    signature=(
        "After steps a quick ringing on top of the slow one; in the spectrum a line at 6.27 times the first "
        "resonance, with a zero between the two."
    ),
    resembles={
        "periodic_disturbance": "A hum is there in holds as well; the mode rings only after edges and dies.",
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
)
