"""Square-root outflow: a lag that drains by Torricelli's law, quicker when nearly empty than when full."""

from dataclasses import asdict

from bender_effects.effect import OTHER_RIGS, UNSEEN_OF_A_ROW, Effect, Sizes
from bender_effects.form import Form, Values, scale
from bender_effects.lag_taken import without_a_lag
from bender_plant.model import Model

COVERED = {"head_um": (1.0, 100.0), "second_head_um": (1.0, 100.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # a fit that frees the lag goes no further down than that
    unseen_s = 0.99 * UNSEEN_OF_A_ROW * sizes.row_s

    def apply(model: Model, values: Values) -> Model:
        """Take over a lag of the plant, whose number stays free beside the head."""
        rest, tau_s = without_a_lag(model, unseen_s, "square_root_outflow")
        return rest.with_block("square_root_outflow", time_constant_s=tau_s, head_um=values[0])

    def apply_to_both(model: Model, values: Values) -> Model:
        """Take over both lags of the plant: one tank drains into another one."""
        rest, below_s = without_a_lag(apply(model, values[:1]), unseen_s, "square_root_outflow")
        upper = next(x.parameters for x in rest.blocks if x.id == "square_root_outflow")
        second = {"second_time_constant_s": below_s, "second_head_um": values[1]}
        return rest.with_block("square_root_outflow", **(asdict(upper) | second))

    head, below = (sizes.sized(scale(x, *COVERED[x], 5), COVERED[x], "um") for x in COVERED)
    plain = Form("square_root_outflow", "square-root outflow", (head,), apply, memory=True)
    both = Form(
        "square_root_outflow", "square-root outflow of two", (head, below), apply_to_both, memory=True,
        refines=plain.name,
    )  # fmt: skip
    return plain, both


EFFECT = Effect(
    id="square_root_outflow",
    summary="a lag that drains with the square root of its level: tanks, boilers, volumes behind an orifice",
    signature=(
        "It fills and drains faster near the bottom than near the top, and the level grows with more than the inflow: "
        "the time constant and the gain both rise with the level."
    ),
    resembles={
        "saturation": "A curve of the input: the time constant stays.",
        "output_curve": "A curve of the reading: the time constant stays.",
        "output_limit": "A level that is never passed, as the brim of a tank; below it the lag is a plain one.",
        "quadratic_drag": "A brake of a mode; the gain of slow motion stays.",
        "radiation_loss": "The opposite: gain and time constant fall with the level.",
    },
    separation="Small steps at several levels: gain and time constant rise together, with the root of the level.",
    excitation="steps up and down about several levels, held until the level stands",
    typical={
        "head_um": (1.0, 100.0, "from a tank that is nearly empty at rest to one that is full"),
        "second_head_um": (1.0, 100.0, "the same of a tank below"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"time_constant_s": 2.0, "head_um": 30.0},
    forms=_forms,
)
