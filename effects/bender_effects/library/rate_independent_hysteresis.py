"""Rate-independent hysteresis: what was reached depends on where the voltage turned, not on how fast."""

from dataclasses import replace

import numpy as np

from bender_effects.effect import Effect, Sizes, scaling
from bender_effects.form import Form, Free, Values, amplitude, growth, scale
from bender_plant.model import Model

COVERED = {
    "thresholds_V": (0.5, 25.0),
    "weights_um_per_V": (0.0023, 0.45),
    "alpha_um_per_V": (0.0023, 0.45),
    "beta_1_per_V": (0.02, 1.0),
    "gamma_1_per_V": (0.0, 1.0),
}


def _plays(count: int, sizes: Sizes) -> Form:
    thresholds = tuple(float(x) for x in sizes.span_V * np.geomspace(0.008, 0.6, count))

    def apply(model: Model, values: Values) -> Model:
        return model.with_block(
            "rate_independent_hysteresis", form="plays", thresholds_V=thresholds, weights_um_per_V=tuple(values)
        )

    weight = sizes.sized(amplitude("weights_um_per_V", 0.01, 10.0), COVERED["weights_um_per_V"], "um/V")
    free = tuple(replace(weight, name=f"weights_um_per_V[{k + 1}]") for k in range(count))
    return Form("rate_independent_hysteresis", f"{count} plays", free, apply, memory=True, timed=False)


CURVE = "electrostriction"
STEEPEST = 100.0
"""Slope of a spring that slips early, over the largest one that is covered: a jump at each reversal."""
REVERSIBLE = ("reversible_linear_um_per_V", "reversible_quadratic_um_per_V2", "reversible_cubic_um_per_V3")


def _power(name: str, power: int, sizes: Sizes) -> Free:
    """Return a free factor of a power of the voltage."""
    size = 0.01 * sizes.span_V ** (1 - power)
    slope = 1.0 if sizes.piezo_bender else scaling("um/V", sizes.span_V, sizes.stroke_um)
    return amplitude(name, size, 1e3 * size).times(slope)


def _reversible(degree: int, sizes: Sizes) -> tuple[Free, ...]:
    return tuple(_power(name, k + 1, sizes) for k, name in enumerate(REVERSIBLE[:degree]))


def _preisach(count: int, degree: int, sizes: Sizes) -> Form:
    """Return plays with powers of each: a Preisach operator whose density varies smoothly along its diagonals."""
    thresholds = tuple(float(x) for x in 0.5 * sizes.span_V * np.arange(1, count + 1) / count)
    powers = ("weights_um_per_V", "quadratic_um_per_V2", "cubic_um_per_V3")[:degree]

    def apply(model: Model, values: Values) -> Model:
        many = {name: tuple(values[k * count : (k + 1) * count]) for k, name in enumerate(powers)}
        alone = dict(zip(REVERSIBLE, values[degree * count :], strict=False))
        return model.with_block("rate_independent_hysteresis", form="plays", thresholds_V=thresholds, **many, **alone)

    free = [_power(f"{powers[k]}[{j + 1}]", k + 1, sizes) for k in range(degree) for j in range(count)]
    name = f"{count} plays to the power {degree}"
    numbers = (*free, *_reversible(degree, sizes))
    return Form(
        "rate_independent_hysteresis", name, numbers, apply, memory=True, timed=False, beside=CURVE, curve=REVERSIBLE
    )


