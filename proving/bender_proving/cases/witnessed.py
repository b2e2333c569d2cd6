"""Benches whose weak records leave effects confused, with instruments beside the sensor that can distinguish them.

What is drawn has its rivals on the other side of an instrument: the supply's voltmeter stands between what the supply
does and what happens behind its terminals, its ammeter between a supply at its limit and one that lags, the
thermometer between what the warmth of the room does and what the
voltage does. A lag of the electrode is that of the supply here, so its voltmeter shows it. A lag of the sensor is not
drawn: a resistance between the terminals and the electrode would do the same unseen. Nor are leakage and ageing: both
lie behind the terminals and neither is warm, so no instrument here tells one from the other. The sensor
is the camera; the records are small steps, a slow rise that ends in a fall, sines, or a few levels.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator, default_rng

from bender_loop.records.record import Record
from bender_proving.cases.effects import effect
from bender_proving.cases.hidden import NOISE_UM, Hidden, log_uniform
from bender_proving.cases.residual import left_over_um
from bender_proving.chain import readings_um, terminals_V
from bender_proving.physics import surroundings
from bender_proving.physics.lobatto import Array
from bender_proving.records import excitations
from bender_proving.records.excitation import RATE_HZ, Excitation, even
from bender_proving.records.meters import (
    FILM_UM_PER_K,
    Thermometer,
    Voltmeter,
    drawn_ammeter,
    drawn_thermometer,
    drawn_voltmeter,
)

LEAST, DRAWS = 3.0, 400
_COURSE_S = 60.0
Size = Callable[[Generator, float], float]
Play = Callable[[Generator], Excitation]


class NothingTellsError(Exception):
    """Nothing that was drawn shows to the camera and to the instrument; another seed may do."""


@dataclass(frozen=True, slots=True)
class Situation:
    """An effect that a weak record leaves open.

    Attributes:
        effect: its id.
        play: the excitation.
        size: of the effect, given the largest voltage.
        shown_by: which instrument shows it: "voltmeter", "ammeter", "thermometer", or "" where one shows what it is
            not.
        cleared_by: which instrument that is.
    """

    effect: str
    play: Play
    size: Size
    shown_by: str
    cleared_by: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class WitnessedCase:
    """One bench.

    Attributes:
        number: of the case.
        effect: id of what is hidden.
        hidden: the same with its numbers.
        shown_by: as in its situation.
        record: with the channels of the instruments.
    """

    number: int
    effect: str
    hidden: Hidden
    shown_by: str
    record: Record


def _step(rng: Generator) -> Excitation:
    return excitations.one_step(round(float(rng.uniform(0.7, 1.6)), 2), 3.0)


def _larger_step(rng: Generator) -> Excitation:
    return excitations.one_step(round(float(rng.uniform(1.5, 4.0)), 2), 3.0)


def _steps(rng: Generator) -> Excitation:
    """Small steps to several heights: a static curve behind the terminals would show at one and not at another."""
    rate_Hz = RATE_HZ["camera"]
    volts = np.round(
        np.concatenate([np.zeros(1), rng.permutation(np.array([0.5, 1.6, 1.0])) * rng.uniform(0.8, 1.2)]), 2
    )
    held = np.array([2, *[round(1.5 * rate_Hz)] * 3])
    return even("camera", np.repeat(volts, held))


def _high_step(rng: Generator) -> Excitation:
    rate_Hz, volts = RATE_HZ["camera"], round(float(rng.uniform(10.0, 40.0)), 2)
    return even("camera", np.repeat(np.array([0.0, volts]), [round(1.5 * rate_Hz), round(_COURSE_S * rate_Hz)]))


def _fall(rng: Generator) -> Excitation:
    """Up slowly in many small steps, down in one."""
    rate_Hz, volts = RATE_HZ["camera"], round(float(rng.uniform(0.7, 1.6)), 2)
    ramp = np.linspace(0.0, volts, round(float(rng.uniform(6.0, 12.0)) * rate_Hz))
    parts = [np.zeros(2), np.round(ramp, 3), np.full(round(rate_Hz), volts), np.zeros(round(2.0 * rate_Hz))]
    return even("camera", np.concatenate(parts))


def _levels(rng: Generator) -> Excitation:
    """Three or four levels, upwards."""
    rate_Hz, count = RATE_HZ["camera"], int(rng.integers(3, 5))
    up = np.sort(rng.uniform(0.05, 1.0, count)) * rng.uniform(4.0, 25.0)
    volts = np.round(np.concatenate([np.zeros(1), up]), 2)
    return even("camera", np.repeat(volts, round(float(rng.uniform(0.5, 1.0)) * rate_Hz)))


def _sines(rng: Generator) -> Excitation:
    """Whole periods of one frequency at two heights: a delay and a lag shift them alike."""
    rate_Hz, frequency_Hz, volts = RATE_HZ["camera"], log_uniform(rng, 0.3, 1.0), float(rng.uniform(3.0, 7.0))
    times = np.arange(round(max(round(10.0 * frequency_Hz), 1) / frequency_Hz * rate_Hz)) / rate_Hz
    wave = 0.5 * volts * (1.0 - np.cos(2.0 * np.pi * frequency_Hz * times))
    return even("camera", np.concatenate([wave, 0.5 * wave]))


def _drawn(low: float, high: float) -> Size:
    return lambda rng, _: log_uniform(rng, low, high)


def _slew_V_per_s(rng: Generator, volts: float) -> float:
    return max(5.0, volts / float(rng.uniform(0.08, 0.4)))


def _seen_slew_V_per_s(rng: Generator, volts: float) -> float:
    """Slow enough for an ammeter that is read with every row."""
    return max(5.0, volts / float(rng.uniform(0.2, 0.4)))


SITUATIONS = (
    Situation("slew_limit", _step, _slew_V_per_s, "voltmeter"),
    Situation("source_resistance", _steps, _drawn(0.05, 0.6), "voltmeter"),
    Situation("supply_fall_lag", _fall, _drawn(0.05, 0.6), "voltmeter"),
    Situation("transport_delay", _sines, _drawn(0.05, 0.25), "voltmeter"),
    Situation("supply_quantisation", _levels, lambda rng, volts: volts * log_uniform(rng, 0.05, 0.5), "voltmeter"),
    Situation("dead_zone", _levels, lambda rng, volts: volts * log_uniform(rng, 0.05, 0.4), "voltmeter"),
    Situation("creep", _high_step, _drawn(0.03, 0.3), "", "thermometer"),
    Situation("thermal_drift", _high_step, _drawn(0.6, 4.0), "thermometer"),
    Situation("slew_limit", _larger_step, _seen_slew_V_per_s, "ammeter"),
)
"""Of case k the one at k modulo their number."""


def witnessed_case(number: int, seed: int) -> WitnessedCase:
    """Return the case of this number: what is hidden goes round, the rest is drawn from the seed.

    Raises:
        NothingTellsError: nothing drawn shows.
    """
    situation, rng = SITUATIONS[number % len(SITUATIONS)], default_rng([seed, number])
    name = situation.effect
    for _ in range(DRAWS):
        plan = situation.play(rng)
        voltmeter, thermometer = drawn_voltmeter(rng), drawn_thermometer(rng)
        um_per_K = float(rng.choice([-1.0, 1.0])) * log_uniform(rng, *FILM_UM_PER_K)
        hidden = _hidden(situation, plan, rng)
        if hidden is None:
            continue
        warmed_K = surroundings.surround(hidden, np.zeros(len(plan.time_s)), plan.time_s) / um_per_K
        seen_s = voltmeter.instants_s(plan.time_s, rng)
        output_V = terminals_V(plan.commands, (hidden,), seen_s)
        clean_um = readings_um(plan.commands, (hidden,))
        if situation.cleared_by == "thermometer":  # what it would show if the change were one of warmth
            told_K = (clean_um - readings_um(plan.commands)) / FILM_UM_PER_K[1]
        else:
            told_K = warmed_K
        if not _shows(clean_um, plan) or not _tells(situation, plan, output_V, voltmeter, told_K, thermometer):
            continue
        rows = plan.recorded
        reading_um = clean_um + NOISE_UM["camera"] * rng.standard_normal(len(clean_um))
        instruments: dict[str, Array] = {}
        if situation.shown_by == "ammeter":
            ammeter = drawn_ammeter(rng, hidden.magnitude)
            before_V = terminals_V(plan.commands, (hidden,), seen_s - ammeter.averaged_s)
            instruments["current_A"] = ammeter.shown_A(before_V, output_V, rng)
        else:
            instruments["supply_voltage_V"] = voltmeter.shown_V(output_V, rng)
        instruments["temperature_C"] = thermometer.shown_C(plan.time_s, warmed_K, rng)
        seen = {name: values[rows] for name, values in instruments.items()}
        record = Record(
            plan.time_s[rows],
            plan.voltage_V[rows],
            reading_um[rows],
            supply_voltage_V=seen.get("supply_voltage_V"),
            current_A=seen.get("current_A"),
            temperature_C=seen["temperature_C"],
        )
        return WitnessedCase(number, name, hidden, situation.shown_by, record)
    raise NothingTellsError(f"case {number} of seed {seed}: nothing drawn of {name} shows by {LEAST:g} times the noise")


def _hidden(situation: Situation, plan: Excitation, rng: Generator) -> Hidden | None:
    name = situation.effect
    entry, volts = effect(name), float(np.max(plan.voltage_V))
    form = "command" if name == "transport_delay" else str(rng.choice(entry.forms))
    sign = float(rng.choice([-1.0, 1.0])) if entry.signed else 1.0
    try:
        return entry.hide(form, sign * situation.size(rng, volts), plan.setting, rng)
    except ValueError:
        return None


def _shows(clean_um: Array, plan: Excitation) -> bool:
    """Whether the camera sees that something is missing."""
    rows = plan.recorded
    return left_over_um(clean_um[rows], readings_um(plan.commands)[rows]) >= LEAST * NOISE_UM["camera"]


def _tells(
    situation: Situation,
    plan: Excitation,
    output_V: Array,
    voltmeter: Voltmeter,
    told_K: Array,
    thermometer: Thermometer,
) -> bool:
    """Whether the instrument that shows or clears the effect is good enough for it: several times its noise."""
    if "thermometer" in (situation.shown_by, situation.cleared_by):
        return float(np.ptp(told_K)) >= LEAST * max(thermometer.noise_K, thermometer.resolution_K / math.sqrt(12.0))
    if situation.shown_by == "voltmeter":
        commanded = plan.voltage_V
        earlier = np.concatenate([[0.0], commanded[:-1]])
        low, high = np.minimum(commanded, earlier), np.maximum(commanded, earlier)
        off = np.maximum(low - output_V, 0.0) + np.maximum(output_V - high, 0.0)
        return float(np.sqrt(np.mean(off**2))) >= LEAST * max(voltmeter.noise_V, voltmeter.resolution_V)
    return True
