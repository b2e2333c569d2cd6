"""Asymmetric gain: negative commands have another gain than positive ones."""

from dataclasses import replace

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, amplitude, simple

COVERED = {"difference": (0.01, 0.9)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    del sizes
    difference = replace(amplitude("difference", 0.02, 5.0), low=-0.95)
    return (simple("asymmetric_gain", difference, timed=False),)


EFFECT = Effect(
    id="asymmetric_gain",
    summary="commands of one sign do more than those of the other: a rod on one side, halves that differ",
    signature=(
        "Over the input two straight lines that meet at zero, the same on both branches and at any speed; "
        "a swing about zero is shifted."
    ),
    resembles={
        "electrostriction": "A smooth parabola, without a corner at zero.",
        "asymmetric_dead_zone": "Two parallel lines, and nothing between them.",
        "gain_error": "One straight line.",
        "saturation": "Odd: the same loss on both sides.",
    },
    separation=(
        "A corner at zero input and straight lines on both sides of it; the parts are in proportion to the input."
    ),
    excitation="inputs of both signs at several amplitudes",
    typical={
        "difference": (0.0, 0.5, "up to the ratio of the areas of a cylinder with a rod"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"difference": 0.1},
    forms=_forms,
)
