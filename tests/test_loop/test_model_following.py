"""The shaper, the numerical inverse and the model-following step, on plants whose answers are known in closed form."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from bender_loop.control import model_following, pid
from bender_loop.control.following_loop import simulate_following
from bender_loop.control.inverse import commands_for, invert
from bender_loop.control.metrics import SETTLING_BAND
from bender_loop.control.model_following import Memory, ModelFollower, rest, step
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Sine, Step
from bender_loop.control.sampling import Sampling
from bender_loop.control.shaper import Shaped, Shaper, rise_in, shape
from bender_tuner.task.following import ARRIVED, held_back

PERIOD_S = 0.05
GAINS = Gains(0.05, 2.0, 0.01, 0.1)


class Lag:
    """gain * v behind a dead time of whole steps of 10 ms and a first-order lag, solved exactly; v saturates."""

    def __init__(
        self, gain: float = 0.5, lag_s: float = 0.08, dead_steps: int = 0, saturates_V: float = math.inf
    ) -> None:
        self.gain, self.lag_s, self.dead_steps, self.saturates_V = gain, lag_s, dead_steps, saturates_V
        self.reset()

    def reset(self) -> None:
        self.y = 0.0
        self.queue = (0.0,) * self.dead_steps

    def read(self) -> float:
        return self.y

    def step(self, voltage_V: float, step_s: float) -> float:
        for _ in range(round(step_s / 0.01)):
            self.queue = (*self.queue, max(min(voltage_V, self.saturates_V), -self.saturates_V))
            acting, self.queue = self.queue[0], self.queue[1:]
            self.y = self.gain * acting + (self.y - self.gain * acting) * math.exp(-0.01 / self.lag_s)
        return self.y

    def save(self) -> object:
        return self.y, self.queue

    def restore(self, state: object) -> None:
        self.y, self.queue = state  # pyright: ignore[reportGeneralTypeIssues]

    def close(self) -> None:
        """Nothing is open."""


def follower(dead_steps: int = 0, **changes: object) -> ModelFollower:
    inverted = Lag()
    usual = {
        "inverted": inverted,
        "predictor": Lag(dead_steps=dead_steps) if dead_steps else inverted,
        "gains": GAINS,
        "limits": Limits(0.0, 50.0),
        "period_s": PERIOD_S,
        "shaper": rise_in(10.0, 4 * PERIOD_S),
        "tolerance_um": 1e-9,
    }
    return ModelFollower(**usual | changes)  # pyright: ignore[reportArgumentType]


@given(st.floats(-50.0, 50.0), st.floats(0.1, 500.0), st.floats(0.1, 5000.0))
def test_a_shaped_step_keeps_its_bounds_and_arrives_without_passing(height: float, rate: float, curvature: float):
    shaper, dt, now = Shaper(rate, curvature), 0.05, Shaped()
    count = math.ceil(abs(height) / (rate * dt) + 4.0 * math.sqrt(abs(height) / curvature) / dt) + 20
    for _ in range(count):
        after = shape(shaper, now, height, dt)
        assert abs(after.rate_um_per_s) <= rate * (1.0 + 1e-12)
        assert abs(after.rate_um_per_s - now.rate_um_per_s) <= curvature * dt * (1.0 + 1e-9) or after.position_um in (
            height,
            pytest.approx(height, abs=curvature * dt * dt),
        )
        assert min(0.0, height) - 1e-9 <= after.position_um <= max(0.0, height) + 1e-9
        now = after
    assert now.position_um == pytest.approx(height, abs=1e-9)


@given(st.floats(-4.0, 30.0), st.floats(0.0, 50.0), st.floats(0.0, 2.0))
def test_the_inverse_is_the_root_or_the_bound_next_to_it(target: float, present: float, slope: float):
    plant = Lag()
    plant.step(20.0, 0.1)
    state = plant.save()

    def reading(voltage: float) -> float:
        plant.restore(state)
        return plant.step(voltage, PERIOD_S)

    found = invert(plant, state, target, (PERIOD_S,), (0.0, 50.0), present, slope, 1e-9)
    if reading(0.0) < target < reading(50.0):
        root = brentq(lambda v: reading(v) - target, 0.0, 50.0, xtol=1e-12)
        assert found.voltage_V == pytest.approx(root, abs=1e-6)
    else:
        assert found.voltage_V == pytest.approx(50.0 if target >= reading(50.0) else 0.0, abs=1e-6)
    assert found.reading_um == pytest.approx(reading(found.voltage_V), abs=1e-12)
    if found.voltage_V != present:
        # what a volt does is the same everywhere
        assert found.slope_um_per_V == pytest.approx((reading(50.0) - reading(0.0)) / 50.0, rel=1e-3)


@given(st.floats(1.0, 45.0), st.floats(0.0, 50.0), st.floats(1e-9, 0.3))
def test_out_of_reach_a_command_goes_as_far_as_the_model_answers_and_no_further(
    saturates: float, present: float, share: float
):
    """What a source that has reached its limit lags behind by, it lags behind by at every sample."""
    plant = Lag(saturates_V=saturates)
    state = plant.save()
    most = plant.step(saturates, PERIOD_S)
    plant.restore(state)
    short = most - plant.step(present, PERIOD_S)
    found = invert(plant, state, 2.0 * most + 1.0, (PERIOD_S,), (0.0, 50.0), present, 0.0, share * most)
    # within the tolerance already, the present one may stay
    assert most - found.reading_um <= (2e-3 if short > share * most else 1.0) * share * most + 1e-9
    assert found.voltage_V <= max(present, saturates + 0.05)
    # of many commands that do, the present one is kept
    if present >= saturates:
        assert found.voltage_V == present


def drive_on(
    made: ModelFollower, device: Any, goals: Sequence[float], off_um: Callable[[int], float] = lambda _: 0.0
) -> tuple[list[Memory], np.ndarray]:
    """Return the memory and the reading after every sample of these set-points; what is measured may be off."""
    memories, readings = [rest(made)], [device.read()]
    for k, goal in enumerate(goals):
        memories.append(step(made, memories[-1], goal, readings[-1] + off_um(k), PERIOD_S))
        readings.append(device.step(memories[-1].command_V, PERIOD_S))
    return memories[1:], np.array(readings[1:])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 9))
def test_with_the_right_model_the_block_rests_and_the_tip_follows_behind_the_dead_time(dead_steps: int):
    made = follower(dead_steps)
    trace = simulate_following(Lag(dead_steps=dead_steps), made, Step(10.0), Sampling(1.0 / PERIOD_S, substeps=5), 2.0)
    assert trace.fine_displacement_um is not None
    shaped, expected = Shaped(), [0.0]
    for _ in range(40):
        shaped = shape(made.shaper or Shaper(), shaped, 10.0, PERIOD_S)
        expected.append(shaped.position_um)
    behind = trace.fine_displacement_um[dead_steps::5]
    assert behind == pytest.approx(np.array(expected)[: behind.size], abs=1e-7)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.sampled_from((0.0, 0.01, 0.02, 0.03, 0.04, 0.05)), min_size=30, max_size=30))
def test_a_command_that_acts_later_than_planned_is_no_error_of_the_device(delays_s: list[float]):
    made, device = follower(7, command_delay_s=0.01), Lag(dead_steps=7)
    memory, standing_V, acted_s = rest(made), 0.0, None
    for late_s in delays_s:
        memory = step(made, memory, 10.0, device.read(), PERIOD_S, acted_s)
        assert memory.command_V == memory.feedforward_V
        device.step(standing_V, late_s)
        device.step(memory.command_V, PERIOD_S - late_s)
        standing_V, acted_s = memory.command_V, late_s


def test_a_known_reference_is_met_although_the_plant_is_late():
    sine, dead_steps = Sine(4.0, 0.5, 5.0, -0.5 * math.pi), 7
    made = follower(dead_steps, shaper=None)
    sampling = Sampling(1.0 / PERIOD_S, substeps=5)
    trace = simulate_following(Lag(dead_steps=dead_steps), made, sine, sampling, 6.0, dead_time_s=0.07)
    assert trace.fine_time_s is not None
    assert trace.fine_displacement_um is not None
    at_ticks = slice(40 + dead_steps, None, 5)
    error = trace.fine_displacement_um[at_ticks] - sine.sample(trace.fine_time_s[at_ticks])
    assert np.abs(error).max() < 1e-6


@pytest.mark.parametrize("lag_s", [0.05, 0.1, 0.3])
@pytest.mark.parametrize("levels", [(0.0, 10.0), (12.0, 3.0)])
def test_no_command_goes_further_than_the_slew_limit_can_undo(lag_s: float, levels: tuple[float, float]):
    """The tip arrives without passing the set-point, and nearly as soon as the best sequence of commands lets it."""
    start, end, slew = *levels, 60.0
    model, device = Lag(lag_s=lag_s), Lag(lag_s=lag_s)
    made = follower(inverted=model, predictor=model, shaper=Shaper(), slew_V_per_s=slew, tolerance_um=1e-6)
    _, seen = drive_on(made, device, [start] * 80 + [end] * 80)
    share = (seen[79:] - start) / (end - start)
    assert share.max() < 1.0 + 1e-4
    # the way up at full slew, then the way back: at no sample may a quicker sequence that does not pass be ahead
    best = _quickest(lag_s, start / 0.5, end / 0.5, slew * PERIOD_S, 81)
    assert np.abs(share[:40] - best[:40]).max() < 0.08


def most_of_each_move(made: ModelFollower, device: Lag, goals: Sequence[float]) -> list[float]:
    """Return how far the device goes at most on its way to each set-point, as a part of that way."""
    seen = drive_on(made, device, np.repeat(goals, 80).tolist())[1].reshape(-1, 80)
    begins = [0.0, *seen[:-1, -1]]
    return [((row - begin) / (goal - begin)).max() for row, begin, goal in zip(seen, begins, goals, strict=True)]


@settings(max_examples=30, deadline=None)
@given(st.floats(0.02, 0.6), st.floats(0.5, 20.0), st.floats(20.0, 300.0), st.integers(1, 12))
def test_whatever_lag_slew_and_shaper_no_set_point_is_passed(lag_s: float, level: float, slew: float, ticks: int):
    model, device = Lag(lag_s=lag_s), Lag(lag_s=lag_s)
    shaper = rise_in(10.0, ticks * PERIOD_S)
    made = follower(inverted=model, predictor=model, shaper=shaper, slew_V_per_s=slew, tolerance_um=1e-6)
    assert max(most_of_each_move(made, device, (level, 0.3 * level, 1.2 * level))) < 1.0 + 1e-4


@pytest.mark.parametrize("lag_s", [0.1, 0.3])
def test_beside_a_short_dead_time_no_set_point_is_passed_either(lag_s: float):
    """A first millisecond without an answer is a dead time to who looks at the answer alone."""
    model, device = Lag(lag_s=lag_s, dead_steps=1), Lag(lag_s=lag_s, dead_steps=1)
    made = follower(inverted=model, predictor=model, shaper=Shaper(), slew_V_per_s=60.0, lead_s=0.01, tolerance_um=1e-6)
    assert max(most_of_each_move(made, device, (10.0, 3.0))) < 1.0 + 1e-3


def _quickest(lag_s: float, from_V: float, to_V: float, change_V: float, count: int) -> np.ndarray:
    """Of all sequences that lead at full slew for n samples and a part, then back to the goal, the first that arrives;
    the answer of the lag at the samples, as a share of the way."""
    way, keep = math.copysign(1.0, to_V - from_V), math.exp(-PERIOD_S / lag_s)

    def answer(turn: float) -> np.ndarray:
        command, acting, seen = from_V, from_V, [0.0]
        for k in range(count - 1):
            up = min(max(turn - k, 0.0), 1.0)
            aim = command + way * change_V if up == 1.0 else command + way * change_V * up if up > 0.0 else to_V
            command += min(max(aim - command, -change_V), change_V)
            command = min(max(command, 0.0), 50.0)
            acting = command + (acting - command) * keep
            seen.append((acting - from_V) / (to_V - from_V))
        return np.array(seen)

    if answer(60.0).max() <= 1.0:
        return answer(60.0)
    return answer(float(brentq(lambda x: answer(x).max() - 1.0 - 1e-9, 0.01, 60.0)))  # pyright: ignore[reportArgumentType]


@settings(max_examples=25, deadline=None)
@given(st.floats(-30.0, 60.0), st.floats(20.0, 2000.0), st.integers(0, 2**32 - 1))
def test_limits_and_slew_hold_whatever_is_measured(setpoint: float, slew: float, seed: int):
    rng, made = np.random.default_rng(seed), follower(3, slew_V_per_s=slew)
    memory = rest(made)
    for _ in range(30):
        dt = float(rng.uniform(0.02, 0.3))
        before = memory.command_V
        measured = None if rng.random() < 0.2 else float(rng.normal(0.0, 30.0))
        memory = step(made, memory, setpoint, measured, round(dt, 2))
        assert 0.0 <= memory.command_V <= 50.0
        allowed = slew * min(round(dt, 2), model_following.LONGEST_DT_S)
        assert abs(memory.command_V - before) <= allowed * (1.0 + 1e-9) + 1e-9


def test_a_step_is_a_function_of_its_arguments():
    made = follower(3)
    memory = step(made, rest(made), 5.0, 0.1, PERIOD_S)
    first = step(made, memory, 5.0, 0.4, PERIOD_S)
    step(made, first, 9.0, 2.0, PERIOD_S)
    again = step(made, memory, 5.0, 0.4, PERIOD_S)
    assert again == first


def test_saturation_leaves_no_windup():
    """Half a second out of reach, then back: the command leaves its limit as soon as the set-point allows."""
    _, readings = drive_on(follower(2), Lag(dead_steps=2), [40.0] * 30 + [10.0] * 30)
    assert readings[-1] == pytest.approx(10.0, abs=0.05)


def test_the_inverse_of_a_record_gives_back_its_command():
    plant, times = Lag(), [0.05 * k for k in range(60)]
    commands = [20.0 + 15.0 * math.sin(0.7 * k) for k in range(60)]
    readings = [0.0]
    for command in commands[:-1]:
        readings.append(plant.step(command, 0.05))
    again = commands_for(plant, times, readings, (0.0, 50.0), 1e-10)
    assert again[:-1] == pytest.approx(commands[:-1], abs=1e-6)


class Play(Lag):
    """gain * v behind a play of half-width `half_um`; what it reads may be off by a constant."""

    def __init__(self, half_um: float = 3.0, off_um: float = 0.0) -> None:
        self.half_um, self.off_um = half_um, off_um
        super().__init__()

    def read(self) -> float:
        return self.y + self.off_um

    def step(self, voltage_V: float, step_s: float) -> float:
        del step_s
        pushed = self.gain * voltage_V
        self.y = min(max(self.y, pushed - self.half_um), pushed + self.half_um)
        return self.read()


def test_what_the_integral_does_inside_a_play_is_known_to_the_feedforward():
    """The reading is off, so the block leaves the side of the play on which the model rests; the next step is exact."""
    model, device = Play(), Play()
    made = follower(inverted=model, predictor=model, shaper=None, tolerance_um=1e-3)
    memories, readings = drive_on(made, device, [10.0] * 40 + [4.0] * 2, lambda k: 0.2 if 5 <= k < 40 else 0.0)
    assert memories[5].command_V - memories[39].command_V > 0.5
    assert readings[-1] == pytest.approx(4.0, abs=0.05)


def test_at_rest_the_edge_of_a_play_is_where_it_is_whatever_slope_was_seen_last():
    """On arrival from the inside of a play the last slope is hardly any."""
    model, device = Play(), Play()
    made = follower(inverted=model, predictor=model, tolerance_um=1e-3, margin_um=0.05)
    memories, readings = drive_on(made, device, [12.0] * 40)
    found, unseen = (
        step(made, memories[-1]._replace(slope_um_per_V=slope), 12.0, readings[-1], PERIOD_S)
        for slope in (model.gain, 0.02)
    )
    assert unseen.feedforward_V == pytest.approx(found.feedforward_V, abs=2.0 * made.tolerance_um / model.gain)
    assert unseen.slope_um_per_V == pytest.approx(model.gain, rel=1e-6)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_inside_a_play_the_command_is_that_of_the_block_alone(seed: int):
    """A play that only the model has: as long as the block does not cross it, the loop is the block's."""
    rng, gains = np.random.default_rng(seed), Gains(0.05, 2.0)
    model = Play(half_um=30.0)
    made = follower(inverted=model, predictor=model, shaper=None, gains=gains, tolerance_um=1e-3)
    memory, alone, start_V = rest(made), pid.PidState(), 0.0
    for k in range(40):
        measured = 20.0 + float(rng.normal(0.0, 0.5)) if k > 5 else 20.0
        memory = step(made, memory, 10.0, measured if k > 5 else None, PERIOD_S)
        if k == 5:
            start_V = memory.command_V
        if k > 5:
            alone, correction_V = pid.step(gains, pid.UNLIMITED, alone, 10.0, measured, PERIOD_S)
            assert memory.command_V == pytest.approx(max(start_V + correction_V, 0.0), abs=1e-6)


