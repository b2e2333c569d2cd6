"""Asymmetric dead zone: nothing moves between two thresholds of unequal size."""

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, scale, simple

COVERED = {"positive_V": (0.1, 10.0), "negative_V": (0.1, 10.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    both = [sizes.sized(scale(name, *COVERED[name], 5), COVERED[name], "V") for name in COVERED]
    return (simple("asymmetric_dead_zone", *both, timed=False),)


EFFECT = Effect(
    id="asymmetric_dead_zone",
    summary="nothing moves between a positive and a negative threshold of another size: valves, motors",
    signature=(
        "Two kinks over the input, at unequal distances from zero, and nothing between them; beyond, the "
        "thresholds are missing."
    ),
    resembles={
        "dead_zone": "Kinks at equal distances from zero; preferred where both fit.",
        "asymmetric_gain": "One corner at zero and no standstill.",
        "backlash": "Follows every reversal, wherever that is.",
        "coulomb_friction": "Stands still after every reversal, not about zero input.",
    },
    separation=("It sits at two inputs, in both directions of motion; the distances of the kinks from zero differ."),
    excitation="slow triangles of both signs through zero",
    typical={
        "positive_V": (0.0, 5.0, "up to a tenth of the range: overlapped spools, motors at rest"),
        "negative_V": (0.0, 5.0, "as the positive one"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    generalises=("dead_zone",),
    drive="bipolar_triangle",
    view="voltage",
    example={"positive_V": 1.0, "negative_V": 4.0},
    forms=_forms,
)
