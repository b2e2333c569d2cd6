"""The command under which a model reads what is wanted, found by trying: the numerical inverse of any plant.

The model is stepped from a saved state under a command that is held, and what it reads at the end is brought to the
target by the Illinois form of the secant method within the bounds of the command (M. Dowell and P. Jarratt, A modified
regula falsi method for computing the root of an equation, BIT 11 (1971) 168-174). It asks of the model that more
voltage does not mean less displacement; saturation, dead zones, play, creep, hysteresis operators, lags and steps of a
quantiser are all inverted by these few lines. Where no command reaches the target, the one that comes nearest is
returned, and where many do, or come as near (a slew limit of the model's own takes no notice of how much further a
command goes), the one next to the present command.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from bender_loop.control.plant import SavablePlant, restart

MOST_TRIALS = 16
_LEAST_SLOPE = 1e-9
_AS_NEAR = 1e-3
"""Of the tolerance: so much further from a target out of reach is as near. A source that stops early lets the tip swing
on, and by as much as would do for a target within reach it would lag behind its own limit, sample after sample."""


class Inverted(NamedTuple):
    """The command, what the model then reads, and its slope between the last two trials."""

    voltage_V: float
    reading_um: float
    slope_um_per_V: float


def response(plant: SavablePlant, state: object, voltage_V: float, steps_s: Sequence[float]) -> float:
    """Return what `plant`, from `state`, reads in um after steps of the lengths `steps_s` under a held command."""
    plant.restore(state)
    reading_um = 0.0
    for step_s in steps_s:
        reading_um = plant.step(voltage_V, step_s)
    return reading_um


def invert(
    plant: SavablePlant,
    state: object,
    target_um: float,
    steps_s: Sequence[float],
    bounds_V: tuple[float, float],
    present_V: float,
    slope_um_per_V: float,
    tolerance_um: float,
) -> Inverted:
    """Return the held command after which `plant`, from `state`, reads `target_um` at the end of `steps_s`.

    Args:
        plant: the model; left anywhere.
        state: saved by it.
        target_um: what it shall read.
        steps_s: lengths of the steps to take.
        bounds_V: smallest and largest command.
        present_V: the command in force, kept where it does.
        slope_um_per_V: a guess of the answer per volt.
        tolerance_um: how near is near enough.
    """

    def error(voltage_V: float) -> float:
        return response(plant, state, voltage_V, steps_s) - target_um

    low_V, high_V = bounds_V
    at_V = min(max(present_V, low_V), high_V)
    at = error(at_V)
    slope = slope_um_per_V if slope_um_per_V > _LEAST_SLOPE else 0.0
    if abs(at) <= tolerance_um:
        return Inverted(at_V, at + target_um, slope)
    end_V = high_V if at < 0.0 else low_V
    if end_V == at_V:
        return Inverted(at_V, at + target_um, slope)
    trials = 1
    before = last = (at_V, at)
    guess_V = at_V - at / slope if slope else end_V
    far_V, far = at_V, at
    # towards the end until the target lies between two trials
    while trials < MOST_TRIALS:
        guess_V = min(max(guess_V, low_V), high_V)
        far_V, far = guess_V, error(guess_V)
        trials += 1
        if abs(far) + tolerance_um < abs(at):
            before, last = (at_V, at), (far_V, far)
        if abs(far) <= tolerance_um or far * at < 0.0 or guess_V == end_V:
            break
        # the model answers less than was guessed: twice as far, from where it is now
        at_V, at, guess_V = far_V, far, far_V + 2.0 * (far_V - at_V)
    if guess_V == end_V and (far * at > 0.0 or abs(far) <= tolerance_um):
        return _as_near(error, before, last, trials, tolerance_um, target_um)
    return _between(error, (at_V, at), (far_V, far), trials, tolerance_um, target_um)


def _as_near(
    error: Callable[[float], float],
    before: tuple[float, float],
    last: tuple[float, float],
    trials: int,
    tolerance_um: float,
    target_um: float,
) -> Inverted:
    """The first command that comes as near to a target out of reach as the last trial that came nearer does."""
    (begin_V, begun), (end_V, reached) = before, last
    best = abs(reached) + _AS_NEAR * tolerance_um
    slope = (reached - begun) / (end_V - begin_V) if end_V != begin_V else 0.0
    for _ in range(MOST_TRIALS - trials):
        middle_V = 0.5 * (begin_V + end_V)
        middle = error(middle_V)
        if abs(middle) <= best:
            end_V, reached = middle_V, middle
        else:
            begin_V = middle_V
    return Inverted(end_V, reached + target_um, slope)


def _between(
    error: Callable[[float], float],
    first: tuple[float, float],
    second: tuple[float, float],
    trials: int,
    tolerance_um: float,
    target_um: float,
) -> Inverted:
    """The Illinois method between two trials; the nearer of them where they lie on one side of the target."""
    (a_V, a), (b_V, b) = first, second
    near_V, near = (a_V, a) if abs(a) <= abs(b) else (b_V, b)
    weight_a, weight_b = a, b
    while abs(near) > tolerance_um and a * b < 0.0 and trials < MOST_TRIALS:
        middle_V = (a_V * weight_b - b_V * weight_a) / (weight_b - weight_a)
        middle = error(middle_V)
        trials += 1
        if abs(middle) < abs(near):
            near_V, near = middle_V, middle
        if middle * b > 0.0:
            b_V, b, weight_b, weight_a = middle_V, middle, middle, 0.5 * weight_a
        else:
            a_V, a, weight_a, weight_b = middle_V, middle, middle, 0.5 * weight_b
    slope = (b - a) / (b_V - a_V) if b_V != a_V else 0.0
    return Inverted(near_V, near + target_um, slope)


def limit_overdrive(
    plant: SavablePlant,
    state: object,
    found: Inverted,
    goal_um: float,
    step_s: float,
    within_V: tuple[float, float],
    limits_V: tuple[float, float],
    undone_V: float,
    tolerance_um: float,
) -> Inverted:
    """Return the command, less where the model would be carried beyond its goal by one that cannot be undone.

    A command that overdrives a lag is right only if it can be taken back in time. So the model is tried with one that
    is taken back from the next step on, as fast as it may be.

    Args:
        plant: the model; left anywhere.
        state: saved by it.
        found: the command that is thought of.
        goal_um: where the model shall come to rest.
        step_s: length of this step and of those behind it.
        within_V: smallest and largest command now.
        limits_V: at any time.
        undone_V: by how much a step may take it back.
        tolerance_um: how much beyond is none.
    """
    plant.restore(state)
    missing_um = goal_um - plant.read()
    if abs(missing_um) <= tolerance_um:
        return found
    way = math.copysign(1.0, missing_um)

    def beyond(voltage_V: float) -> float:
        reading_um = response(plant, state, voltage_V, (step_s,))
        most_um, before_um = way * (reading_um - goal_um), -math.inf
        for _ in range(MOST_TRIALS):
            if way * reading_um <= before_um:
                break
            before_um = way * reading_um
            voltage_V = min(max(voltage_V - way * undone_V, limits_V[0]), limits_V[1])
            reading_um = plant.step(voltage_V, step_s)
            most_um = max(most_um, way * (reading_um - goal_um))
        return most_um

    most_um = beyond(found.voltage_V)
    if most_um <= tolerance_um:
        return found
    voltage_V = far_V = within_V[0] if way > 0.0 else within_V[1]
    least_um = beyond(far_V)
    if least_um < 0.0:
        near = _between(beyond, (far_V, least_um), (found.voltage_V, most_um), 2, tolerance_um, 0.0)
        voltage_V = near.voltage_V
    return Inverted(voltage_V, response(plant, state, voltage_V, (step_s,)), found.slope_um_per_V)


def commands_for(
    plant: SavablePlant,
    time_s: Sequence[float],
    wanted_um: Sequence[float],
    bounds_V: tuple[float, float],
    tolerance_um: float,
    horizon: int = 1,
) -> list[float]:
    """Return the commands under which `plant`, from rest, reads what is wanted at given instants.

    Args:
        plant: the model, without dead time.
        time_s: instants (n,), increasing; command k is held from instant k to the next.
        wanted_um: readings (n,) at these instants; that at the first one is where the plant is.
        bounds_V: smallest and largest command.
        tolerance_um: how near is near enough.
        horizon: every command is held over so many steps to meet its reading; more is calmer with noisy ones.

    Raises:
        RunError: the plant failed.
    """
    restart(plant)
    state, present_V, slope = plant.save(), min(max(0.0, bounds_V[0]), bounds_V[1]), 0.0
    commands: list[float] = []
    for k in range(len(time_s) - 1):
        end = min(k + horizon, len(time_s) - 1)
        steps = [time_s[n + 1] - time_s[n] for n in range(k, end)]
        found = invert(plant, state, wanted_um[end], steps, bounds_V, present_V, slope, tolerance_um)
        present_V, slope = found.voltage_V, found.slope_um_per_V
        plant.restore(state)
        plant.step(present_V, steps[0])
        state = plant.save()
        commands.append(present_V)
    return [*commands, present_V]
