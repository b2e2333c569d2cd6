"""End stops: what moves rests at a stop, and comes off it at once when the drive turns."""

from dataclasses import replace

from bender_effects.effect import OTHER_RIGS, UNSEEN_OF_A_ROW, Effect, Sizes
from bender_effects.form import Form, Free, Values
from bender_effects.lag_taken import without_the_longest_lag
from bender_plant.model import Model

COVERED = {"highest_um": (1.0, 22.0), "lowest_um": (1.0, 22.0)}
FURTHEST = 1e3
"""Times the stroke: what stands before the stop may be of any size, which only the gain behind it settles."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # a fit that frees the lag goes no further down than that
    unseen_s = 0.99 * UNSEEN_OF_A_ROW * sizes.row_s
    stroke = sizes.stroke_um

    def of_sides(*names: str) -> Form:
        def apply(model: Model, values: Values) -> Model:
            """Take over the longest lag of the plant, whose number stays free beside the stops."""
            rest, tau_s = without_the_longest_lag(model, unseen_s, "end_stop")
            return rest.with_block("end_stop", time_constant_s=tau_s, **dict(zip(names, values, strict=True)))

        levels = tuple(part * stroke for part in (0.05, 0.15, 0.3, 0.6, 0.9))
        free = tuple(Free(x, 1e-3 * stroke, FURTHEST * stroke, True, levels) for x in names)
        return Form("end_stop", "stops on both sides", free, apply, memory=True, refines="stop above")

    above = replace(of_sides("highest_um"), name="stop above", refines="", scan="limit above")
    below = replace(of_sides("lowest_um"), name="stop below", refines="", scan="limit below")
    return above, below, of_sides("highest_um", "lowest_um")


EFFECT = Effect(
    id="end_stop",
    summary="what moves rests at a stop: throttles, tanks at their brim, slides at the end of their travel",
    signature=(
        "Crests are cut off at one level of the output, or troughs, or both; however long the drive pushed on, the "
        "reading leaves the level as soon as the drive turns."
    ),
    resembles={
        "output_limit": "A limit of the reading: what is behind it has gone on, and has to come back first.",
        "saturation": "A curve of the input, the same on both sides; what is reached depends on the drive alone.",
        "output_curve": "Smooth over the whole range, and late where the drive turns.",
        "square_root_outflow": "Nothing is cut off: gain and time constant rise with the level.",
    },
    separation="Push against the level for a short and a long time: from a stop the reading returns equally soon.",
    excitation="steps past the level of several heights and lengths, each followed by one back",
    typical={
        "highest_um": (1.0, 22.0, "within the range of the readings"),
        "lowest_um": (1.0, 22.0, "within the range of the readings"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"time_constant_s": 0.5, "highest_um": 10.0, "lowest_um": 8.0},
    forms=_forms,
)
