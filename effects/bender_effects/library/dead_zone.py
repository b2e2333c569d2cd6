"""Dead zone: nothing moves until the command exceeds a threshold; above it the threshold is missing."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, scale, simple
from bender_effects.witnessed import Witnessed

COVERED = {"threshold_V": (0.1, 10.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    threshold = sizes.sized(scale("threshold_V", *COVERED["threshold_V"], 6, 0.0), COVERED["threshold_V"], "V")
    return (simple("dead_zone", threshold, timed=False),)


EFFECT = Effect(
    id="dead_zone",
    summary="nothing moves until the command exceeds a threshold; above it the threshold is missing",
    signature=(
        "A kink at the threshold, on both branches and at the same voltage: the start of the stroke is "
        "missing. Gain and offset take up the rest of it, so the residual is a hook at low voltage."
    ),
    resembles={
        "backlash": "Follows every reversal; the dead zone stays at zero volts.",
        "rate_independent_hysteresis": "A loss on one branch only is the material's.",
        "electrostriction": "A smooth curve without a kink.",
        "bearing_friction": "The same steady speeds; without drive, friction stops what a dead zone lets fade.",
        "sensor_quantisation": "A missing start one step of the readings high, repeated all over the stroke.",
    },
    separation="It sits at one voltage, in both directions; backlash follows every reversal wherever that is.",
    excitation="fine steps about zero, up and down",
    typical={
        "threshold_V": (0.05, 2.0, "0.6 V for a junction; the paper's figure 8 reads zero up to 2 V"),
    },
    covered=COVERED,
    drive="small_triangle",
    view="voltage",
    example={"threshold_V": 0.6},
    forms=_forms,
    witnessed=Witnessed(),
)
