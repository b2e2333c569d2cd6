"""Distortion of the lens: the scale of the image changes over the field, so the reading bends."""

from bender_effects.effect import PIEZO_BENDERS, Effect, Sizes
from bender_effects.form import Form, Values, amplitude
from bender_plant.model import Model

COVERED = {
    "quadratic_1_per_um": (0.00022, 0.0173),
    "cubic_1_per_um2": (9.4e-06, 0.00075),
}


NAMES = ("quadratic_1_per_um", "cubic_1_per_um2", "quartic_1_per_um3", "quintic_1_per_um4")
UNITS = ("1/um", "1/um2", "1/um3", "1/um4")
UNIT_SIZES = (1e-3, 1e-4, 1e-6, 1e-7)


def _lens(order: int, sizes: Sizes) -> Form:
    names = NAMES[:order]

    def apply(model: Model, values: Values) -> Model:
        return model.with_block("lens_distortion", **dict(zip(names, values, strict=True)))

    free = tuple(
        sizes.sized(amplitude(name, unit_size, 1.0), COVERED.get(name, (0.0, 0.0)), unit)
        for name, unit_size, unit in zip(names, UNIT_SIZES, UNITS, strict=False)
    )
    return Form("lens_distortion", f"lens of degree {order + 1}", free, apply, timed=False)


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    return tuple(_lens(order, sizes) for order in (1, 2, 3, 4))


EFFECT = Effect(
    id="lens_distortion",
    summary="the scale of the image changes over the field, so the reading bends",
    signature=(
        "A smooth curve over the reading, the same on both branches, at any speed and whatever brought the "
        "tip there; the ringing is bent with it."
    ),
    resembles={
        "electrostriction": "A curve of the voltage; with ringing, creep or hysteresis the two fall apart.",
        "saturation": "A curve of the voltage.",
        "stiffening": "Moves the resonance.",
        "gain_error": "Straight.",
    },
    separation=(
        "It knows the place of the tip and nothing else: shift the picture and the curve shifts; overshoot "
        "and ringing lie on the same curve, which no curve of the voltage gives."
    ),
    excitation="the full stroke, and once more with the picture shifted; a stage micrometer",
    typical={
        "quadratic_1_per_um": (
            0.0,
            0.002,
            "up to 5 % at full stroke: eyepieces distort by 5 to 10 % at the edge of the field",
        ),
        "cubic_1_per_um2": (0.0, 0.0001, "as the quadratic term"),
    },
    covered=COVERED,
    relative=True,
    # of other rigs the same curve is sought under the neutral name `output_curve`
    rigs=PIEZO_BENDERS,
    drive="slow_triangle",
    view="reading",
    example={"quadratic_1_per_um": 0.002},
    forms=_forms,
    bends_slow_reading=True,
    curve_of_reading=True,
)
