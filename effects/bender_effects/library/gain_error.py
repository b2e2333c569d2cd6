"""Another gain: the readings are the simulation times a factor: micrometres per pixel, or the beam's own gain."""

from bender_effects.effect import Effect

COVERED = {"gain": (0.01, 100.0)}


EFFECT = Effect(
    id="gain_error",
    title="Another gain",
    summary="the readings are the simulation times a factor: micrometres per pixel, or the beam's own gain",
    in_general="the readings are the simulation times a factor: the scale of the sensor, or the gain of the device",
    signature=(
        "Measured over simulated is a straight line through the origin with another slope. Nothing is left "
        "once the factor is taken out."
    ),
    resembles={
        "ageing": "The factor changes while the record runs.",
        "lens_distortion": "The line bends.",
        "offset": "The line misses the origin.",
    },
    separation="Solved for before anything else: only what a factor cannot explain may have another name.",
    excitation="any motion",
    typical={
        "gain": (
            0.35,
            1.15,
            "0.41 between the beam of Table 1 and its measurement; a few per cent for the scale of an image",
        ),
    },
    covered=COVERED,
    drive="slow_triangle",
    view="parity",
    example={"gain": 0.8},
    found_by="least squares, beside every effect",
)