class Slewed(Lag):
    """gain * v, where v follows the command no faster than 40 V/s."""

    def step(self, voltage_V: float, step_s: float) -> float:
        v = self.y / self.gain
        self.y = self.gain * (v + max(min(voltage_V - v, 40.0 * step_s), -40.0 * step_s))
        return self.y


def test_what_the_block_learns_while_the_source_runs_at_its_limit_is_there_when_it_arrives():
    """The device has less gain than the model. Nothing is felt of the block meanwhile, and what it has found holds."""
    model, device = Slewed(), Slewed(gain=0.475)
    made = follower(inverted=model, predictor=model, shaper=None, gains=Gains(0.0, 4.0), tolerance_um=1e-3)
    # 20 V at 40 V/s are 10 samples
    memories, readings = drive_on(made, device, [10.0] * 10)
    measured = [0.0, *readings[:-1]]
    missed = sum(4.0 * (x.frames[0] - y) * PERIOD_S for x, y in zip(memories, measured, strict=True))
    assert readings[-1] == pytest.approx(9.5, abs=0.01)
    assert memories[-1].block.integral_V == pytest.approx(missed, rel=0.3)


@given(st.floats(0.0, 1e-3), st.floats(0.0, 19.0))
def test_a_target_that_is_all_but_out_of_reach_takes_no_more_command_than_the_model_answers(short: float, at_V: float):
    """Within the tolerance of the target already, any command would do: on another device the whole range does not."""
    model = Slewed()
    for _ in range(60):
        model.step(at_V, PERIOD_S)
    most_um = model.gain * (at_V + 40.0 * PERIOD_S)
    found = invert(model, model.save(), most_um + short, (PERIOD_S,), (0.0, 50.0), at_V, 0.0, 1e-3)
    assert found.voltage_V <= at_V + 40.0 * PERIOD_S + 0.02
    assert found.reading_um == pytest.approx(most_um, abs=1e-3)


