"""The closed loop in discrete time: camera, PID block, command, plant.

At tick k the frame is taken, before the new command acts; the controller computes the command, which the plant then
holds until tick k + 1. Times are k * period, nothing accumulates.
"""

import math
from collections.abc import Callable

import numpy as np

from bender_loop.control import pid
from bender_loop.control.pid import Gains, Limits, limits_at
from bender_loop.control.plant import Plant, restart
from bender_loop.control.references import Reference
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Trace
from bender_loop.fmu.elsewhere import at_the_plant

__all__ = ["Sampling", "Trace", "limits_at", "simulate"]

RUNAWAY_UM = 1e12
"""Far above anything that moves and far below overflow of a squared error."""


def simulate(
    plant: Plant,
    gains: Gains,
    limits: Limits,
    reference: Reference,
    sampling: Sampling,
    duration_s: float,
    rng: np.random.Generator | None = None,
    *,
    slew_V_per_s: float = math.inf,
) -> Trace:
    """Run the loop from rest over the whole periods in `duration_s`.

    Args:
        plant: reset first, and left where the run ends.
        gains: of the PID block.
        limits: of the command.
        reference: setpoints at the ticks.
        sampling: what the controller sees and when.
        duration_s: n = duration / period ticks follow on tick 0; the trace has n + 1 rows.
        rng: source of the noise, needed when sampling.noise_um > 0.
        slew_V_per_s: bound of the command's change from tick to tick, both ways, inf for none. The integral yields
            to it as it does to the limits. The command starts from 0 V, or from the limit next to it.

    Raises:
        ValueError: the duration is shorter than a period, the slew bound is not > 0, or noise has no generator.
        RunError: the plant failed.
    """
    if not slew_V_per_s > 0.0:
        raise ValueError(f"slew_V_per_s must be > 0, found {slew_V_per_s!r}")
    ticks = sampling.ticks(duration_s)
    noise = sampling.noise(ticks + 1, rng)
    times = np.arange(ticks + 1, dtype=np.float64) * sampling.period_s
    setpoints = reference.sample(times).tolist()
    snapshots = not (sampling.exposure_s or sampling.noise_um or sampling.quantum_um or sampling.latency_frames)
    if snapshots and sampling.substeps == 1 and slew_V_per_s == math.inf:
        run = _run_plain(plant, gains, limits, setpoints, sampling.period_s)
    else:
        run = _run_full(plant, gains, limits, setpoints, sampling, noise.tolist(), slew_V_per_s)
    return trace_of(times, setpoints, sampling, *run)


# What the controller saw and what it commanded at each tick, the output after each plant step, and if it diverged.
Run = tuple[list[float], list[float], list[float], bool]


@at_the_plant
def _run_plain(plant: Plant, gains: Gains, limits: Limits, setpoints: list[float], period: float) -> Run:
    """The loop of a camera without faults, as short as it gets: tuning spends its time here."""
    plant_step, pid_step = plant.step, pid.step
    state = pid.PidState()
    reading = restart(plant)
    readings, commands = [reading], []
    diverged = False
    for setpoint in setpoints[:-1]:
        state, command = pid_step(gains, limits, state, setpoint, reading, period)
        commands.append(command)
        reading = plant_step(command, period)
        if not -RUNAWAY_UM < reading < RUNAWAY_UM:
            diverged = True
            break
        readings.append(reading)
    else:
        commands.append(pid_step(gains, limits, state, setpoints[-1], reading, period)[1])
    return readings, commands, readings, diverged


@at_the_plant
def _run_full(
    plant: Plant,
    gains: Gains,
    limits: Limits,
    setpoints: list[float],
    sampling: Sampling,
    noise: list[float],
    slew_V_per_s: float,
) -> Run:
    state, command = pid.PidState(), min(max(0.0, limits.lower_V), limits.upper_V)

    def control(setpoint: float, seen: float) -> float:
        nonlocal state, command
        bounds = limits_at(limits, command, slew_V_per_s * sampling.period_s)
        state, command = pid.step(gains, bounds, state, setpoint, seen, sampling.period_s)
        return command

    return run_ticks(plant, control, setpoints, sampling, noise)


def run_ticks(
    plant: Plant, control: Callable[[float, float], float], aims: list[float], sampling: Sampling, noise: list[float]
) -> Run:
    """Run a loop from rest: at each tick the controller is given its aim and the frame that it sees."""
    reading, latency, weights = restart(plant), sampling.latency_frames, sampling.exposure_weights().tolist()
    frames = [sampling.quantised(reading + noise[0])]
    fine, seen, commands = [reading], [], []
    for tick, aim in enumerate(aims):
        seen.append(frames[max(tick - latency, 0)])
        commands.append(control(aim, seen[-1]))
        if len(commands) == len(aims):
            break
        outputs = [plant.step(commands[-1], sampling.plant_step_s) for _ in weights]
        if not all(-RUNAWAY_UM < output < RUNAWAY_UM for output in outputs):
            return seen, commands, fine, True
        fine += outputs
        frame = sum(weight * output for weight, output in zip(weights, outputs, strict=True))
        frames.append(sampling.quantised(frame + noise[tick + 1]))
    return seen, commands, fine, False


def trace_of(
    times: np.ndarray,
    setpoints: list[float],
    sampling: Sampling,
    seen: list[float],
    commands: list[float],
    fine: list[float],
    diverged: bool,
) -> Trace:
    """The trace of a run: what was asked, seen and commanded at the ticks, and the output after each plant step."""
    rows = len(commands)
    outputs = np.array(fine)
    shown = sampling.substeps > 1
    return Trace(
        times[:rows],
        np.array(setpoints[:rows]),
        np.array(seen),
        outputs[:: sampling.substeps],
        np.array(commands),
        diverged,
        np.arange(len(fine), dtype=np.float64) * sampling.plant_step_s if shown else None,
        outputs if shown else None,
    )
