"""Dead zone of the output: what is passed on stands still while a gap is crossed."""

from dataclasses import replace

from bender_discrepancy.effects.effect import OTHER_RIGS, Effect, Sizes
from bender_discrepancy.effects.form import Form, Free, scale, simple

COVERED = {"width_um": (0.2, 10.0)}
WIDEST = 1e3
"""Times the stroke."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    stroke_um = sizes.stroke_um
    # of what stands before the joint, whose size only the gain behind it settles
    width = replace(
        sizes.sized(scale("width_um", *COVERED["width_um"], 6), COVERED["width_um"], "um"), high=WIDEST * stroke_um
    )
    places = tuple(sign * part * stroke_um for part in (0.05, 0.2) for sign in (1.0, -1.0))
    centre = Free("centre_um", -WIDEST * stroke_um, WIDEST * stroke_um, False, places, 0.01 * stroke_um)
    rounding = Free("rounding_um", 1e-3 * stroke_um, WIDEST * stroke_um, True, (0.02 * stroke_um, 0.1 * stroke_um))
    plain = simple("output_dead_zone", width, timed=False)
    off_rest = simple(
        "output_dead_zone", width, centre, timed=False, name="dead zone of the output, off rest", refines=plain.name
    )
    soft = simple(
        "output_dead_zone",
        width,
        centre,
        rounding,
        timed=False,
        name="dead zone of the output, soft",
        refines=off_rest.name,
    )
    return plain, off_rest, soft


EFFECT = Effect(
    id="output_dead_zone",
    summary="a gap in what is passed on: a joint with clearance, the overlap of a valve",
    signature=(
        "A flat piece of the reading at one level, in both directions, whatever brought it there; on either side of "
        "it the width of the gap is missing."
    ),
    resembles={
        "dead_zone": "A gap in the input: with lag, mode or hysteresis between them the two fall apart.",
        "backlash": "Follows every reversal, wherever that is.",
        "output_curve": "Smooth: it flattens towards a level and never stands still there.",
        "coulomb_friction": "Stands still after every reversal, not at one level.",
        "rate_independent_hysteresis": (
            "Plays of both signs make a flat piece at the same way after every reversal; a dead zone at the same level."
        ),
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
)
