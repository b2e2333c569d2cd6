"""Hysteretic spring: the restoring force has a Bouc-Wen loop over the displacement."""

from bender_effects.effect import OTHER_RIGS, Effect, Sizes
from bender_effects.form import Form, Free, Values, growth, scale
from bender_plant.model import Model

COVERED = {"share": (0.02, 1.0), "beta_1_per_um": (0.05, 2.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    def apply(model: Model, values: Values) -> Model:
        share, beta, part = values
        return model.with_block("hysteretic_spring", share=share, beta_1_per_um=beta, gamma_1_per_um=part * beta)

    beta = sizes.sized(scale("beta_1_per_um", *COVERED["beta_1_per_um"], 4), COVERED["beta_1_per_um"], "1/um")
    # below -1 the spring hardens
    part = Free("gamma_over_beta", -1.9, 0.99, False, (0.0,), 0.1)
    return (Form("hysteretic_spring", "hysteretic_spring", (growth("share", 0.05, 10.0), beta, part), apply, True),)


EFFECT = Effect(
    id="hysteretic_spring",
    summary="a restoring force with a loop of its own: joints that slip a little, wire ropes, rubber",
    signature=(
        "Over the voltage a loop that is thin for small cycles and ends at one width for large ones; the "
        "resonance falls and broadens as the amplitude grows."
    ),
    resembles={
        "rate_independent_hysteresis": "A loop over the voltage: ringing and resonance are as they were.",
        "coulomb_friction": "One width at all amplitudes, and it comes to rest.",
        "backlash": "One width at all amplitudes; the resonance stays where it is.",
        "structural_damping": "The same at every amplitude, and nothing when slow.",
    },
    separation="A loop when slow together with damping that depends on the size of the ringing.",
    excitation="a falling ladder of slow triangles, and steps read through the ringing",
    typical={
        "share": (0.0, 0.5, "joints and rubber"),
        "beta_1_per_um": (0.05, 2.0, "yields between a hundredth of the stroke and all of it"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="ladder",
    view="voltage",
    example={"share": 0.3, "beta_1_per_um": 0.4},
    forms=_forms,
)
