"""Model-following control: the corrected model says the command, the PID block answers for what it got wrong.

    shaped reference ──▶ inverse of the model ──u_ff──┬──────▶ (+) ──▶ command ──▶ plant ──▶ measured
                                                      │         ▲                               │
                                                      ▼         │                               ▼
                                    model with dead time and sensor ──▶ predicted ──▶ (−) ──▶ PID block

The feedforward u_ff is the command under which the model, without its dead time and its sensor, is where the shaped
reference wants it `horizon_ticks` later. The whole model, driven by u_ff alone, predicts what the sensor will read; the
PID block, unchanged, acts on measured minus predicted with the set-point 0. As long as the model is right the block
rests, and the dead time, which the prediction has too, asks no patience of it (O. J. M. Smith, Closer control of loops
with dead time, Chemical Engineering Progress 53 (1957) 217-219). The feedforward is no part of the loop: its margins
are those of the PID block around the plant, whatever the model says (M. Morari and E. Zafiriou, Robust Process Control,
1989, on two degrees of freedom).

Inside a play, or wherever else the model does not feel a change of the command, the block's integral moves on without
an answer. What the model does not feel of it changes what the device remembers and corrects nothing, so it goes from
the integral to the feedforward: the models then stand where the device stands when the reference moves again. The sum,
which is the command, is the same. What creeps in front of a play carries the model away from the edge to which it was
led, or back to it, and takes with it what the block has corrected; the reading shows nothing of that until it is too
late. So while the reference rests the feedforward keeps its distance from that edge: at first what model and reading
are uncertain by, for a tip that is pushed on does not come back by itself, then what the block has moved it by. A
command that is led aside moves the edge too, and by as much as both go one way it is the same correction: counted
twice, a loop that is safe by its margins swings for ever on a device that is a frame late.

Voltage and slew limits are shared: the feedforward takes what it needs, the PID block gets the remainder, and its
anti-windup works against that remainder.

A command that overdrives a lag of the model has to be taken back later, and the slew limit bounds how fast: behind a
shaper the feedforward goes no further than can be undone in time.

A command acts a little after the sample that it answers. The inverse reckons with the delay that is planned; the
models are then led on with the delay that there was, where the host knows it. While the tip moves quickly a command
that was a few milliseconds later than the models believe would look like an error of the device.

A device may answer more than its model. The part of every movement by which it may is held back: the inverse aims at so
much less, the block compares the reading with a prediction of so much more, and gives the rest as soon as its loop lets
it. A movement of the tip that is too long by that part is then no overshoot; the price is that the part held back comes
as late as the loop brings it.

Standard library only: the file is carried inside the controller FMU, as are those that it imports.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from bender_loop.control import pid
from bender_loop.control.inverse import MOST_TRIALS, Inverted, invert, limit_overdrive, response
from bender_loop.control.pid import Gains, Limits, PidState
from bender_loop.control.plant import SavablePlant, restart
from bender_loop.control.shaper import Shaped, Shaper, shape

LONGEST_DT_S = 0.2
"""A gap between samples longer than this moves the command no further than one of this length would."""
_UNFELT = 1e-3
"""A change of the command is not felt where the model answers by less than this part of the inverse's tolerance, and of
what it would answer by its last slope."""
_THERE = 4.0
"""So many tolerances of the inverse from a set-point that rests a model is there: no play is crossed for less."""
_FELT = 0.9
"""Of that slope: a change that is felt by so much is felt from the first volt on."""
_HALVINGS = 8
"""So often an interval is halved in which a model begins to feel a command."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelFollower:
    """What the controller is made of.

    Attributes:
        inverted: the model without what is not to be inverted: dead time, sensor.
        predictor: the whole model; the same object as `inverted` where there is nothing to leave out.
        gains: of the PID block.
        limits: of the command.
        period_s: time between samples.
        slew_V_per_s: bound of the command's rate.
        shaper: of a reference that is not known beforehand; None follows the reference as it is.
        horizon_ticks: so many samples of held command ahead the inverse meets the reference; more are calmer.
        lead_s: dead time left in `inverted`, which the horizon has to reach beyond.
        latency_frames: age of a measurement when the controller gets it.
        frame_weights: of the predicted readings in a frame, at equal steps of a period; (1,) is a snapshot.
        command_delay_s: planned from the instant of a measurement until the command acts, less than a period.
        tolerance_um: how near the inverse comes to the reference.
        held_back: part of a movement from rest that is left to the block.
        margin_um: distance kept from the edge of a play at first, what model and reading are uncertain by.
    """

    inverted: SavablePlant
    predictor: SavablePlant
    gains: Gains
    limits: Limits
    period_s: float
    slew_V_per_s: float = math.inf
    shaper: Shaper | None = None
    horizon_ticks: int = 1
    lead_s: float = 0.0
    latency_frames: int = 0
    frame_weights: tuple[float, ...] = (1.0,)
    command_delay_s: float = 0.0
    tolerance_um: float = 1e-3
    held_back: float = 0.0
    margin_um: float = 0.0

    def __post_init__(self) -> None:
        if not (self.period_s > 0.0 and 0.0 <= self.command_delay_s < self.period_s):
            raise ValueError(
                f"found a period of {self.period_s!r} s and a delay of the command of {self.command_delay_s!r} s, "
                "expected a period > 0 and a delay from 0 to below it"
            )
        if self.horizon_ticks < 1 or self.latency_frames < 0 or self.lead_s < 0.0 or not self.tolerance_um > 0.0:
            raise ValueError(
                f"found horizon_ticks {self.horizon_ticks!r}, latency_frames {self.latency_frames!r}, lead_s "
                f"{self.lead_s!r}, tolerance_um {self.tolerance_um!r}, expected >= 1, >= 0, >= 0, > 0"
            )
        if not 0.0 <= self.held_back < 1.0 or not 0.0 <= self.margin_um < math.inf:
            raise ValueError(
                f"found held_back {self.held_back!r} and margin_um {self.margin_um!r}, expected from 0 to below 1, and "
                "a finite length"
            )

    @property
    def look_ahead_s(self) -> float:
        """From a sample until the instant whose reference the inverse meets, dead time of the plant left out."""
        return self.command_delay_s + self.horizon_ticks * self.period_s


