"""Friction with presliding: a force of the velocity that saturates, with a loop where the velocity turns."""

from dataclasses import replace

from bender_effects.effect import OTHER_RIGS, Effect, Sizes, scaling
from bender_effects.form import Form, amplitude, scale, simple

COVERED = {"force_um": (0.12, 11.5), "slip_V_s": (0.05, 50.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    force = sizes.sized(amplitude("force_um", 0.5, 25.0), COVERED["force_um"], "um")
    # from a way that passes within a row to all that is travelled in a good part of the record
    row_s = 0.5 / sizes.highest_Hz
    low, high = 0.3 * sizes.span_V * max(row_s, 1e-4 * sizes.duration_s), 0.1 * sizes.span_V * sizes.duration_s
    slip = scale("slip_V_s", low, max(high, 10.0 * low), 6)
    own = scaling("V", sizes.span_V, sizes.stroke_um)
    slip = slip.reaching(own * COVERED["slip_V_s"][0], own * COVERED["slip_V_s"][1])
    # over no way it is a force of the sign alone, over all that is travelled a spring
    slip = replace(slip, no_answer_at="both")
    return (simple("presliding_friction", force, slip, memory=True),)


EFFECT = Effect(
    id="presliding_friction",
    summary="friction of a given velocity, elastic over a short way before it slides: dampers, slides, seals",
    signature=(
        "Over the velocity two flat branches, one for each direction, joined by a loop about zero that is as wide as "
        "the velocity gets within the way of presliding; the same loop over the way at every speed."
    ),
    resembles={
        "saturation": "One curve over the velocity, without a loop.",
        "rate_independent_hysteresis": "Its loop has one width at any frequency; this one widens with the frequency.",
        "asymmetric_dead_zone": "Nothing about zero, a slope beyond: the opposite.",
        "backlash": "Follows every reversal of the velocity; friction yields about zero only.",
        "source_resistance": "Its loop grows with the speed and keeps the gain of slow motion.",
    },
    separation="Integrate the velocity: over the way the force is a loop of one shape at every speed and amplitude.",
    excitation="sines of velocity at two frequencies and two amplitudes, through zero",
    typical={
        "force_um": (0.0, 11.5, "up to half of the reading's range"),
        "slip_V_s": (0.05, 50.0, "micrometres in dry contacts, millimetres in rubber and in yielding fluids"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"force_um": 4.0, "slip_V_s": 5.0},
    forms=_forms,
)
