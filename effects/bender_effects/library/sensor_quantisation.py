"""Steps of the sensor: the reading comes in steps: whole pixels, steps of a converter."""

from bender_effects.effect import Effect

COVERED = {"step_um": (0.05, 3.0)}


EFFECT = Effect(
    id="sensor_quantisation",
    summary="the reading comes in steps: whole pixels, steps of a converter",
    in_general="the reading comes in steps: those of a converter, or of a display",
    signature=(
        "Over the reading a sawtooth between plus and minus half a step; all readings lie on one lattice, "
        "and small motions are not seen at all."
    ),
    resembles={
        "supply_quantisation": "Equal steps in volts instead of micrometres.",
        "backlash": "Lost after reversals only, and any reading can occur.",
        "dead_zone": "One missing piece, at zero volts.",
    },
    separation=(
        "The lattice is one of the readings, whatever the voltage and the direction; play is lost after reversals only."
    ),
    excitation="a ramp slower than one step per frame, or noise of half a step",
    typical={
        "step_um": (
            0.05,
            1.0,
            "0.70 µm, one pixel, in the paper's figure 8; tracking between pixels gives 0.02 to 0.05 µm",
        ),
    },
    covered=COVERED,
    drive="small_triangle",
    view="reading",
    example={"step_um": 0.7},
    found_by="the lattice that all readings lie on, before anything is fitted",
    read_off=True,
)