class CreepingPlay:
    """gain (v + creep) behind a play; the creep follows v within half a second. What it reads drifts."""

    def __init__(self, drift_um_per_s: float = 0.0, creep: float = 0.8) -> None:
        self.drift_um_per_s, self.creep = drift_um_per_s, creep
        self.reset()

    def reset(self) -> None:
        self.time_s = self.creep_V = self.y = 0.0

    def read(self) -> float:
        return self.y + self.drift_um_per_s * self.time_s

    def step(self, voltage_V: float, step_s: float) -> float:
        self.time_s += step_s
        self.creep_V += (self.creep * voltage_V - self.creep_V) * -math.expm1(-step_s / 0.5)
        pushed = 0.5 * (voltage_V + self.creep_V)
        self.y = min(max(self.y, pushed - 1.0), pushed + 1.0)
        return self.read()

    def save(self) -> object:
        return self.time_s, self.creep_V, self.y

    def restore(self, state: object) -> None:
        self.time_s, self.creep_V, self.y = state  # pyright: ignore[reportGeneralTypeIssues]

    def close(self) -> None:
        """Nothing is open."""


@pytest.mark.parametrize("levels", [(10.0,), (6.0, 12.0)])
def test_a_play_stays_engaged_while_what_is_in_front_of_it_creeps(levels: tuple[float, ...]):
    """A drift that the tip has to follow on its way is corrected at once. From inside the play it would not be."""
    model, device = CreepingPlay(), CreepingPlay(-0.15)
    made = follower(inverted=model, predictor=model, shaper=None, gains=Gains(0.0, 6.0), tolerance_um=1e-3)
    _, readings = drive_on(made, device, np.repeat(levels, 100).tolist())
    for level, seen in zip(levels, readings.reshape(-1, 100), strict=True):
        # a ramp leaves its rate over the integral gain of the loop
        assert np.abs(seen - level)[20:].max() < 1.5 * 0.15 / (6.0 * 0.5)


