"""Saturation: the effective field flattens towards full voltage, odd and without memory."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, Values
from bender_plant.model import Model

COVERED = {"scale_V": (20.3, 4950.0)}


def _scale(sizes: Sizes, *starts_V: float) -> Free:
    return sizes.sized(Free("scale_V", 3.0, 1e4, True, starts_V), COVERED["scale_V"], "V")


def _named(form: str, sizes: Sizes) -> Form:
    def apply(model: Model, values: Values) -> Model:
        return model.with_block("saturation", scale_V=values[0], form=form)

    free = _scale(sizes, 25.0, 50.0, 100.0, 250.0)
    return Form("saturation", f"saturation, {form}", (free,), apply, timed=False)


def _knee(with_compression: bool, sizes: Sizes) -> Form:
    names = ("scale_V", "sharpness", "compression")[: 2 + with_compression]

    def apply(model: Model, values: Values) -> Model:
        return model.with_block("saturation", form="knee", **dict(zip(names, values, strict=True)))

    free = (
        _scale(sizes, 20.0, 40.0, 80.0, 250.0),
        Free("sharpness", 0.7, 12.0, True, (1.2, 2.0, 4.0)),
        Free("compression", 0.05, 1.0, True, (0.4, 0.9)),
    )
    words = "knee with compression" if with_compression else "knee"
    return Form("saturation", f"saturation, {words}", free[: len(names)], apply, timed=False)


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    return _named("tanh", sizes), _named("rational", sizes), _knee(False, sizes), _knee(True, sizes)


EFFECT = Effect(
    id="saturation",
    summary="the effective field flattens towards full voltage, odd and without memory",
    in_general="the answer flattens towards large inputs, alike both ways and without memory",
    signature=(
        "The gain falls with the size of the voltage, the same on both branches and in both signs: the "
        "residual over a bipolar voltage is an S, over a unipolar one a single arch."
    ),
    resembles={
        "electrostriction": "Even. From 0 V to 50 V only the form of the arch differs.",
        "lens_distortion": "Bends whatever moves the tip: ringing and overshoot lie on one curve over the reading.",
        "stiffening": "It moves the resonance with the level, saturation does not.",
    },
    separation=(
        "A change of sign: saturation is odd, a square even. A lens bends the ringing as well; "
        "stiffening moves the resonance."
    ),
    excitation="the full range with both signs, at several amplitudes",
    typical={
        "scale_V": (500.0, 1000000.0, "less than 0.4 % lost at 50 V"),
    },
    covered=COVERED,
    unusual="unusual for this actuator: 50 V are 1.8 V/µm in the film, which is poled at 50 to 80 V/µm",
    relative=True,
    drive="bipolar_triangle",
    view="voltage",
    example={"scale_V": 90.0},
    forms=_forms,
)
