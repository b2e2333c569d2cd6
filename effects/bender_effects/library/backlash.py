"""Backlash: play between the beam and what is watched: after a reversal the first part of the motion is lost."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, scale, simple

COVERED = {"half_width_um": (0.1, 5.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    least_um, most_um = COVERED["half_width_um"]
    # what rings makes the stroke of a record, with which they scale, several times that of the drive
    starts = scale("half_width_um", least_um / 5.0, most_um, 8, 0.0)
    half_width = sizes.sized(starts, COVERED["half_width_um"], "um")
    return (simple("backlash", half_width, memory=True, timed=False),)


EFFECT = Effect(
    id="backlash",
    summary="play between the beam and what is watched: after a reversal the first part of the motion is lost",
    in_general="play between what is driven and what is read: after a reversal the first part of the motion is lost",
    signature=(
        "Plus or minus the half-width, switched at every reversal: a loop over the voltage with one width "
        "at all amplitudes and flat sides. Ringing smaller than the play is invisible."
    ),
    resembles={
        "rate_independent_hysteresis": "Its loops shrink with the amplitude.",
        "dead_zone": "Stays at zero volts.",
        "sensor_quantisation": "A lattice of readings, whatever the direction.",
    },
    separation=(
        "Its width does not grow with the amplitude; hysteresis loops shrink with the triangle that makes them."
    ),
    excitation="a falling ladder of triangles down to the width of the play",
    typical={
        "half_width_um": (0.0, 0.3, "a loose wire at the tip; nothing else can rattle"),
    },
    covered=COVERED,
    unusual="unusual for this actuator: a clamped beam that a camera watches has no joint",
    drive="ladder",
    view="voltage",
    example={"half_width_um": 0.6},
    forms=_forms,
    bends_slow_reading=True,
)