@given(st.floats(-0.5, 0.5), st.integers(4, 12))
def test_what_the_edge_of_a_play_and_the_block_both_ask_for_counts_once(error_um: float, after: int):
    """Counted twice, the loop has twice its gain, and swings for ever on a device that is seen late."""
    model = CreepingPlay()
    made = follower(inverted=model, predictor=model, shaper=None, gains=Gains(0.0, 6.0), tolerance_um=1e-3)
    memory = rest(made)
    for _ in range(after):
        memory = step(made, memory, 10.0, None, PERIOD_S)
    by_edge_V = step(made, memory, 10.0, None, PERIOD_S).command_V - memory.command_V
    found = step(made, memory, 10.0, _predicted(made, memory) + error_um, PERIOD_S)
    by_block_V = -6.0 * error_um * PERIOD_S
    expected_V = by_edge_V + by_block_V
    if by_edge_V * by_block_V > 0.0:
        expected_V = math.copysign(max(abs(by_edge_V), abs(by_block_V)), by_block_V)
    assert by_edge_V < -1e-3
    assert found.command_V - memory.command_V == pytest.approx(expected_V, abs=5e-3)


def _predicted(made: ModelFollower, memory: model_following.Memory) -> float:
    """What the next reading would be if the device were as the model."""
    return step(made, memory, 10.0, None, PERIOD_S).frames[0]


