"""Offset: a constant is added to every reading: where the ruler begins."""

from bender_effects.effect import Effect

COVERED = {"offset_um": (0.0, 1000000.0)}


EFFECT = Effect(
    id="offset",
    title="Offset",
    summary="a constant is added to every reading: where the ruler begins",
    signature=(
        "Measured over simulated is a straight line of slope one that misses the origin. Nothing is left "
        "once it is taken out."
    ),
    resembles={
        "gain_error": "The slope differs.",
        "thermal_drift": "The constant changes while the record runs.",
        "electrostriction": "The mean of a moving record is shifted, holds at zero volts are not.",
        "dead_zone": "The constant is missing at and near zero volts.",
    },
    separation="Solved for before anything else: only what a constant cannot explain may have another name.",
    excitation="any record",
    typical={
        "offset_um": (0.0, 25.0, "up to one stroke; nothing physical hangs on it"),
    },
    covered=COVERED,
    drive="slow_triangle",
    view="parity",
    example={"offset_um": 2.0},
    found_by="least squares, beside every effect",
)