class Memory(NamedTuple):
    """What the controller remembers from sample to sample.

    Attributes:
        ahead, behind: states of `inverted` and `predictor` at the last sample.
        frames: predicted frames, the newest last.
        shaped: the shaped reference.
        standing_V: the feedforward in force at the last sample, until the present one acts.
        feedforward_V: of the present command.
        slope_um_per_V: of the inverse, as last seen.
        block: of the PID block.
        command_V: in force.
        begun: a command is in force.
        rest_um: reading at rest.
        way: in which the inverted model moved last, up or down; 0 before.
        aside_V: of the feedforward from the command at which the model would go on that way.
    """

    ahead: object
    behind: object
    frames: tuple[float, ...]
    shaped: Shaped
    standing_V: float
    feedforward_V: float
    slope_um_per_V: float
    block: PidState
    command_V: float
    begun: bool = False
    rest_um: float = 0.0
    way: float = 0.0
    aside_V: float = 0.0


def rest(follower: ModelFollower) -> Memory:
    """Return the memory before the first sample: plant and models at rest under the command next to 0 V."""
    first_um = restart(follower.predictor)
    behind = follower.predictor.save()
    if follower.inverted is not follower.predictor:
        shown_um = restart(follower.inverted)
        ahead = follower.inverted.save()
    else:
        shown_um, ahead = first_um, behind
    command_V = min(max(0.0, follower.limits.lower_V), follower.limits.upper_V)
    frames = (first_um,) * (follower.latency_frames + 1)
    voltages_V = command_V, command_V
    return Memory(ahead, behind, frames, Shaped(shown_um), *voltages_V, 0.0, PidState(), command_V, rest_um=shown_um)


