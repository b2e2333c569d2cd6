"""Another first resonance: the first resonance lies elsewhere: a mass at the tip, a stiffer clamp, layers left out."""

import numpy as np

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, simple

COVERED = {"frequency_ratio": (0.5, 1.5)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    del sizes
    far = np.concatenate([np.arange(0.5, 1.0, 0.01), np.arange(1.01, 1.55, 0.01)])
    # a slight shift promises nothing at the next hundredth, beyond its valley
    ratios = tuple(float(x) for x in (*far, 0.995, 0.998, 1.002, 1.005))
    return (
        simple(
            "tip_mass", Free("frequency_ratio", 0.3, 2.5, True, ratios, vanishes_at=1.0, rings="ratio"), memory=True
        ),
    )


EFFECT = Effect(
    id="tip_mass",
    summary="the first resonance lies elsewhere: a mass at the tip, a stiffer clamp, layers left out",
    in_general="the first resonance lies elsewhere: another mass, another stiffness",
    signature=(
        "Ringing of another frequency after each step, so the residual beats: it grows, has nodes and dies. "
        "The static gain is untouched. At 30 frames per second the ringing is seen as its alias."
    ),
    resembles={
        "structural_damping": "Same phase, another envelope.",
        "transport_delay": "Shifts the whole record; a delay of one period of the ringing looks like none.",
        "stiffening": "The shift depends on the level.",
        "second_mode": "Adds a line, moves none.",
    },
    separation=(
        "The phase slips further with every period; another damping keeps it. The shift is the same at every level."
    ),
    excitation="steps, or a chirp through the first resonance",
    typical={
        "frequency_ratio": (
            0.8,
            2.4,
            "between a drop of glue at the tip and a beam that is clamped shorter than drawn",
        ),
    },
    covered=COVERED,
    drive="resonance_chirp",
    view="frequency",
    example={"frequency_ratio": 0.93},
    forms=_forms,
    superposes=True,
)
