"""Quadratic drag: a brake with the square of the speed."""

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, scale, simple

COVERED = {"drag_1_per_um": (0.001, 0.1)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    drag = sizes.sized(scale("drag_1_per_um", *COVERED["drag_1_per_um"], 6, 0.0), COVERED["drag_1_per_um"], "1/um")
    return (simple("quadratic_drag", drag, memory=True),)


EFFECT = Effect(
    id="quadratic_drag",
    summary="a brake with the square of the speed: large ringing dies fast, small ringing lives on",
    signature=(
        "The envelope of the ringing falls as one over time instead of exponentially; the resonance is "
        "the lower the harder it is driven. Slow drives show nothing."
    ),
    resembles={
        "structural_damping": "Damps ringing of every size alike.",
        "coulomb_friction": "Damps small ringing most and stops it.",
        "stiffening": "Moves the resonance as well as its height.",
    },
    separation=("Compare the damping of large and of small ringing: with drag it falls in proportion to the size."),
    excitation="steps or sweeps of several sizes",
    typical={
        "drag_1_per_um": (0.0, 0.02, "bodies and orifices in a fluid"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="resonance_chirp",
    view="frequency",
    example={"drag_1_per_um": 0.02},
    forms=_forms,
)
