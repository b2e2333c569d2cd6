"""The forms of the missing effects: what a search may put into a model, and how it sets out.

An effect may have several published forms; they compete. A form maps free numbers to a block of the model. Numbers
are searched on a log scale where they are scales (time constants, frequencies, steps), linearly where they are
amplitudes, of either sign unless one of them has no physics. The ranges are those that the contract covers, with a
margin.
"""

import numpy as np

from bender_discrepancy.effects.form import Form, Free, Values, amplitude, growth, scale
from bender_plant.model import Model


def _simple(effect: str, *free: Free, memory: bool = False, timed: bool = True, name: str = "") -> Form:
    names = [x.name for x in free]

    def apply(model: Model, values: Values) -> Model:
        return model.with_block(effect, **dict(zip(names, values, strict=True)))

    return Form(effect, name or effect, free, apply, memory, timed)


def _plays(count: int, span_V: float) -> Form:
    thresholds = tuple(float(x) for x in span_V * np.geomspace(0.008, 0.6, count))

    def apply(model: Model, values: Values) -> Model:
        return model.with_block(
            "rate_independent_hysteresis", form="plays", thresholds_V=thresholds, weights_um_per_V=tuple(values)
        )

    free = tuple(amplitude(f"weights_um_per_V[{k + 1}]", 0.01, 10.0) for k in range(count))
    return Form("rate_independent_hysteresis", f"{count} plays", free, apply, memory=True, timed=False)


REVERSIBLE = ("reversible_linear_um_per_V", "reversible_quadratic_um_per_V2", "reversible_cubic_um_per_V3")


def _reversible(degree: int, span_V: float) -> tuple[Free, ...]:
    sizes = [0.01 * span_V ** (1 - power) for power in range(1, degree + 1)]
    return tuple(amplitude(name, size, 1e3 * size) for name, size in zip(REVERSIBLE, sizes, strict=False))


def _preisach(count: int, degree: int, span_V: float) -> Form:
    """Return plays with powers of each: a Preisach operator whose density varies smoothly along its diagonals."""
    thresholds = tuple(float(x) for x in 0.5 * span_V * np.arange(1, count + 1) / count)
    powers = ("weights_um_per_V", "quadratic_um_per_V2", "cubic_um_per_V3")[:degree]

    def apply(model: Model, values: Values) -> Model:
        many = {name: tuple(values[k * count : (k + 1) * count]) for k, name in enumerate(powers)}
        alone = dict(zip(REVERSIBLE, values[degree * count :], strict=False))
        return model.with_block("rate_independent_hysteresis", form="plays", thresholds_V=thresholds, **many, **alone)

    sizes = [0.01 * span_V ** (1 - power) for power in range(1, degree + 1)]
    free = [amplitude(f"{powers[k]}[{j + 1}]", sizes[k], 1e3 * sizes[k]) for k in range(degree) for j in range(count)]
    name = f"{count} plays to the power {degree}"
    numbers = (*free, *_reversible(degree, span_V))
    return Form("rate_independent_hysteresis", name, numbers, apply, memory=True, timed=False)


def _bouc_wen(span_V: float, reversible: bool) -> Form:
    def apply(model: Model, values: Values) -> Model:
        alpha, width, share, *back = values
        return model.with_block(
            "rate_independent_hysteresis", form="bouc_wen", alpha_um_per_V=alpha, beta_1_per_V=1.0 / width,
            gamma_1_per_V=share / width, **dict(zip(REVERSIBLE, back, strict=False)),
        )  # fmt: skip

    free = (
        amplitude("alpha_um_per_V", 0.02, 10.0),
        scale("width_V", 0.02 * span_V, span_V, 4),
        Free("gamma_over_beta", -0.99, 0.99, False, (0.0,), 0.1),
    )
    if not reversible:
        return Form("rate_independent_hysteresis", "Bouc-Wen", free, apply, memory=True, timed=False)
    free += _reversible(3, span_V)
    return Form("rate_independent_hysteresis", "Bouc-Wen beside a curve", free, apply, memory=True, timed=False)