def step(
    follower: ModelFollower,
    memory: Memory,
    reference_um: float,
    measurement_um: float | None,
    dt_s: float,
    acted_s: float | None = None,
) -> Memory:
    """Take one sample; the memory after it, whose `command_V` is the command.

    Args:
        follower: what the controller is made of.
        memory: after the sample before.
        reference_um: the set-point now; without a shaper that of `look_ahead_s` later, dead time added.
        measurement_um: at this sample, None for a lost one: the block then rests and the feedforward goes on.
        dt_s: time since the sample before, > 0.
        acted_s: from the sample before until its command acted; None for as planned.
    """
    ahead, behind, frames = _at_the_sample(follower, memory, dt_s, acted_s)
    begin = _at_the_command(follower, ahead, memory.feedforward_V)
    shaped, wanted_um = _target(follower, memory.shaped, reference_um, dt_s)
    kept, rest_um = 1.0 - follower.held_back, memory.rest_um
    target_um, goal_um = rest_um + kept * (wanted_um - rest_um), rest_um + kept * (reference_um - rest_um)
    change_V = follower.slew_V_per_s * min(dt_s, LONGEST_DT_S)
    limits = follower.limits
    within = max(limits.lower_V, memory.feedforward_V - change_V), min(limits.upper_V, memory.feedforward_V + change_V)
    found = invert(
        follower.inverted,
        begin,
        target_um,
        _horizon(follower),
        within,
        memory.feedforward_V,
        memory.slope_um_per_V,
        follower.tolerance_um,
    )
    if follower.shaper is not None and follower.lead_s < follower.period_s and change_V < math.inf:
        found = limit_overdrive(
            follower.inverted,
            begin,
            found,
            goal_um,
            follower.period_s,
            within,
            (limits.lower_V, limits.upper_V),
            follower.slew_V_per_s * follower.period_s,
            follower.tolerance_um,
        )
    # a command that misses its target is what it is for other reasons, and is thought of anew at the next sample
    met = abs(found.reading_um - target_um) <= follower.tolerance_um
    at_um = _reading(follower, begin)
    way, aside_V, drifted_V = memory.way, memory.aside_V, 0.0
    still = wanted_um == shaped.position_um == memory.shaped.position_um
    if still and way != 0.0 and abs(target_um - at_um) <= _THERE * follower.tolerance_um:
        # at the edge of a play the slope between two trials tells nothing of what lies beyond it
        found = Inverted(found.voltage_V, found.reading_um, memory.slope_um_per_V)
        at = Inverted(found.voltage_V, at_um, memory.slope_um_per_V)
        inside, kept_V, beyond = _inside(follower, begin, at, way, memory.feedforward_V - aside_V, aside_V)
        if inside < math.inf:
            drifted_V = (inside - kept_V) - (memory.feedforward_V - memory.aside_V)
            found, met = Inverted(min(max(inside, within[0]), within[1]), at_um, beyond), True
            aside_V = kept_V
    else:
        way, slope = math.copysign(1.0, target_um - at_um), found.slope_um_per_V
        aside_V = -way * follower.margin_um / slope if slope > 0.0 else 0.0
    bounds = pid.limits_at(limits, memory.command_V, change_V, found.voltage_V)
    block, correction_V = memory.block, memory.command_V - memory.feedforward_V
    if measurement_um is not None:
        predicted_um = rest_um + (frames[0] - rest_um) / kept
        block, correction_V = pid.step(follower.gains, bounds, block, 0.0, measurement_um - predicted_um, dt_s)
    else:
        correction_V = min(max(correction_V, bounds.lower_V), bounds.upper_V)
    unfelt_V = _unfelt(follower, begin, found, block.integral_V - memory.block.integral_V) if met else 0.0
    twice_V = math.copysign(min(abs(unfelt_V), abs(drifted_V)), unfelt_V) if unfelt_V * drifted_V > 0.0 else 0.0
    command_V = min(max(found.voltage_V + correction_V - twice_V, limits.lower_V), limits.upper_V)
    block = PidState(block.integral_V - unfelt_V, block.derivative_V, block.previous_um)
    aside_V = way * min(way * (aside_V + unfelt_V - twice_V), 0.0)
    voltages_V = memory.feedforward_V, found.voltage_V + unfelt_V - twice_V
    slope = found.slope_um_per_V
    return Memory(ahead, behind, frames, shaped, *voltages_V, slope, block, command_V, True, rest_um, way, aside_V)


