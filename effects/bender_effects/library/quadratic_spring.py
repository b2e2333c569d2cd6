"""Asymmetric spring: the restoring force has a square of the displacement in it."""

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, Free, simple

COVERED = {"quadratic_1_per_um": (0.00022, 0.0216)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # the ringing is far from linear in it: half a period more or less while it lasts is another valley, an octave wide
    squares = tuple(sign * 2e-4 * 2.0**k for k in range(8) for sign in (1.0, -1.0))
    free = Free("quadratic_1_per_um", -0.1, 0.1, False, squares, 1e-3)
    return (simple("quadratic_spring", sizes.sized(free, COVERED["quadratic_1_per_um"], "1/um")),)


EFFECT = Effect(
    id="quadratic_spring",
    summary=("a spring that is stiffer one way than the other: the resonance moves with the level, up or down"),
    signature=(
        "The resonance rises with the level on one side of rest and falls on the other; the static gain "
        "does the opposite. A swing about rest is shifted and has a second harmonic."
    ),
    resembles={
        "stiffening": "Moves the resonance the same way on both sides of rest.",
        "electrostriction": "A parabola as well, but it leaves the resonance where it is.",
        "output_curve": "Bends the reading only; the resonance stays where it is.",
        "tip_mass": "Moves the resonance at every level alike.",
    },
    separation=(
        "Only a spring moves the resonance with the level; a square moves it in proportion to the level, "
        "a cube with its square."
    ),
    excitation="steps or sweeps about levels on both sides of rest",
    typical={
        "quadratic_1_per_um": (0.0, 0.004, "up to a tenth of the force at full stroke: preloaded contacts, diaphragms"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="chirps_at_levels",
    view="resonance_at_levels",
    example={"quadratic_1_per_um": 0.004},
    forms=_forms,
)
