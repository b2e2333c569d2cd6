"""Fold of the reading: the sensor gives the size of what it measures, an even curve of it."""

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, Free, Values
from bender_plant.model import Model

COVERED = {"centre_um": (0.2, 12.0)}
FURTHEST = 1e3
"""Times the stroke: what stands before the fold may be of any size, which only the gain behind it settles."""


def _centre(sizes: Sizes) -> Free:
    stroke = sizes.stroke_um
    places = tuple(part * stroke for part in (0.0, 0.1, -0.1, 0.5, -0.5))
    return Free("centre_um", -FURTHEST * stroke, FURTHEST * stroke, False, places, 0.01 * stroke)


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    stroke = sizes.stroke_um

    def whole(model: Model, values: Values) -> Model:
        return model.with_block("fold", share=1.0, centre_um=values[0])

    def rounded(model: Model, values: Values) -> Model:
        return model.with_block("fold", share=1.0, centre_um=values[0], rounding_um=values[1])

    def partial(model: Model, values: Values) -> Model:
        return model.with_block("fold", centre_um=values[0], share=values[1])

    rounding = Free("rounding_um", 1e-3 * stroke, FURTHEST * stroke, True, (0.05 * stroke, 0.5 * stroke, 5.0 * stroke))
    share = Free("share", 0.01, 1.0, False, (0.3, 0.7), 0.02, vanishes_at=0.0)
    centre = _centre(sizes)
    return (
        Form("fold", "fold", (centre,), whole, timed=False),
        Form("fold", "fold, rounded", (centre, rounding), rounded, timed=False, refines="fold"),
        Form("fold", "fold, in part", (centre, share), partial, timed=False, refines="fold"),
    )


EFFECT = Effect(
    id="fold",
    summary="the reading has the size of the quantity, not its sign: pulse counters, rectifiers, power meters",
    signature=(
        "The reading turns back at one level and never passes it, whatever the input does; over the true quantity it "
        "is a V, or an even curve. A linear model explains next to nothing where the motion goes as far to either side."
    ),
    resembles={
        "electrostriction": "A curve of the input: with lag, mode or hysteresis the two fall apart.",
        "output_curve": "Smooth, with the slope of the gain at rest.",
        "output_limit": "Stands still, or follows less, beyond the level, and does not turn back.",
        "asymmetric_gain": "Two slopes about zero input instead of one level of the output.",
    },
    separation="It turns back at one level of the output: the frequency there is twice that of the input.",
    excitation="motion of both signs, unequally far to either side, and slow enough to be followed",
    typical={"centre_um": (0.0, 12.0, "about zero of the quantity, or where a bias has moved it")},
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"share": 1.0, "centre_um": 4.0},
    forms=_forms,
    bends_slow_reading=True,
    curve_of_reading=True,
)
