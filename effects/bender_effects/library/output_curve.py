"""Curved reading: what the sensor gives is a curve of what it measures."""

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, Values, amplitude
from bender_plant.model import Model

COVERED = {"quadratic_1_per_um": (0.00022, 0.0173), "cubic_1_per_um2": (9.4e-06, 0.00075)}


NAMES = ("quadratic_1_per_um", "cubic_1_per_um2", "quartic_1_per_um3", "quintic_1_per_um4")
UNITS = ("1/um", "1/um2", "1/um3", "1/um4")
UNIT_SIZES = (1e-3, 1e-4, 1e-6, 1e-7)


def _curve(order: int, sizes: Sizes) -> Form:
    names = NAMES[:order]

    def apply(model: Model, values: Values) -> Model:
        return model.with_block("output_curve", **dict(zip(names, values, strict=True)))

    free = tuple(
        sizes.sized(amplitude(name, unit_size, 1.0), COVERED.get(name, (0.0, 0.0)), unit)
        for name, unit_size, unit in zip(names, UNIT_SIZES, UNITS, strict=False)
    )
    return Form("output_curve", f"curve of degree {order + 1}", free, apply, timed=False)


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    return tuple(_curve(order, sizes) for order in (1, 2, 3, 4))


EFFECT = Effect(
    id="output_curve",
    summary=("the reading is a smooth curve of what is measured: load cells, thermocouples, resistive sensors"),
    signature=(
        "A smooth curve over the reading, the same on both branches, at any speed and whatever brought it "
        "there; overshoot and ringing lie on the same curve."
    ),
    resembles={
        "electrostriction": "A curve of the input; with ringing, lag or hysteresis the two fall apart.",
        "saturation": "A curve of the input.",
        "stiffening": "Moves the resonance.",
        "quadratic_spring": "Moves the resonance.",
        "gain_error": "Straight.",
    },
    separation=(
        "It knows the reading and nothing else: whatever brings the output to a place, the error there is the same."
    ),
    excitation="the full range, fast and slow; a reference instrument beside the sensor",
    typical={
        "quadratic_1_per_um": (0.0, 0.002, "up to 5 % at full range"),
        "cubic_1_per_um2": (0.0, 0.0001, "as the quadratic term"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    includes=("output_dead_zone",),
    drive="slow_triangle",
    view="reading",
    example={"quadratic_1_per_um": 0.002},
    forms=_forms,
    bends_slow_reading=True,
    curve_of_reading=True,
)
