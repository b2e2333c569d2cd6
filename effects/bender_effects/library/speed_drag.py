"""Drag of a speed: a lag that is quicker and answers less the faster it is, both ways alike."""

from bender_effects.effect import OTHER_RIGS, UNSEEN_OF_A_ROW, Effect, Sizes
from bender_effects.form import Form, Values, scale
from bender_effects.lag_taken import without_a_lag
from bender_plant.model import Model

COVERED = {"drag_1_per_um": (0.005, 0.5)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # a fit that frees the lag goes no further down than that
    unseen_s = 0.99 * UNSEEN_OF_A_ROW * sizes.row_s

    def apply(model: Model, values: Values) -> Model:
        """Take over a lag of the plant, whose number stays free beside the drag."""
        rest, tau_s = without_a_lag(model, unseen_s, "speed_drag")
        return rest.with_block("speed_drag", time_constant_s=tau_s, drag_1_per_um=values[0])

    drag = sizes.sized(scale("drag_1_per_um", *COVERED["drag_1_per_um"], 5, 0.0), COVERED["drag_1_per_um"], "1/um")
    return (Form("speed_drag", "drag of a speed", (drag,), apply, memory=True),)


EFFECT = Effect(
    id="speed_drag",
    summary="drag of something whose speed is read: fans, propellers, vehicles, pumps",
    signature=(
        "The faster it is, the less a step of the drive adds and the sooner that is over, both ways alike. "
        "Without drive it slows down quickly at first, then along a plain lag."
    ),
    resembles={
        "radiation_loss": "From rest on with the third power, and the other way below rest.",
        "bearing_friction": "A gap about zero drive, and rest; fast motion has the full gain.",
        "saturation": "A curve of the input: the time constant stays.",
        "output_curve": "A curve of the reading: the time constant stays.",
        "quadratic_drag": "A brake of a mode; the gain of slow motion stays.",
    },
    separation="Small steps at several speeds both ways: gain and time constant fall together, with the speed itself.",
    excitation="steps of the drive up and down about several speeds, both ways, held until the speed stands",
    typical={"drag_1_per_um": (0.005, 0.5, "from a motor with a small fan to a propeller that nothing else brakes")},
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"time_constant_s": 2.0, "drag_1_per_um": 0.08},
    forms=_forms,
)
