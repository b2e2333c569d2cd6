"""Dead zone of the output: what is passed on stands still while a gap is crossed."""

from dataclasses import replace

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, Free, Values, scale, simple
from bender_plant.model import Model

COVERED = {"width_um": (0.2, 10.0)}
WIDEST = 1e3
"""Times the stroke: what stands before the joint may be of any size, which only the gain behind it settles."""
SOFTEST = 0.125
"""Of the width: the contacts then pass on a twenty-fifth in the middle of the gap; with softer ones it is a curve."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    stroke_um = sizes.stroke_um
    known = sizes.sized(scale("width_um", *COVERED["width_um"], 6), COVERED["width_um"], "um")
    width = replace(known, high=WIDEST * stroke_um)
    places = tuple(sign * part * stroke_um for part in (0.05, 0.2) for sign in (1.0, -1.0))
    centre = Free("centre_um", -WIDEST * stroke_um, WIDEST * stroke_um, False, places, 0.01 * stroke_um)
    softness = Free("rounding_per_width", 1e-3, SOFTEST, True, (0.01, 0.1))

    def softened(model: Model, values: Values) -> Model:
        width_um, centre_um, part = values
        return model.with_block("output_dead_zone", width_um=width_um, centre_um=centre_um, rounding_um=part * width_um)

    plain = simple("output_dead_zone", width, timed=False)
    off_rest = simple(
        "output_dead_zone", width, centre, timed=False, name="dead zone of the output, off rest", refines=plain.name
    )
    soft = Form(
        "output_dead_zone", "dead zone of the output, soft", (width, centre, softness), softened, timed=False,
        refines=off_rest.name,
    )  # fmt: skip
    return plain, off_rest, soft


EFFECT = Effect(
    id="output_dead_zone",
    summary="a gap in what is passed on: a joint with clearance, the overlap of a valve",
    signature=(
        "A flat piece of the reading at one level, in both directions, whatever brought it there; on either side of "
        "it the width of the gap is missing."
    ),
    resembles={
        "dead_zone": "A gap in the input: with lag, mode or hysteresis the two fall apart.",
        "backlash": "Follows every reversal, wherever that is.",
        "output_curve": "Smooth: it flattens towards a level and never stands still there.",
        "coulomb_friction": "Stands still after every reversal, not at one level.",
        "rate_independent_hysteresis": "A flat piece at the same way after every reversal, not at the same level.",
    },
    separation="It sits at one level of the output, in both directions and after every reversal.",
    excitation="slow triangles of several amplitudes across the gap",
    typical={"width_um": (0.0, 5.0, "up to a fifth of the range: pins in holes, worn joints, stops")},
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"width_um": 4.0},
    forms=_forms,
    bends_slow_reading=True,
    curve_of_reading=True,
)
