"""The plant: a chain of blocks from the command to the reading, stepped from outside.

The command is held over a communication step. Each step is cut into sub-steps (`substeps`); over a sub-step every
signal is a parabola, which each block maps to a parabola. Where the output of a block has a corner inside the
sub-step, the sub-step is cut there and the blocks from this one on see the two parts one after the other. Two signals
run beside the chain for the blocks that ask for them: the voltage that enters the transducer, and the quasi-static
displacement that enters the structure.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from bender_plant.blocks import BLOCKS, STAGES, Block
from bender_plant.model import Model
from bender_plant.parabola import cut
from bender_plant.substeps import GROWTH, lengths_s

LONG_AGO_S = 1e9
AN_INSTANT_S = 1e-9
MOST_SUB_STEPS = 1e6
"""Of one communication step where the command rests: seconds of computing, and no host waits without end."""

_Parabola = tuple[float, float, float]
_NOTHING = (0.0, 0.0, 0.0)


class State(NamedTuple):
    """All that the plant remembers: the command in force, its age, and the state of every block in chain order."""

    voltage_V: float
    since_jump_s: float
    blocks: tuple[tuple[Any, ...], ...]


class _Link(NamedTuple):
    place: int
    slot: int
    step: Callable[..., tuple[tuple[Any, ...], float, float, float]]
    constants: tuple[Any, ...]
    corner: Callable[..., float] | None
    beside: int
    enters: tuple[bool, ...]


class _Command(NamedTuple):
    slot: int
    command: Callable[..., tuple[tuple[Any, ...], list[tuple[float, float]]]]
    constants: tuple[Any, ...]


_PLAIN, _BESIDE_VOLTAGE, _BESIDE_QUASI_STATIC = 0, 1, 2


class Plant:
    """A model made ready to run. It holds no state: `step` takes one and returns the next."""

    __slots__ = ("_commands", "_first_s", "_initial", "_links_from", "_longest_s", "_tip_last", "model")

    def __init__(self, model: Model) -> None:
        self.model = model
        chain = effective_settings(model)
        numbers = [block.constants(parameters, model.beam) for block, parameters in chain]
        self._initial = tuple(block.initial(x) for (block, _), x in zip(chain, numbers, strict=True))
        self._commands = tuple(
            _Command(k, block.command, numbers[k]) for k, (block, _) in enumerate(chain) if block.command
        )
        acting = [(k, block) for k, (block, _) in enumerate(chain) if block.step]
        kinds = {None: _PLAIN, "voltage": _BESIDE_VOLTAGE, "quasi_static": _BESIDE_QUASI_STATIC}
        stages = [STAGES.index(block.stage) for _, block in acting]
        transducer = next(n for n, (_, block) in enumerate(acting) if block.transducer)
        structure = sum(stage < STAGES.index("structure") for stage in stages)
        surroundings = sum(stage <= STAGES.index("structure") for stage in stages)
        self._tip_last = surroundings == len(acting)
        places = [(place == transducer, place == structure, place == surroundings) for place in range(len(acting))]
        links = tuple(
            _Link(place, k, block.step, numbers[k], block.corner, kinds[block.beside], first if any(first) else ())
            for (place, (k, block)), first in zip(enumerate(acting), places, strict=True)
            if block.step
        )
        self._links_from = tuple(links[place:] for place in range(len(links)))
        self._first_s, self._longest_s = sub_step_bounds_s(model)

    def initial(self) -> State:
        """Return the state at rest: no voltage, no displacement, for a long time."""
        return State(0.0, LONG_AGO_S, self._initial)

    def at_rest(self, time_s: float) -> tuple[float, float]:
        """Return the displacement in um that the sensor reads at rest, and the tip in um."""
        _, reading, tip = self.step(self.initial(), 0.0, time_s, AN_INSTANT_S)
        return reading, tip

    def step(self, state: State, voltage_V: float, time_s: float, step_s: float) -> tuple[State, float, float]:
        """Hold `voltage_V` from `time_s` for `step_s`.

        Returns:
            the state at the end, the displacement in um that the sensor reads there, and the tip in um.

        Raises:
            ValueError: the voltage or the step is not finite, the step is not positive, or it takes more than
                `MOST_SUB_STEPS` sub-steps.
            ArithmeticError: the state grew beyond all numbers (a softening spring under too large a load).
        """
        after, reading, tip, _ = self.held(state, voltage_V, time_s, step_s)
        return after, reading, tip

    def held(self, state: State, voltage_V: float, time_s: float, step_s: float) -> tuple[State, float, float, float]:
        """Do as `step`, and return the mean of the reading over the step in um as well.

        Raises:
            ValueError, ArithmeticError: as `step`.
        """
        if not (math.isfinite(voltage_V) and 0.0 < step_s < math.inf):
            raise ValueError(f"found voltage {voltage_V!r} V held for {step_s!r} s, expected finite, the step > 0")
        self._refuse_long(step_s)
        states = list(state.blocks)
        pieces = [(step_s, voltage_V)]
        for slot, command, constants in self._commands:
            before, pieces = pieces, []
            for length, voltage in before:
                states[slot], parts = command(states[slot], constants, voltage, length)
                pieces += parts
        in_force, elapsed = state.voltage_V, state.since_jump_s
        reading = tip = area = 0.0
        time = time_s
        for piece_s, voltage in pieces:
            if voltage != in_force:
                in_force, elapsed = voltage, 0.0
            for length in lengths_s(elapsed, piece_s, self._first_s, self._longest_s, GROWTH):
                held = (voltage, voltage, voltage)
                reading, tip, part = self._advance(states, 0, time, length, held, _NOTHING, _NOTHING, 0.0)
                area += part
                time += length
            elapsed = min(elapsed + piece_s, LONG_AGO_S)
        self._refuse_unreal(reading, tip, time_s + step_s)
        return State(in_force, elapsed, tuple(states)), reading, tip, area / step_s

    def along(self, state: State, value: float, time_s: float, step_s: float) -> tuple[State, float, float]:
        """Run straight from the value in force to `value` from `time_s` for `step_s`; blocks of the command rest.

        Returns:
            the state at the end, the displacement in um that the sensor reads there, and the tip in um.

        Raises:
            ValueError, ArithmeticError: as `step`.
        """
        if not (math.isfinite(value) and 0.0 < step_s < math.inf):
            raise ValueError(f"found the value {value!r} after {step_s!r} s, expected finite, the step > 0")
        self._refuse_long(step_s)
        states = list(state.blocks)
        slope = (value - state.voltage_V) / step_s
        reading = tip = begun = 0.0
        for length in lengths_s(LONG_AGO_S, step_s, self._first_s, self._longest_s, GROWTH):
            first = state.voltage_V + slope * begun
            run = (first, first + 0.5 * slope * length, first + slope * length)
            reading, tip, _ = self._advance(states, 0, time_s + begun, length, run, _NOTHING, _NOTHING, 0.0)
            begun += length
        self._refuse_unreal(reading, tip, time_s + step_s)
        return State(value, LONG_AGO_S, tuple(states)), reading, tip

    def _refuse_long(self, step_s: float) -> None:
        if step_s > MOST_SUB_STEPS * self._longest_s:
            raise ValueError(f"found a step of {step_s!r} s, expected at most {MOST_SUB_STEPS * self._longest_s!r} s")

    def _refuse_unreal(self, reading: float, tip: float, time_s: float) -> None:
        if not (math.isfinite(reading) and math.isfinite(tip)):
            raise ArithmeticError(f"the plant ran away at {time_s:g} s (reading {reading!r} µm, tip {tip!r} µm)")

    def _advance(
        self, states: list[tuple[Any, ...]], begin: int, time: float, h: float, signal: _Parabola,
        voltage: _Parabola, quasi_static: _Parabola, tip: float,
    ) -> tuple[float, float, float]:  # fmt: skip
        """Take one sub-step through the chain from link `begin` on.

        Returns:
            the reading and the tip at its end, and the reading times the time over it.
        """
        u0, um, u1 = signal
        for place, slot, step, constants, corner, beside, enters in self._links_from[begin]:
            if enters:
                transducer, structure, surroundings = enters
                if transducer:
                    voltage = (u0, um, u1)
                if structure:
                    quasi_static = (u0, um, u1)
                if surroundings:
                    tip = u1
            # written out for each number of arguments: unpacking them into a call takes as long as a short block
            v0, vm, v1 = voltage if beside == _BESIDE_VOLTAGE else quasi_static
            state = states[slot]
            if corner is not None:
                fraction = (
                    corner(state, constants, h, u0, um, u1, v0, vm, v1)
                    if beside
                    else corner(state, constants, h, u0, um, u1)
                )
                if fraction < 1.0:
                    here, after = _halves((u0, um, u1), fraction)
                    v_here, v_after = _halves(voltage, fraction)
                    w_here, w_after = _halves(quasi_static, fraction)
                    first = h * fraction
                    _, tip, area = self._advance(states, place, time, first, here, v_here, w_here, tip)
                    end, tip, more = self._advance(states, place, time + first, h - first, after, v_after, w_after, tip)
                    return end, tip, area + more
            states[slot], u0, um, u1 = (
                step(state, constants, time, h, u0, um, u1, v0, vm, v1)
                if beside
                else step(state, constants, time, h, u0, um, u1)
            )
        if self._tip_last:
            tip = u1
        return u1, tip, h * (u0 + 4.0 * um + u1) / 6.0


def _halves(parabola: _Parabola, fraction: float) -> tuple[_Parabola, _Parabola]:
    left, middle, right, end = cut(*parabola, fraction)
    return (parabola[0], left, middle), (middle, right, end)


def effective_settings(model: Model) -> list[tuple[Block, Any]]:
    """Return the blocks of a model in chain order with the parameters in force, modifiers applied to the modes."""
    modified = {settings.id: settings.parameters for settings in model.blocks}
    for settings in model.blocks:
        modify = BLOCKS[settings.id].modify
        if modify is not None:
            modified["bending_modes"] = modify(settings.parameters, modified["bending_modes"])
    return [(BLOCKS[block_id], parameters) for block_id, parameters in modified.items()]


def sub_step_bounds_s(model: Model) -> tuple[float, float]:
    """Return the longest sub-step right after a jump of the command, and at any time."""
    first = longest = ringing = math.inf
    for block, parameters in effective_settings(model):
        if block.memory:
            longest = min(longest, ringing)
        after_jump, always = block.longest_step_s(parameters, model.beam)
        first, longest = min(first, after_jump, always), min(longest, always)
        if block.beside != "quasi_static":
            ringing = min(ringing, block.ringing_step_s(parameters, model.beam))
    return min(first, longest), longest


def longest_step_s(model: Model) -> float:
    """Return the longest step that the plant of a model takes at once."""
    return MOST_SUB_STEPS * sub_step_bounds_s(model)[1]