@pytest.mark.parametrize("margin_um", [0.0, 0.15])
def test_within_its_margin_a_device_that_creeps_more_is_not_pushed_on(margin_um: float):
    """A tip that is pushed on stays there until the whole play is crossed."""
    model, device = CreepingPlay(), CreepingPlay(creep=0.82)
    rests = Gains(0.0, 0.0)
    made = follower(inverted=model, predictor=model, shaper=None, gains=rests, tolerance_um=1e-3, margin_um=margin_um)
    _, readings = drive_on(made, device, [10.0] * 60)
    pushed_um = readings[-1] - readings[0]
    assert pushed_um < 1e-3 if margin_um else pushed_um > 0.05


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_noise_leaves_the_model_on_the_side_of_the_play_on_which_the_device_is(seed: int):
    rng = np.random.default_rng(seed)
    model, device = Play(), Play()
    made = follower(inverted=model, predictor=model, shaper=None, gains=Gains(0.0, 2.0), tolerance_um=1e-3)
    noise_um = np.append(rng.normal(0.0, 0.1, 100), 0.0)
    _, readings = drive_on(made, device, [10.0] * 100 + [4.0], lambda k: noise_um[k])
    moved = readings[-1] - readings[-2]
    assert moved == pytest.approx(-6.0, abs=0.05)