def _creep(count: int) -> Form:
    def apply(model: Model, values: Values) -> Model:
        return model.with_block("creep", gains=values[:count], time_constants_s=values[count:])

    gains = tuple(growth(f"gains[{k + 1}]", 0.02, 3.0) for k in range(count))
    middles = ((0.1, 0.4, 1.5, 6.0, 25.0, 100.0),) if count == 1 else ((0.2, 1.0), (4.0, 40.0))
    taus = tuple(Free(f"time_constants_s[{k + 1}]", 0.02, 1e3, True, middles[k]) for k in range(count))
    return Form("creep", f"{count} relaxation{'s' * (count > 1)}", gains + taus, apply, memory=True)


def _logarithmic_creep() -> Form:
    taus = tuple(float(x) for x in np.geomspace(0.03, 1000.0, 10))

    def apply(model: Model, values: Values) -> Model:
        gain, slope = values
        return model.with_block("creep", gains=tuple(gain * tau**slope for tau in taus), time_constants_s=taus)

    free = (growth("gain_per_half_decade", 0.005, 1.0), Free("slope", -1.0, 1.0, False, (0.0,), 0.1))
    return Form("creep", "logarithmic", free, apply, memory=True)


def _creep_spectrum(count: int, low_s: float) -> Form:
    taus = tuple(float(x) for x in np.geomspace(low_s, 400.0, count))

    def apply(model: Model, values: Values) -> Model:
        return model.with_block("creep", gains=tuple(values), time_constants_s=taus)

    free = tuple(growth(f"gains[{k + 1}]", 0.02, 3.0) for k in range(count))
    return Form("creep", f"spectrum of {count}", free, apply, memory=True)


def _saturation(form: str) -> Form:
    def apply(model: Model, values: Values) -> Model:
        return model.with_block("saturation", scale_V=values[0], form=form)

    free = (Free("scale_V", 3.0, 1e4, True, (25.0, 50.0, 100.0, 250.0)),)
    return Form("saturation", f"saturation, {form}", free, apply, timed=False)


def _knee(with_compression: bool) -> Form:
    names = ("scale_V", "sharpness", "compression")[: 2 + with_compression]

    def apply(model: Model, values: Values) -> Model:
        return model.with_block("saturation", form="knee", **dict(zip(names, values, strict=True)))

    free = (
        Free("scale_V", 3.0, 1e4, True, (20.0, 40.0, 80.0, 250.0)),
        Free("sharpness", 0.7, 12.0, True, (1.2, 2.0, 4.0)),
        Free("compression", 0.05, 1.0, True, (0.4, 0.9)),
    )
    words = "knee with compression" if with_compression else "knee"
    return Form("saturation", f"saturation, {words}", free[: len(names)], apply, timed=False)


def _lens(order: int) -> Form:
    names = ("quadratic_1_per_um", "cubic_1_per_um2", "quartic_1_per_um3", "quintic_1_per_um4")[:order]
    sizes = (1e-3, 1e-4, 1e-6, 1e-7)

    def apply(model: Model, values: Values) -> Model:
        return model.with_block("lens_distortion", **dict(zip(names, values, strict=True)))

    free = tuple(amplitude(name, sizes[k], 1.0) for k, name in enumerate(names))
    return Form("lens_distortion", f"lens of degree {order + 1}", free, apply, timed=False)


def _monotone(effect: str, size: str, unit_size: float, limit: float, duration_s: float) -> tuple[Form, ...]:
    starts = tuple(duration_s * x for x in (0.03, 0.1, 0.3, 1.0, 10.0))
    tau = Free("time_constant_s", 0.005 * duration_s, 100.0 * duration_s, True, starts)
    both = (amplitude(size, unit_size, limit), tau)
    stretch = Free("exponent", 0.3, 4.0, True, (0.5, 2.0))
    return _simple(effect, *both), _simple(effect, *both, stretch, name=f"{effect}, stretched")


