"""Limit of the output: beyond a level, on one side, it follows less or not at all."""

from collections.abc import Callable
from dataclasses import replace

from bender_effects.effect import OTHER_RIGS, UNSEEN_OF_A_ROW, Effect, Sizes
from bender_effects.form import Form, Free, Values
from bender_effects.lag_taken import without_the_longest_lag
from bender_plant.blocks.output_limit import FORMS
from bender_plant.model import Model

COVERED = {"level_um": (1.0, 22.0), "other_level_um": (1.0, 22.0), "remaining_slope": (0.0, 0.9)}
FURTHEST = 1e3
"""Times the stroke: what stands before the limit may be of any size, which only the gain behind it settles."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    stroke = sizes.stroke_um
    levels = tuple(part * stroke for part in (0.05, 0.15, 0.3, 0.6, 0.9))
    known = Free("level_um", 1e-3 * stroke, FURTHEST * stroke, True, levels)
    slope = Free("remaining_slope", 0.0, 0.98, False, (0.0, 0.5), 0.02)
    rounding = Free("rounding_um", 1e-4 * stroke, stroke, True, (0.02 * stroke, 0.1 * stroke))

    def of_side(side: str) -> tuple[Form, ...]:
        def hard(model: Model, values: Values) -> Model:
            return model.with_block("output_limit", form=side, level_um=values[0])

        def sloping(model: Model, values: Values) -> Model:
            return model.with_block("output_limit", form=side, level_um=values[0], remaining_slope=values[1])

        def soft(model: Model, values: Values) -> Model:
            level, left, turn = values
            return model.with_block("output_limit", form=side, level_um=level, remaining_slope=left, rounding_um=turn)

        name = f"limit {side}"
        return (
            Form("output_limit", name, (known,), hard, timed=False, scan=name),
            Form("output_limit", f"{name}, sloping", (known, slope), sloping, timed=False, refines=name),
            Form(
                "output_limit", f"{name}, soft", (known, slope, rounding), soft, timed=False,
                refines=f"{name}, sloping",
            ),
        )  # fmt: skip

    # a fit that frees the lag goes no further down than that
    unseen_s = 0.99 * UNSEEN_OF_A_ROW * sizes.row_s

    def stop(side: str) -> Callable[[Model, Values], Model]:
        def apply(model: Model, values: Values) -> Model:
            """Take over the longest lag of the plant, whose number stays free beside the stops."""
            rest, tau_s = without_the_longest_lag(model, unseen_s, "output_limit")
            levels = dict(zip(("level_um", "other_level_um"), values, strict=False))
            return rest.with_block("output_limit", form=side, time_constant_s=tau_s, **levels)

        return apply

    above, below = (Form("output_limit", f"stop {x}", (known,), stop(x), memory=True, scan=f"limit {x}") for x in FORMS)
    other = replace(known, name="other_level_um")
    both = Form(
        "output_limit", "stops on both sides", (known, other), stop("above"), memory=True, refines=above.name
    )  # fmt: skip
    return (*of_side("above"), *of_side("below"), above, below, both)


EFFECT = Effect(
    id="output_limit",
    summary="beyond a level the output follows less, or rests: diodes, tanks at their brim, throttles at their stops",
    signature=(
        "Crests on one side are cut off, or flattened, at one level of the output; troughs are as they were. A linear "
        "part behind it rounds the cut crests, and they come late; what rests at a stop leaves it as the drive turns."
    ),
    resembles={
        "saturation": "A curve of the input, the same on both sides.",
        "output_curve": "Smooth over the whole range; nothing linear comes behind it.",
        "asymmetric_gain": "Two slopes about zero input, not about a level of the output.",
        "fold": "Turns back beyond the level instead of standing still.",
        "output_dead_zone": "Stands still between two levels and follows beyond them.",
    },
    separation="One level of the output on one side, whatever brought it there, below it nothing.",
    excitation="slow and quick motion past the level, on both sides",
    typical={
        "level_um": (1.0, 22.0, "within the range of the readings"),
        "other_level_um": (1.0, 22.0, "the same of a stop on the other side"),
        "remaining_slope": (0.0, 0.9, "0 of a stop or an overflow; a diode behind a resistor keeps a part"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"level_um": 12.0, "remaining_slope": 0.1},
    forms=_forms,
    bends_slow_reading=True,
    curve_of_reading=True,
)