@given(st.floats(0.0, 0.9), st.floats(0.0, 0.3))
def test_so_much_is_held_back_that_an_overshoot_comes_to_its_bound(overshoot: float, bound: float):
    held = held_back(overshoot, bound)
    assert 0.0 <= held < SETTLING_BAND
    passed = (1.0 - held) * (1.0 + overshoot)
    assert passed == pytest.approx(min(1.0 + bound, 1.0 + overshoot)) or held == ARRIVED * SETTLING_BAND


@pytest.mark.parametrize("rest_um", [0.0, -300.0])
@pytest.mark.parametrize("gain", [0.5, 0.525, 0.475])
def test_what_is_held_back_is_given_by_the_block(gain: float, rest_um: float):
    """A device that answers 5 % more passes by 2 %, none at all with the model's own gain, and every one arrives."""

    class Offset(Lag):
        def read(self) -> float:
            return super().read() + rest_um

        def step(self, voltage_V: float, step_s: float) -> float:
            return super().step(voltage_V, step_s) + rest_um

    made = follower(
        inverted=Offset(), predictor=Offset(dead_steps=7), held_back=1.0 - 1.02 / 1.05, gains=Gains(0.0, 4.0)
    )
    device = Offset(gain, dead_steps=7)
    trace = simulate_following(device, made, Step(rest_um + 10.0), Sampling(1.0 / PERIOD_S), 6.0)
    assert trace.displacement_um.max() < rest_um + 10.0 + (0.21 if gain > 0.5 else 0.02)
    assert trace.displacement_um[20] == pytest.approx(rest_um + 10.0, abs=0.5)
    assert trace.displacement_um[-1] == pytest.approx(rest_um + 10.0, abs=0.01)