def _at_the_sample(
    follower: ModelFollower, memory: Memory, dt_s: float, acted_s: float | None
) -> tuple[object, object, tuple[float, ...]]:
    """Both models at this sample, and the predicted frames."""
    if not memory.begun:
        return memory.ahead, memory.behind, memory.frames
    planned_s = follower.command_delay_s
    ahead, behind, frame_um = _step_models(follower, memory, dt_s, planned_s if acted_s is None else acted_s)
    return ahead, behind, (*memory.frames[1:], frame_um)


def _at_the_command(follower: ModelFollower, ahead: object, present_V: float) -> object:
    """The state of the inverted model when the command of this sample is planned to act."""
    if follower.command_delay_s == 0.0:
        return ahead
    response(follower.inverted, ahead, present_V, (follower.command_delay_s,))
    return follower.inverted.save()


def _unfelt(follower: ModelFollower, begin: object, found: Inverted, change_V: float) -> float:
    """The part of a change of the command that the inverted model does not feel.

    From the middle of a play a change is lost up to the edge and felt beyond it. Taken as felt from the first volt on,
    changes that alternate in their sign, as noise makes them, would carry the model away from the edge on which the
    device stands: those towards the middle are unfelt and move it, those back would not.
    """
    limits = follower.limits
    change_V = min(max(change_V, limits.lower_V - found.voltage_V), limits.upper_V - found.voltage_V)
    expected_um = abs(found.slope_um_per_V * change_V)
    if expected_um == 0.0:
        return 0.0
    horizon = _horizon(follower)
    least_um = _UNFELT * min(expected_um, follower.tolerance_um)
    felt_um = abs(response(follower.inverted, begin, found.voltage_V + change_V, horizon) - found.reading_um)
    if felt_um <= least_um:
        return change_V
    if felt_um >= _FELT * expected_um:
        return 0.0
    lost, felt = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (lost + felt)
        reading_um = response(follower.inverted, begin, found.voltage_V + middle * change_V, horizon)
        if abs(reading_um - found.reading_um) <= least_um:
            lost = middle
        else:
            felt = middle
    return lost * change_V


def _inside(
    follower: ModelFollower, begin: object, at: Inverted, way: float, guess_V: float, aside_V: float
) -> tuple[float, float, float]:
    """The command so far aside of the one at which the inverted model would go on its way, how far, and that slope.

    It is inf where there is no play: where the model goes back as it went on.
    """
    if at.slope_um_per_V <= 0.0:
        return math.inf, 0.0, 0.0
    edge_V, slope = _edge(follower, begin, at, way, guess_V)
    if abs(edge_V) == math.inf:
        return math.inf, 0.0, 0.0
    back_V = edge_V - way * _THERE * follower.tolerance_um / slope
    back_um = response(follower.inverted, begin, back_V, _horizon(follower))
    if way * (at.reading_um - back_um) > follower.tolerance_um:
        return math.inf, 0.0, 0.0
    aside_V = _unfelt(follower, begin, Inverted(edge_V, at.reading_um, slope), aside_V)
    return edge_V + aside_V, aside_V, slope


