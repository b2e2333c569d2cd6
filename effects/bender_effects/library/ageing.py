"""Ageing: the gain fades with time: depolarisation, warming, an adhesive that lets go."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, growth, monotone

COVERED = {"loss": (0.01, 0.5)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    return monotone("ageing", growth("loss", 0.02, 50.0), sizes.duration_s)


EFFECT = Effect(
    id="ageing",
    summary="the gain fades with time: depolarisation, warming, an adhesive that lets go",
    in_general="the gain fades with time: warming, wear, a supply that sags",
    signature=(
        "The residual is the displacement times a slow function of time: nothing at zero, most at the top. "
        "Over the voltage the lines fan out from the origin."
    ),
    resembles={
        "thermal_drift": "Shifts zero and top alike.",
        "creep": "Follows each step; ageing knows only the clock.",
        "gain_error": "Constant: nothing left once it is taken out.",
    },
    separation=(
        "A drift shifts zero and top alike; ageing leaves zero alone. Creep follows each step, ageing only the clock."
    ),
    excitation="the same cycle again and again, from start to end",
    typical={
        "loss": (0.0, 0.02, "an actuator repoles itself at work; warm film or fresh glue loses more"),
        "time_constant_s": (1000.0, 10000000.0, "hours to years"),
    },
    covered=COVERED,
    unusual=(
        "unusual for this actuator within one record: the activity of PVDF film lasts for years at room temperature"
    ),
    drive="cycles",
    view="voltage_in_time",
    example={"loss": 0.15, "time_constant_s": 100.0},
    forms=_forms,
    superposes=True,
    of_the_record=True,
    slow=True,
)
