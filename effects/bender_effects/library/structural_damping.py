"""Another damping: the ringing dies faster or slower than modelled."""

from dataclasses import replace

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, scale, simple

COVERED = {"damping_ratio": (0.001, 0.3)}
SLIGHTLY = (0.8, 0.9, 0.95, 1.05, 1.1, 1.25)


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    ratio = scale("damping_ratio", *COVERED["damping_ratio"], 13)
    # a slight change promises nothing at the next start, beyond its valley
    near = tuple(x * sizes.damping_ratio for x in SLIGHTLY)
    near = tuple(x for x in near if ratio.low < x < ratio.high)
    free = replace(ratio, starts=(*ratio.starts, *near), vanishes_at=sizes.damping_ratio or None)
    return (simple("structural_damping", free, memory=True),)


EFFECT = Effect(
    id="structural_damping",
    summary="the ringing dies faster or slower than modelled",
    signature=(
        "After each step a residual at the resonance that starts at zero, is largest after about one decay "
        "time and dies: the envelopes differ, the phases do not. Slow drives show nothing."
    ),
    resembles={
        "tip_mass": "Changes the phase of the ringing, not its envelope.",
        "source_resistance": "The ringing is weaker from its first period on, the decay as it was.",
        "sensor_lag": "The ringing is weaker from its first period on, the decay as it was.",
    },
    separation=(
        "It changes the height and width of the resonance and nothing off it; a lag also softens the edge itself."
    ),
    excitation="steps, or a chirp through the first resonance",
    typical={
        "damping_ratio": (
            0.003,
            0.1,
            "0.4 % to 0.5 % measured on a metal cantilever in air, more with polymer and clamp",
        ),
    },
    covered=COVERED,
    drive="resonance_chirp",
    view="frequency",
    example={"damping_ratio": 0.05},
    forms=_forms,
    superposes=True,
)