def _edge(follower: ModelFollower, begin: object, at: Inverted, way: float, guess_V: float) -> tuple[float, float]:
    """The last command before the inverted model goes on its way, found from a guess, and the slope beyond it.

    It is inf where the model does not go on. The slope as last seen may be one of the inside of the play; with two
    trials beyond the edge that of the model is known.
    """
    slope, tolerance_um = at.slope_um_per_V, follower.tolerance_um
    last = max(way * follower.limits.lower_V, way * follower.limits.upper_V)
    stride = 2.0 * tolerance_um / slope
    low, high, to, edge = -math.inf, math.inf, way * guess_V + stride, math.inf
    before, before_um = math.inf, 0.0
    for _ in range(MOST_TRIALS):
        to = min(to, last)
        moved_um = way * (response(follower.inverted, begin, way * to, _horizon(follower)) - at.reading_um)
        if moved_um >= tolerance_um:
            slope = (moved_um - before_um) / (to - before) if (moved_um - before_um) * (to - before) > 0.0 else slope
            before, before_um = to, moved_um
        if tolerance_um <= moved_um <= 3.0 * tolerance_um:
            edge = to - moved_um / slope
            break
        if moved_um < tolerance_um and to == last:
            break
        low = max(low, to) if moved_um < tolerance_um else low
        high = to if moved_um > tolerance_um else high
        # out, twice as far each time; back by the slope, which is known beyond the edge and nothing on this side of it
        stride = 2.0 * stride
        middle = 0.5 * (low + high)
        back = to - (moved_um - 2.0 * tolerance_um) / slope if moved_um > tolerance_um else middle
        to = to + stride if high == math.inf else back if back > low else middle
    return way * edge, slope


def _reading(follower: ModelFollower, state: object) -> float:
    follower.inverted.restore(state)
    return follower.inverted.read()


def _horizon(follower: ModelFollower) -> tuple[float, ...]:
    period_s, lead_s = follower.period_s, follower.lead_s
    steps = (period_s,) * follower.horizon_ticks
    return (*steps, lead_s) if lead_s > 0.0 else steps


def _target(follower: ModelFollower, before: Shaped, reference_um: float, dt_s: float) -> tuple[Shaped, float]:
    """The shaped reference at this sample's end, and what the inverse shall meet at the end of its horizon."""
    if follower.shaper is None:
        return Shaped(reference_um), reference_um
    shaped = shape(follower.shaper, before, reference_um, min(dt_s, LONGEST_DT_S))
    at_end = shaped
    for _ in range(follower.horizon_ticks - 1):
        at_end = shape(follower.shaper, at_end, reference_um, follower.period_s)
    return shaped, at_end.position_um


def _step_models(follower: ModelFollower, memory: Memory, dt_s: float, acted_s: float) -> tuple[object, object, float]:
    """Both models at the next sample, and the frame that the sensor is predicted to show.

    A command that came later than the next sample was taken acts there.
    """
    parts = len(follower.frame_weights)
    plant, frame_um = follower.predictor, 0.0
    plant.restore(memory.behind)
    for part, weight in enumerate(follower.frame_weights):
        frame_um += weight * _step_with_change(plant, memory, dt_s / parts, acted_s - part * (dt_s / parts))
    behind = plant.save()
    if follower.inverted is plant:
        return behind, behind, frame_um
    follower.inverted.restore(memory.ahead)
    _step_with_change(follower.inverted, memory, dt_s, acted_s)
    return follower.inverted.save(), behind, frame_um


def _step_with_change(plant: SavablePlant, memory: Memory, step_s: float, acted_s: float) -> float:
    """What the plant reads a step later, in which the present feedforward takes over after `acted_s`."""
    if acted_s <= 0.0:
        return plant.step(memory.feedforward_V, step_s)
    if acted_s >= step_s:
        return plant.step(memory.standing_V, step_s)
    plant.step(memory.standing_V, acted_s)
    return plant.step(memory.feedforward_V, step_s - acted_s)
