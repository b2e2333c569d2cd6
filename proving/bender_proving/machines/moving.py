"""Machines that move: a motor, a servo with a gear, a tendon, a proportional valve, a hydraulic drive."""

import math
from collections import deque

import numpy as np
from numpy.random import Generator

from bender_proving.machines.machine import Array, Machine, Respond, State, about, column, integrated

PLAYS = frozenset({"backlash", "rate_independent_hysteresis", "hysteretic_spring", "presliding_friction"})
FRICTION = PLAYS | {"bearing_friction", "coulomb_friction", "dead_zone", "asymmetric_dead_zone", "output_dead_zone"}


def motor(rng: Generator) -> Respond:
    """Speed of a motor in rad/s by its voltage: dry friction with a dip at low speed, by a smooth sign."""
    gain, tau_s = about(rng, 12.0), about(rng, 0.12)
    dry, dip, slow = about(rng, 1.0), about(rng, 0.3), about(rng, 0.4)

    def slope(state: State, u: float) -> State:
        (w,) = state
        friction = (dry + dip * math.exp(-abs(w) / (8.0 * slow))) * math.tanh(w / slow)
        return ((gain * (u - friction) - w) / tau_s,)

    return lambda time_s, drive: column(integrated(slope, (0.0,), time_s, drive, 40), 0)


def geared_servo(rng: Generator) -> Respond:
    """Place of a load behind a gear with clearance, its motor in a position loop."""
    omega, damping, half = about(rng, 14.0), about(rng, 0.8), about(rng, 0.8)

    def respond(time_s: Array, drive: Array) -> Array:
        places = column(
            integrated(lambda x, u: (x[1], omega**2 * (u - x[0]) - 2 * damping * omega * x[1]), (0.0, 0.0), time_s,
                       drive, 20), 0)  # fmt: skip
        load, at = np.zeros(places.size), 0.0
        for k, place in enumerate(places):
            at = min(max(at, float(place) - half), float(place) + half)
            load[k] = at
        return load

    return respond


def tendon(rng: Generator) -> Respond:
    """Pull at the far end of a tendon in a sheath: wall friction takes a part of the pull, by its direction."""
    part, stiff = about(rng, 0.25), about(rng, 0.8)
    pieces = 12

    def respond(time_s: Array, drive: Array) -> Array:
        del time_s
        pull = np.zeros(pieces + 1)
        factor = math.exp(part / pieces)
        out = np.zeros(drive.size)
        for k, u in enumerate(drive + 10.0):
            # a piece slides where the pull on its two ends differs by more than the wall holds
            pull[0] = u
            for j in range(pieces):
                pull[j + 1] = min(max(pull[j + 1], pull[j] / factor), pull[j] * factor)
            out[k] = stiff * pull[-1]
        return out - out[0]

    return respond


def proportional_valve(rng: Generator) -> Respond:
    """Flow through a spool with overlap, unequal on its two sides, moved by a coil."""
    omega, damping = about(rng, 60.0), about(rng, 0.7)
    left, right, gain = about(rng, 0.8), about(rng, 1.1), about(rng, 3.0)

    def respond(time_s: Array, drive: Array) -> Array:
        spool = column(
            integrated(lambda x, u: (x[1], omega**2 * (u - x[0]) - 2 * damping * omega * x[1]), (0.0, 0.0), time_s,
                       drive, 20), 0)  # fmt: skip
        return gain * (np.maximum(spool - right, 0.0) + np.minimum(spool + left, 0.0))

    return respond


def hydraulic_drive(rng: Generator) -> Respond:
    """Place of a cylinder in a position loop whose pump gives no more than so much flow."""
    gain, most, delay = about(rng, 9.0), about(rng, 14.0), int(rng.integers(1, 3))

    def respond(time_s: Array, drive: Array) -> Array:
        waiting = deque([0.0] * delay)
        late = np.zeros(drive.size)
        for k, u in enumerate(drive):
            waiting.append(float(u))
            late[k] = waiting.popleft()
        found = integrated(lambda x, u: (min(max(gain * (u - x[0]), -most), most),), (0.0,), time_s, late, 20)
        return column(found, 0)

    return respond


MOVING = (
    Machine("motor", "dry friction at a shaft that turns", FRICTION, frozenset({"creep", "transport_delay"}),
            0.02, ("levels", "sines", "two levels"), 12.0, motor, "rad/s"),
    Machine("geared servo", "clearance of the gear", PLAYS | {"coulomb_friction"},
            frozenset({"creep", "stiffening", "thermal_drift"}), 0.02, ("levels", "sines", "ramps"), 30.0,
            geared_servo, "mm"),
    Machine("tendon", "friction along the sheath", PLAYS | {"coulomb_friction"},
            frozenset({"creep", "transport_delay", "sensor_lag"}), 0.05, ("sines", "ramps"), 12.0, tendon, "N"),
    Machine("proportional valve", "overlap of the spool",
            frozenset({"dead_zone", "asymmetric_dead_zone", "output_dead_zone"}),
            frozenset({"creep", "transport_delay", "stiffening", "thermal_drift"}), 0.01, ("levels", "sines", "ramps"),
            10.0, proportional_valve, "l/min"),
    Machine("hydraulic drive", "the most that its pump gives", frozenset({"slew_limit", "transport_delay"}),
            frozenset({"creep", "backlash", "rate_independent_hysteresis", "dead_zone"}), 0.05, ("levels",), 20.0,
            hydraulic_drive, "mm"),
)  # fmt: skip