def _bench_ringing(first_Hz: float) -> tuple[Form, ...]:
    ratios = tuple(float(x) for x in np.concatenate([np.arange(0.5, 1.0, 0.01), np.arange(1.01, 1.55, 0.01)]))
    # the ringing is far from linear in it: half a period more or less over the record is another valley
    cubics = tuple(sign * size for size in (1e-5, 5e-5, 2e-4, 8e-4) for sign in (1.0, -1.0))
    overtones = tuple(first_Hz * x for x in (1.4, 1.8, 2.3, 3.0, 4.0, 5.2, 6.267, 8.0, 11.0))
    return (
        _simple("tip_mass", Free("frequency_ratio", 0.3, 2.5, True, ratios), memory=True),
        _simple("structural_damping", scale("damping_ratio", 0.001, 0.3, 7), memory=True),
        _simple("stiffening", Free("cubic_1_per_um2", -0.05, 0.05, False, cubics, 1e-5)),
        _simple(
            "second_mode",
            amplitude("share", 0.02, 0.9),
            Free("frequency_Hz", 1.2 * first_Hz, 20.0 * first_Hz, True, overtones),
            Free("damping_ratio", 0.0005, 0.5, True, (0.02,)),
            memory=True,
        ),
    )


def forms(span_V: float, stroke_um: float, duration_s: float, first_Hz: float) -> tuple[Form, ...]:
    """Return every form that a search tries, those found by scans of their own (delay, quantisers, hum) included.

    Args:
        span_V: largest voltage of the records.
        stroke_um: peak-to-peak of the readings.
        duration_s: of the longest record.
        first_Hz: first resonance of the model.
    """
    return (
        _simple("transport_delay", Free("delay_s", 0.0, 0.6, False, (), 1e-3), memory=True),
        _simple("supply_quantisation", Free("step_V", 0.005, 20.0, True, ()), timed=False),
        _simple("slew_limit", scale("slew_rate_V_per_s", 5.0, 2e4, 9), memory=True),
        _simple("supply_fall_lag", scale("time_constant_s", 1e-3, 2.0, 8), memory=True),
        _simple("source_resistance", scale("time_constant_s", 5e-4, 1.0, 9), memory=True),
        _simple("dead_zone", scale("threshold_V", 0.1, 10.0, 6), timed=False),
        _simple(
            "charge_leakage", growth("fraction", 0.02, 0.95),
            Free("time_constant_s", 0.3, 500.0, True, (1.0, 3.0, 10.0, 30.0, 100.0)), memory=True,
        ),
        _saturation("tanh"),
        _saturation("rational"),
        _knee(False),
        _knee(True),
        _simple("electrostriction", amplitude("coefficient_um_per_V2", 0.01 * stroke_um / span_V**2, 1.0), timed=False),
        _plays(10, span_V),
        _preisach(8, 2, span_V),
        _preisach(8, 3, span_V),
        _bouc_wen(span_V, reversible=False),
        _bouc_wen(span_V, reversible=True),
        _creep(1),
        _creep(2),
        _logarithmic_creep(),
        _creep_spectrum(7, 0.04),
        _creep_spectrum(10, 0.04),
        _creep_spectrum(12, 0.01),
        *_bench_ringing(first_Hz),
        _simple("backlash", scale("half_width_um", 0.1, 5.0, 6), memory=True, timed=False),
        *_monotone("ageing", "loss", 0.02, 50.0, duration_s),
        *_monotone("thermal_drift", "amplitude_um", 0.1, 1e3, duration_s),
        _simple(
            "periodic_disturbance", amplitude("sine_um", 0.1, 100.0), amplitude("cosine_um", 0.1, 100.0),
            Free("frequency_Hz", 1e-4, 1e5, False, (), 1.0 / duration_s),
        ),
        _simple("sensor_lag", scale("time_constant_s", 5e-4, 1.0, 9), memory=True),
        _lens(1),
        _lens(2),
        _lens(3),
        _lens(4),
    )  # fmt: skip
