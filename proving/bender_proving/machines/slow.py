"""Slow machines and a magnetic one: two tanks, an oven, a ferrite core."""

import math

import numpy as np
from numpy.random import Generator

from bender_proving.machines.machine import Array, Machine, Respond, State, about, column, integrated
from bender_proving.machines.moving import PLAYS

CURVE = frozenset({"electrostriction", "output_curve", "asymmetric_gain", "lens_distortion", "saturation"})


def tanks(rng: Generator) -> Respond:
    """Level of the lower of two tanks in cm by the voltage of a pump; the upper one runs over at its rim."""
    first, second, pump = about(rng, 0.5), about(rng, 0.45), about(rng, 0.45)
    rim = about(rng, 14.0, 0.2)

    def slope(state: State, u: float) -> State:
        upper, lower = state
        inflow = pump * max(u, 0.0)
        out = first * math.sqrt(max(upper, 0.0))
        over = max(inflow - out, 0.0) if upper >= rim else 0.0
        return inflow - out - over, out + 0.5 * over - second * math.sqrt(max(lower, 0.0))

    return lambda time_s, drive: column(integrated(slope, (4.0, 4.0), time_s, drive, 8), 1)


def oven(rng: Generator) -> Respond:
    """Temperature above the room in K by the power in W: air takes its time to the sensor, the wall radiates."""
    heat, loss, far = about(rng, 60.0), about(rng, 0.8), about(rng, 8.0)
    tau_s = about(rng, 15.0)

    def respond(time_s: Array, drive: Array) -> Array:
        def slope(state: State, u: float) -> State:
            wall, sensor = state
            radiated = 1.2e-9 * ((wall + 293.0) ** 4 - 293.0**4)
            return (u - loss * wall - radiated) / heat, (wall - sensor) / tau_s

        sensor = column(integrated(slope, (0.0, 0.0), time_s, drive, 8), 1)
        return np.interp(time_s - far, time_s, sensor)

    return respond


def ferrite(rng: Generator) -> Respond:
    """Flux density by the field: the anhysteretic curve of Langevin, walls held back (Jiles and Atherton 1986)."""
    most, shape, pinned, coupling, free = (
        about(rng, 1.2), about(rng, 18.0), about(rng, 14.0), about(rng, 5.0), about(rng, 0.15)
    )  # fmt: skip

    def anhysteretic(field: float) -> float:
        x = field / shape
        return most * (1.0 / math.tanh(x) - 1.0 / x if abs(x) > 1e-3 else x / 3.0)

    def respond(time_s: Array, drive: Array) -> Array:
        del time_s
        total, out, before = 0.0, np.zeros(drive.size), 0.0
        for k, field in enumerate(drive):
            steps = max(1, math.ceil(abs(field - before) / 0.25))
            for h in np.linspace(before, field, steps + 1)[1:]:
                dh, sign = (field - before) / steps, 1.0 if field >= before else -1.0
                away = anhysteretic(float(h) + coupling * total) - total
                moves = away / (sign * pinned - coupling * away) if away * sign > 0.0 else 0.0
                total += dh * (1.0 - free) * moves + free * max(away * sign, 0.0) * sign * abs(dh) / pinned
            before = float(field)
            out[k] = total
        return out

    return respond


SLOW = (
    Machine("tanks", "outflow by the root of the level, a rim",
            CURVE | {"square_root_outflow", "output_limit"},
            frozenset({"rate_independent_hysteresis", "backlash", "dead_zone", "creep"}), 4.0, ("levels", "slow sines"),
            6.0, tanks, "mm", 3.5),
    Machine("oven", "transport of the air; radiation",
            CURVE | {"radiation_loss", "transport_delay", "sensor_lag", "source_resistance"},
            frozenset({"rate_independent_hysteresis", "dead_zone", "backlash", "stiffening"}), 2.0,
            ("two levels", "levels"), 120.0, oven, "K", 60.0),
    Machine("ferrite", "hysteresis and saturation", PLAYS | {"saturation", "output_limit"},
            frozenset({"transport_delay", "sensor_lag", "source_resistance", "creep", "dead_zone"}), 0.01,
            ("slow sines", "ramps"), 120.0, ferrite, "T"),
)  # fmt: skip
