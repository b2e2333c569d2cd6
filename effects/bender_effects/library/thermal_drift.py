"""Thermal drift: the beam bends with the temperature of the room, whatever the voltage."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, amplitude, monotone
from bender_effects.witnessed import Witnessed

COVERED = {"amplitude_um": (0.2, 10.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    size = sizes.sized(amplitude("amplitude_um", 0.1, 1e3), COVERED["amplitude_um"], "um")
    return monotone("thermal_drift", size, sizes.duration_s)


EFFECT = Effect(
    id="thermal_drift",
    summary="the beam bends with the temperature of the room, whatever the voltage",
    in_general="the reading drifts with time, whatever the input: warming up, a zero that moves",
    signature=(
        "A slow, monotone function of time that knows nothing of the steps: over the voltage every later "
        "cycle is shifted in parallel."
    ),
    resembles={
        "creep": "Follows each step, with its sign.",
        "ageing": "Nothing at zero volts: it turns the line instead of shifting it.",
        "periodic_disturbance": "Comes back; an alias of 0.06 Hz looks like a drift for 4 s.",
        "charge_leakage": "Follows each step, against its sign.",
    },
    separation=(
        "It goes on at zero volts and does not change sign with the step; ageing turns the line instead of shifting it."
    ),
    excitation="a long record with holds at zero volts, and the temperature beside it",
    typical={
        "amplitude_um": (
            0.2,
            10.0,
            "20 to 50 µm per kelvin for PVDF on polyimide: some hundredths to tenths of a kelvin",
        ),
        "time_constant_s": (30.0, 3600.0, "the air of a room, a lamp, a bench that warms up"),
    },
    covered=COVERED,
    drive="cycles",
    view="voltage_in_time",
    example={"amplitude_um": 2.0, "time_constant_s": 60.0},
    forms=_forms,
    superposes=True,
    of_the_record=True,
    slow=True,
    witnessed=Witnessed(by_temperature=True),
)
