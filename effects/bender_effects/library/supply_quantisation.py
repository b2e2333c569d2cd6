"""Steps of the supply: the set-point is rounded to the steps of the supply's converter."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, simple
from bender_effects.witnessed import Witnessed

COVERED = {"step_V": (0.02, 10.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    low, high = COVERED["step_V"]
    step = sizes.sized(Free("step_V", low / 4.0, 2.0 * high, True, (), jumps=True), COVERED["step_V"], "V")
    return (simple("supply_quantisation", step, timed=False, scan="steps"),)


EFFECT = Effect(
    id="supply_quantisation",
    summary="the set-point is rounded to the steps of the supply's converter",
    in_general="the input comes in steps: a converter, a display of few digits",
    signature=(
        "Over the voltage a sawtooth, zero at every multiple of the step and half a step times the local "
        "gain high, the same on both branches; each tread begins with a ringing."
    ),
    resembles={
        "sensor_quantisation": "Teeth equal in micrometres; where the gain varies, only one of the two lattices fits.",
        "dead_zone": "One missing piece at zero instead of a tooth at every step.",
    },
    separation="Teeth of equal width in volts are the supply's, of equal width in micrometres the sensor's.",
    excitation="a slow ramp in command steps that are finer than the supply's",
    typical={
        "step_V": (0.001, 0.2, "1 to 20 mV for laboratory supplies, 0.2 V for 8 bits over 50 V"),
    },
    covered=COVERED,
    elsewhere="Steps of the input",
    drive="small_triangle",
    view="voltage",
    example={"step_V": 0.5},
    forms=_forms,
    superposes=True,
    witnessed=Witnessed(True, True, excludes="above", bound="steps above"),
)
