"""The closed loop with a model-following controller: camera, models, PID block, command, plant."""

import numpy as np

from bender_loop.control import model_following
from bender_loop.control.closed_loop import run_ticks, trace_of
from bender_loop.control.model_following import ModelFollower
from bender_loop.control.plant import Plant
from bender_loop.control.references import Reference
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Trace


def simulate_following(
    plant: Plant,
    follower: ModelFollower,
    reference: Reference,
    sampling: Sampling,
    duration_s: float,
    rng: np.random.Generator | None = None,
    *,
    dead_time_s: float = 0.0,
) -> Trace:
    """Run the loop from rest over the whole periods in `duration_s`, as `closed_loop.simulate` does for the PID block.

    Args:
        plant: reset first, and left where the run ends; another instance than the models of the follower.
        follower: with limits and slew of its own.
        reference: set-points; previewed where the follower has no shaper.
        sampling: what the controller sees and when.
        duration_s: n = duration / period ticks follow on tick 0; the trace has n + 1 rows.
        rng: source of the noise, needed when sampling.noise_um > 0.
        dead_time_s: of the plant, by which a preview looks further ahead.

    Raises:
        ValueError: the duration is shorter than a period, or noise has no generator.
        RunError: the plant or a model failed.
    """
    ticks = sampling.ticks(duration_s)
    noise = sampling.noise(ticks + 1, rng).tolist()
    times = np.arange(ticks + 1, dtype=np.float64) * sampling.period_s
    setpoints = reference.sample(times).tolist()
    previewed = follower.shaper is None
    aims = reference.sample(times + follower.look_ahead_s + dead_time_s).tolist() if previewed else setpoints
    memory = model_following.rest(follower)

    def control(aim: float, seen: float) -> float:
        nonlocal memory
        memory = model_following.step(follower, memory, aim, seen, sampling.period_s)
        return memory.command_V

    return trace_of(times, setpoints, sampling, *run_ticks(plant, control, aims, sampling, noise))
