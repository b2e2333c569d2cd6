"""Loss by radiation: a lag that is quicker and answers less the hotter it is."""

from bender_effects.effect import OTHER_RIGS, UNSEEN_OF_A_ROW, Effect, Sizes
from bender_effects.form import Form, Values, scale
from bender_effects.lag_taken import without_a_lag
from bender_plant.model import Model

COVERED = {"rest_um": (4.0, 300.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # a fit that frees the lag goes no further down than that
    unseen_s = 0.99 * UNSEEN_OF_A_ROW * sizes.row_s

    def apply(model: Model, values: Values) -> Model:
        """Take over a lag of the plant, whose number stays free beside the temperature."""
        rest, tau_s = without_a_lag(model, unseen_s, "radiation_loss")
        return rest.with_block("radiation_loss", time_constant_s=tau_s, rest_um=values[0])

    rest = sizes.sized(scale("rest_um", *COVERED["rest_um"], 5), COVERED["rest_um"], "um")
    return (Form("radiation_loss", "loss by radiation", (rest,), apply, memory=True),)


EFFECT = Effect(
    id="radiation_loss",
    summary="a lag that loses with the fourth power of its temperature: heaters, ovens, lamps, hot wires",
    signature=(
        "The hotter it is, the less a step of the power adds and the sooner that is over: gain and time constant fall "
        "together. It cools quickly at first and slowly near rest."
    ),
    resembles={
        "square_root_outflow": "The opposite: gain and time constant rise with the level.",
        "saturation": "A curve of the input: the time constant stays.",
        "output_curve": "A curve of the reading: the time constant stays.",
        "output_limit": "A level that is never passed; below it the lag is a plain one.",
        "speed_drag": "Both ways alike, and with the level itself, not its third power.",
        "creep": "Slow at every level, not near rest alone.",
    },
    separation="Small steps at several temperatures: gain and time constant fall together, with the third power.",
    excitation="steps of the power up and down about several temperatures, held until the temperature stands",
    typical={"rest_um": (4.0, 300.0, "the absolute temperature at rest, more where heat is conducted beside")},
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"time_constant_s": 2.0, "rest_um": 40.0},
    forms=_forms,
)
