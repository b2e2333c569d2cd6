"""Stiffening: the restoring force of the beam grows faster (or slower) than its displacement."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, Free, simple

COVERED = {"cubic_1_per_um2": (9.4e-06, 0.00094)}

FLATTEST, STEEPEST = 1.0, 0.25
"""At the stroke of the record: half of the cubic is left, or a quarter more of it; beyond them it is no bent one."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # the ringing is far from linear in it: half a period more or less while it lasts is another valley, an octave wide
    cubics = tuple(sign * 1e-5 * 2.0**k for k in range(8) for sign in (1.0, -1.0))
    cubic = Free("cubic_1_per_um2", -0.05, 0.05, False, cubics, 1e-5, vanishes_at=0.0)
    free = sizes.sized(cubic, COVERED["cubic_1_per_um2"], "1/um2")
    stroke_um2 = sizes.stroke_um**2
    bends = tuple(part / stroke_um2 for part in (0.1, -0.1))
    bending = Free("bending_1_per_um2", -STEEPEST / stroke_um2, FLATTEST / stroke_um2, False, bends, 0.01 / stroke_um2)
    plain = simple("stiffening", free)
    bent = simple("stiffening", free, bending, name="stiffening, bent", refines=plain.name)
    if sizes.piezo_bender:
        return plain, bent
    # a bender rests where it is symmetric; a circuit or a contact need not
    stroke_um = sizes.stroke_um
    rests = tuple(sign * part * stroke_um for part in (0.05, 0.2) for sign in (1.0, -1.0))
    preload = Free("preload_um", -2.0 * stroke_um, 2.0 * stroke_um, False, rests, 0.01 * stroke_um)
    return plain, bent, simple("stiffening", free, preload, name="stiffening, preloaded", refines=plain.name)


EFFECT = Effect(
    id="stiffening",
    summary="the restoring force of the beam grows faster (or slower) than its displacement",
    in_general="the restoring force grows faster (or slower) than the deflection",
    signature=(
        "The resonance moves with the level or the amplitude, and the static gain falls with the cube of "
        "the displacement: a residual over the voltage like saturation, and a detuned ringing at high "
        "levels."
    ),
    resembles={
        "saturation": "Leaves the resonance where it is.",
        "lens_distortion": "Leaves the resonance where it is, and bends the reading only.",
        "tip_mass": "Shifts the resonance at every level alike.",
        "quadratic_spring": "Softens on one side of rest as it stiffens on the other.",
        "rate_independent_hysteresis": "Its third harmonic comes with a loop.",
    },
    separation="Only stiffening moves the resonance with the level; saturation and a lens leave it where it is.",
    excitation="steps or sweeps about several levels",
    typical={
        "cubic_1_per_um2": (0.0, 1e-07, "far below what a camera sees"),
    },
    covered=COVERED,
    unusual="unusual for this actuator: the geometric effect of a cantilever is (q / L)^2, 3e-6 at full stroke",
    relative=True,
    drive="chirps_at_levels",
    view="resonance_at_levels",
    example={"cubic_1_per_um2": 8e-05},
    forms=_forms,
)
