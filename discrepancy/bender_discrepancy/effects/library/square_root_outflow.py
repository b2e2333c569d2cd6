"""Square-root outflow: a lag that drains by Torricelli's law, quicker when nearly empty than when full."""

from dataclasses import asdict

from bender_discrepancy.effects.effect import OTHER_RIGS, Effect, Sizes
from bender_discrepancy.effects.form import Form, Values, scale
from bender_plant.blocks import plant_lag
from bender_plant.model import Model, ModelError

COVERED = {"head_um": (1.0, 100.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    def apply(model: Model, values: Values) -> Model:
        """Take over the first lag of the plant, whose number stays free beside the head."""
        lag = next((x.parameters for x in model.blocks if x.id == plant_lag.ID), None)
        if not isinstance(lag, plant_lag.Parameters) or lag.time_constant_s == 0.0:
            raise ModelError("square_root_outflow: found a model without a lag, expected one that drains")
        rest = asdict(lag) | {"time_constant_s": lag.second_time_constant_s, "second_time_constant_s": 0.0}
        model = model.with_block(plant_lag.ID, **rest)
        return model.with_block("square_root_outflow", time_constant_s=lag.time_constant_s, head_um=values[0])

    head = sizes.sized(scale("head_um", *COVERED["head_um"], 5), COVERED["head_um"], "um")
    return (Form("square_root_outflow", "square-root outflow", (head,), apply, memory=True),)


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
        "output_limit": "A level that is never passed; below it the lag is a plain one.",
        "quadratic_drag": "A brake of a mode; the gain of slow motion stays.",
    },
    separation="Small steps at several levels: gain and time constant rise together, with the root of the level.",
    excitation="steps up and down about several levels, held until the level stands",
    typical={"head_um": (1.0, 100.0, "from a tank that is nearly empty at rest to one that is full")},
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"time_constant_s": 2.0, "head_um": 30.0},
    forms=_forms,
)