def _bouc_wen(sizes: Sizes, reversible: bool) -> Form:
    """Return a loop that saturates within the span: its knee is 1 / (beta + gamma), whatever gamma over beta is.

    With the knee of beta alone, a loop with gamma near -beta goes on growing beyond the voltages that showed it.
    """

    def apply(model: Model, values: Values) -> Model:
        alpha, knee, share, *back = values
        beta = 1.0 / (knee * (1.0 + share))
        return model.with_block(
            "rate_independent_hysteresis", form="bouc_wen", alpha_um_per_V=alpha, beta_1_per_V=beta,
            gamma_1_per_V=share * beta, **dict(zip(REVERSIBLE, back, strict=False)),
        )  # fmt: skip

    free = (
        sizes.sized(amplitude("alpha_um_per_V", 0.02, 10.0), COVERED["alpha_um_per_V"], "um/V"),
        replace(scale("knee_V", 0.02 * sizes.span_V, sizes.span_V, 4), high=sizes.span_V),
        # near -1 the loop is lost at once where the voltage turns
        Free("gamma_over_beta", -0.99, 0.99, False, (0.0,), 0.1, no_answer_at="low"),
    )
    if not reversible:
        return Form("rate_independent_hysteresis", "Bouc-Wen", free, apply, memory=True, timed=False)
    free += _reversible(3, sizes)
    name = "Bouc-Wen beside a curve"
    return Form(
        "rate_independent_hysteresis", name, free, apply, memory=True, timed=False, beside=CURVE, curve=REVERSIBLE
    )


def _elastic_slip(sizes: Sizes) -> Form:
    """Return a spring that slips at a force (Jenkins element): what is lost is one play, at a threshold of its own."""

    def apply(model: Model, values: Values) -> Model:
        slope, half_width = values
        return model.with_block(
            "rate_independent_hysteresis", form="plays", thresholds_V=(half_width,), weights_um_per_V=(-slope,),
            reversible_linear_um_per_V=-slope,
        )  # fmt: skip

    slope = sizes.sized(amplitude("slip_um_per_V", 0.01, 10.0), COVERED["weights_um_per_V"], "um/V")
    free = (slope, scale("half_width_V", 0.02 * sizes.span_V, 0.5 * sizes.span_V, 5))
    return Form("rate_independent_hysteresis", "elastic slip", free, apply, memory=True, timed=False)


def _many_slips(count: int, sign: float, sizes: Sizes) -> Form:
    """Return springs that slip one after the other beside each other (Iwan 1966, doi:10.1115/1.3625199).

    Each gives what its play leaves of the input. Their slopes have one sign, so the loop gives no work back, whatever
    the numbers are.
    """
    thresholds = tuple(float(x) for x in sizes.span_V * np.geomspace(0.01, 0.7, count))

    def apply(model: Model, values: Values) -> Model:
        slopes = tuple(-sign * x for x in values)
        return model.with_block(
            "rate_independent_hysteresis", form="plays", thresholds_V=thresholds, weights_um_per_V=slopes
        )

    slope = sizes.sized(growth("slip_um_per_V", 0.02, 10.0), COVERED["weights_um_per_V"], "um/V")
    slope = replace(slope, high=slope.high * STEEPEST)
    free = tuple(replace(slope, name=f"slip_um_per_V[{k + 1}]") for k in range(count))
    name = f"{count} slips, {'with' if sign > 0.0 else 'against'} the gain"
    return Form("rate_independent_hysteresis", name, free, apply, memory=True, timed=False)


def _plays_beside_a_curve(count: int, sizes: Sizes) -> Form:
    """Return plays of weights that are not negative, beside powers of the voltage: loops that only ever lag."""
    thresholds = tuple(float(x) for x in 0.5 * sizes.span_V * np.arange(1, count + 1) / count)

    def apply(model: Model, values: Values) -> Model:
        alone = dict(zip(REVERSIBLE, values[count:], strict=True))
        return model.with_block(
            "rate_independent_hysteresis", form="plays", thresholds_V=thresholds,
            weights_um_per_V=tuple(values[:count]), **alone,
        )  # fmt: skip

    weight = replace(_power("weights_um_per_V", 1, sizes), low=0.0)
    free = tuple(replace(weight, name=f"weights_um_per_V[{k + 1}]") for k in range(count))
    name = f"{count} plays of one sign beside a curve"
    numbers = (*free, *_reversible(3, sizes))
    return Form(
        "rate_independent_hysteresis", name, numbers, apply, memory=True, timed=False, beside=CURVE, curve=REVERSIBLE
    )


