"""Electrostriction: a displacement with the square of the voltage, instantaneous and even."""

from bender_effects.effect import Effect, Sizes, scaling
from bender_effects.form import Form, Free, amplitude, simple

COVERED = {"coefficient_um_per_V2": (4.6e-05, 0.0056)}
FLATTEST, STEEPEST = 1.0, 0.25
"""At full voltage: half of the square is left, or a quarter more than it; beyond them it is no bent square."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    unit_size = 0.01 * sizes.stroke_um / sizes.span_V**2
    reached = scaling("um/V2", sizes.span_V, sizes.stroke_um) * COVERED["coefficient_um_per_V2"][1]
    limit = max(1.0, 2.0 * reached)
    square = amplitude("coefficient_um_per_V2", unit_size, limit)
    full_V2 = sizes.span_V**2
    bends = tuple(part / full_V2 for part in (0.1, -0.1, 0.7))
    bending = Free("bending_1_per_V2", -STEEPEST / full_V2, FLATTEST / full_V2, False, bends, 0.01 / full_V2)
    plain = simple("electrostriction", square, timed=False)
    bent = simple("electrostriction", square, bending, timed=False, name="electrostriction, bent", refines=plain.name)
    return plain, bent


EFFECT = Effect(
    id="electrostriction",
    summary="a displacement with the square of the voltage, instantaneous and even",
    in_general="a part of the output goes with the square of the input, at once and alike on both branches",
    signature=(
        "A parabola over the voltage, the same on both branches: a shift of the mean and a second harmonic, "
        "both with the square of the amplitude."
    ),
    resembles={
        "saturation": "Odd: turns round when the sign of the voltage does.",
        "lens_distortion": "Over the reading: with hysteresis or ringing the two fall apart.",
        "offset": "The mean is shifted in holds at zero volts as well.",
        "dead_zone": "Has a kink.",
        "rate_independent_hysteresis": "Where there is a loop, the curve may be part of it.",
    },
    separation=(
        "Reverse the sign of the voltage: the parabola stays, an odd curve turns round. Two tones give their sum."
    ),
    excitation="both signs of the voltage, or two tones",
    typical={
        "coefficient_um_per_V2": (0.0, 5e-05, "up to 0.5 % of the displacement at full voltage"),
    },
    covered=COVERED,
    unusual=(
        "unusual for this actuator above 0.5 %: both the Maxwell stress and the film's own square term give "
        "0.15 % at 50 V"
    ),
    relative=True,
    elsewhere="Curve of the input",
    drive="bipolar_triangle",
    view="voltage",
    example={"coefficient_um_per_V2": 0.00028},
    forms=_forms,
)
