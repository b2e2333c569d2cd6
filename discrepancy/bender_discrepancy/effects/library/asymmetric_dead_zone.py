"""Asymmetric dead zone: nothing moves between two thresholds of unequal size."""

from bender_discrepancy.effects.effect import OTHER_RIGS, Effect, Sizes
from bender_discrepancy.effects.form import Form, Free, Values, scale
from bender_plant.model import Model

COVERED = {"positive_V": (0.1, 10.0), "negative_V": (0.1, 10.0)}


ALIKE = 0.9
"""Thresholds that differ by less are those of `dead_zone`, of which this would be a costlier name."""


def _wider(wide: str, narrow: str, sizes: Sizes) -> Form:
    def apply(model: Model, values: Values) -> Model:
        threshold_V, ratio = values
        return model.with_block("asymmetric_dead_zone", **{wide: threshold_V, narrow: ratio * threshold_V})

    threshold = sizes.sized(scale(wide, *COVERED[wide], 6), COVERED[wide], "V")
    ratio = Free(f"{narrow} over {wide}", 0.0, ALIKE, False, (0.1, 0.5), 0.1)
    return Form("asymmetric_dead_zone", f"wider by {wide}", (threshold, ratio), apply, timed=False)


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    return _wider("positive_V", "negative_V", sizes), _wider("negative_V", "positive_V", sizes)


EFFECT = Effect(
    id="asymmetric_dead_zone",
    summary="nothing moves between a positive and a negative threshold of another size: valves, motors",
    signature=(
        "Two kinks over the input, at unequal distances from zero, and nothing between them; beyond, the "
        "thresholds are missing."
    ),
    resembles={
        "dead_zone": "Kinks at equal distances from zero; fewer numbers, so it is preferred where both fit.",
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
    drive="bipolar_triangle",
    view="voltage",
    example={"positive_V": 1.0, "negative_V": 4.0},
    forms=_forms,
)