def _plays_in_use(count: int, sizes: Sizes) -> Form:
    """Return plays beside a curve, of an actuator that had been driven as far before: its first cycle is as all others.

    Their weights change with the voltage, and are nowhere negative within the commands: each is told by what it is at
    either end of them.
    """
    thresholds = tuple(float(x) for x in sizes.span_V * np.geomspace(0.02, 0.45, count))

    def apply(model: Model, values: Values) -> Model:
        low, high = values[:count], values[count : 2 * count]
        alone = dict(zip(REVERSIBLE, values[2 * count :], strict=True))
        return model.with_block(
            "rate_independent_hysteresis", form="plays", thresholds_V=thresholds,
            weights_um_per_V=tuple(0.5 * (a + b) for a, b in zip(low, high, strict=True)),
            quadratic_um_per_V2=tuple(0.25 * (b - a) / sizes.span_V for a, b in zip(low, high, strict=True)),
            reached_V=sizes.furthest_V or sizes.span_V, **alone,
        )  # fmt: skip

    weight = replace(_power("weights_um_per_V", 1, sizes), low=0.0)
    free = [replace(weight, name=f"{x}_um_per_V[{k + 1}]") for x in ("lowest", "highest") for k in range(count)]
    name = f"{count} plays of one sign that lean, in use before"
    numbers = (*free, *_reversible(3, sizes))
    return Form(
        "rate_independent_hysteresis", name, numbers, apply, memory=True, timed=False, beside=CURVE, curve=REVERSIBLE
    )


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    if not sizes.piezo_bender:
        return (
            _elastic_slip(sizes),
            _many_slips(6, 1.0, sizes),
            _many_slips(6, -1.0, sizes),
            _plays_beside_a_curve(6, sizes),
            _plays_in_use(6, sizes),
            _bouc_wen(sizes, reversible=False),
            _bouc_wen(sizes, reversible=True),
        )
    return (
        _plays(10, sizes),
        _preisach(8, 2, sizes),
        _preisach(8, 3, sizes),
        _bouc_wen(sizes, reversible=False),
        _bouc_wen(sizes, reversible=True),
    )


EFFECT = Effect(
    id="rate_independent_hysteresis",
    summary="domain walls that stick: what was reached depends on where the voltage turned, not on how fast",
    in_general="what was reached depends on where the input turned, not on how fast: friction, magnetic domains",
    signature=(
        "The residual over the voltage is a loop, the same at every speed, with small loops inside large "
        "ones. Its area grows with amplitude to the power 2.5 to 3, it brings odd harmonics, and something "
        "stays at zero volts."
    ),
    resembles={
        "backlash": "One width at all amplitudes, flat sides; no rounded corners.",
        "source_resistance": "Area with amplitude squared times frequency, no harmonics; gone when slow.",
        "sensor_lag": "As the lag of the source: no harmonics, gone when slow.",
        "transport_delay": "Area with amplitude squared times frequency, full gain; gone when slow.",
        "creep": "Widens the loop of slower drives; hysteresis stays.",
        "charge_leakage": "A hold: leakage moves on, hysteresis stands still.",
        "electrostriction": "A curve without a loop; beside a loop, the curve is part of the hysteresis.",
    },
    separation=(
        "A linear lag has an area of amplitude squared times frequency and shrinks when slow; backlash has "
        "one width at all amplitudes. One frequency at one amplitude decides nothing."
    ),
    excitation="at least three amplitudes at two frequencies a decade apart, or a falling ladder of triangles",
    typical={
        "thresholds_V": (0.5, 25.0, "up to half of the full voltage: a wider play never engages"),
        "weights_um_per_V": (0.002, 0.12, "loops of 2 % (small signal) to 15 % of the span, as of ceramics"),
        "alpha_um_per_V": (0.002, 0.12, "the same loops"),
        "beta_1_per_V": (0.02, 1.0, "knees between 1 V and the full voltage"),
        "gamma_1_per_V": (0.0, 1.0, "not above beta"),
    },
    covered=COVERED,
    relative=True,
    drive="ladder",
    view="voltage",
    example={"thresholds_V": (1.5, 4.0, 8.0, 14.0), "weights_um_per_V": (0.04, 0.03, 0.03, 0.02)},
    forms=_forms,
    told_as="loop",
)
