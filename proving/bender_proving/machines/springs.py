"""Springs and dampers: a loudspeaker, a pendulum, an elastomer, a damper of magnetic fluid."""

import math

import numpy as np
from numpy.random import Generator

from bender_proving.machines.machine import Array, Machine, Respond, State, about, column, integrated
from bender_proving.machines.moving import PLAYS

SPRING = frozenset({"stiffening", "quadratic_spring"})
LAGGING = frozenset({"transport_delay", "creep", "thermal_drift"})


def loudspeaker(rng: Generator) -> Respond:
    """Place of a cone in mm by the current's force: the surround stiffens, the coil leaves its field."""
    omega, damping = 2.0 * math.pi * about(rng, 45.0), about(rng, 0.25)
    hard, field = about(rng, 0.05), about(rng, 0.01)

    def slope(state: State, u: float) -> State:
        x, v = state
        force = u * (1.0 - field * x * x)
        return v, omega**2 * (force - x * (1.0 + hard * x * x)) - 2.0 * damping * omega * v

    return lambda time_s, drive: column(integrated(slope, (0.0, 0.0), time_s, drive, 12), 0)


def pendulum(rng: Generator) -> Respond:
    """Angle of a pendulum in rad by the torque at its axle."""
    omega, damping = about(rng, 6.0), about(rng, 0.3)

    def slope(state: State, u: float) -> State:
        angle, speed = state
        return speed, omega**2 * (u - math.sin(angle)) - 2.0 * damping * omega * speed

    return lambda time_s, drive: column(integrated(slope, (0.0, 0.0), time_s, drive, 12), 0)


def elastomer(rng: Generator) -> Respond:
    """Force of a rubber mount by its deflection: relaxations over three decades, and a filler that yields."""
    taus_s = [about(rng, x) for x in (0.3, 3.0, 30.0)]
    shares = [about(rng, x) for x in (0.25, 0.2, 0.2)]
    filler, yields = about(rng, 0.3), about(rng, 0.2)

    def respond(time_s: Array, drive: Array) -> Array:
        held, stuck, out = [0.0] * 3, 0.0, np.zeros(drive.size)
        for k, u in enumerate(drive):
            dt_s = float(time_s[k] - time_s[k - 1]) if k else 0.0
            held = [x + (float(u) - x) * -math.expm1(-dt_s / t) for x, t in zip(held, taus_s, strict=True)]
            stuck = min(max(stuck, float(u) - yields), float(u) + yields)
            soft = sum(s * (float(u) - x) for s, x in zip(shares, held, strict=True))
            out[k] = float(u) + soft + filler * (float(u) - stuck)
        return out

    return respond


def fluid_damper(rng: Generator) -> Respond:
    """Force of a damper by the speed of its rod: it yields, and the loop hangs on where the rod is."""
    viscous, most, steep, loop = about(rng, 1.2), about(rng, 60.0), about(rng, 0.25), about(rng, 0.6)

    def respond(time_s: Array, drive: Array) -> Array:
        place = np.concatenate([[0.0], np.cumsum(np.diff(time_s) * drive[:-1])])
        place -= place.mean()
        bent = np.tanh(steep * drive + loop * np.tanh(8.0 * place / max(float(np.std(place)), 1e-9)))
        return viscous * drive + most * bent

    return respond


SPRINGS = (
    Machine("loudspeaker", "a surround that stiffens", SPRING | {"saturation", "output_limit"},
            frozenset({"dead_zone", "backlash", "rate_independent_hysteresis", *LAGGING}), 0.001,
            ("noise", "sines"), 6.0, loudspeaker, "mm"),
    Machine("pendulum", "gravity bends with the angle", SPRING | {"electrostriction", "output_curve"},
            frozenset({"dead_zone", "backlash", "rate_independent_hysteresis", *LAGGING}), 0.05,
            ("levels", "sines"), 1.0, pendulum, "rad"),
    Machine("elastomer", "relaxation over decades, a filler that yields",
            PLAYS | {"creep", "charge_leakage", "sensor_lag", "source_resistance"},
            frozenset({"dead_zone", "stiffening", "transport_delay"}), 0.05, ("levels", "ramps", "sines"), 4.0,
            elastomer, "N"),
    Machine("fluid damper", "it yields, with a loop", PLAYS | {"saturation", "output_limit"},
            frozenset({"stiffening", "dead_zone", "creep"}), 0.005, ("slow sines", "sines"), 30.0, fluid_damper, "N"),
)  # fmt: skip
