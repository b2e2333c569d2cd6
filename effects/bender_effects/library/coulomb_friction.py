"""Dry friction: the mode is held back by a force against its motion, and rests anywhere within it."""

import math

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, Free, scale, simple

COVERED = {"level_um": (0.12, 6.9), "breakaway_ratio": (1.0, 3.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    level = sizes.sized(scale("level_um", *COVERED["level_um"], 7, 0.0), COVERED["level_um"], "um")
    ratio = Free("breakaway_ratio", 1.0, 5.0, True, (1.5, 2.5))
    # the mode's own speed at full stroke
    fastest_um_per_s = sizes.stroke_um * 2.0 * math.pi * sizes.first_Hz
    speeds = tuple(fastest_um_per_s * x for x in (0.003, 0.1))
    speed = Free("stribeck_um_per_s", 1e-5 * fastest_um_per_s, 10.0 * fastest_um_per_s, True, speeds)
    plain = simple("coulomb_friction", level, memory=True)
    name = f"{plain.name}, Stribeck"
    return plain, simple("coulomb_friction", level, ratio, speed, memory=True, name=name, refines=plain.name)


EFFECT = Effect(
    id="coulomb_friction",
    summary=("dry friction: motion stops short of its end on either side, and ringing ends instead of fading"),
    signature=(
        "After every move the reading rests short of its end, by up to the friction over the stiffness; "
        "ringing dies along a straight line and stops. A slow cycle is a loop of one width at all "
        "amplitudes."
    ),
    resembles={
        "backlash": "On slow records the same loop; but play does not damp the ringing.",
        "structural_damping": "Its ringing dies along an exponential and ends at the same place.",
        "hysteretic_spring": "Its loop grows with the amplitude; it yields softly, without rest.",
        "rate_independent_hysteresis": "Its loops shrink with the amplitude, and the ringing is as it was.",
        "quadratic_drag": "Brakes fast motion, and leaves slow motion alone.",
    },
    separation=(
        "Look at the end of the ringing: friction stops it within a few periods, at a place that depends "
        "on where it came from."
    ),
    excitation="steps of several heights read through the ringing, and a falling ladder of slow triangles",
    typical={
        "level_um": (0.0, 2.3, "up to a tenth of the stroke in guides and seals"),
        "breakaway_ratio": (1.0, 2.0, "dry and lubricated contacts"),
        "stribeck_um_per_s": (1.0, 1000000.0, "from crawling to boundary lubrication"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="ladder",
    view="voltage",
    example={"level_um": 1.0},
    forms=_forms,
)
