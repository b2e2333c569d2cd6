"""The plant: a chain of blocks from the command to the reading, stepped from outside.

The command is held over a communication step. Each step is cut into sub-steps (`substeps`); over a sub-step every
signal is a parabola, which each block maps to a parabola. Where the output of a block has a corner inside the
sub-step, the sub-step is cut there and the blocks from this one on see the two parts one after the other.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from .blocks import BLOCKS, STAGES
from .model import Model
from .parabola import cut
from .substeps import lengths_s

_LONG_AGO_S = 1e9


class State(NamedTuple):
    """All that the plant remembers: the command in force, its age, and the state of every block in chain order."""

    voltage_V: float
    since_jump_s: float
    blocks: tuple[tuple[Any, ...], ...]


class _Link(NamedTuple):
    step: Callable[..., tuple[tuple[Any, ...], float, float, float]]
    constants: tuple[Any, ...]
    corner: Callable[..., float] | None


class Plant:
    """A model made ready to run. It holds no state: `step` takes one and returns the next."""

    __slots__ = ("_first_s", "_initial", "_links", "_longest_s", "_structure", "model")

    def __init__(self, model: Model) -> None:
        self.model = model
        chain = [(BLOCKS[settings.id], settings.parameters) for settings in model.blocks]
        constants = [block.constants(parameters, model.beam) for block, parameters in chain]
        self._links = tuple(
            _Link(block.step, numbers, block.corner) for (block, _), numbers in zip(chain, constants, strict=True)
        )
        self._initial = tuple(block.initial(numbers) for (block, _), numbers in zip(chain, constants, strict=True))
        structure = STAGES.index("structure")
        self._structure = sum(STAGES.index(block.stage) <= structure for block, _ in chain)
        self._first_s, self._longest_s = _sub_step_bounds_s(model)

    def initial(self) -> State:
        """Return the state at rest: no voltage, no displacement, for a long time."""
        return State(0.0, _LONG_AGO_S, self._initial)

    def step(self, state: State, voltage_V: float, time_s: float, step_s: float) -> tuple[State, float, float]:
        """Hold `voltage_V` from `time_s` for `step_s`.

        Returns:
            the state at the end, the displacement in um that the sensor reads there, and the tip in um.

        Raises:
            ValueError: the voltage or the step is not finite, or the step is not positive.
        """
        if not (math.isfinite(voltage_V) and 0.0 < step_s < math.inf):
            raise ValueError(f"found voltage {voltage_V!r} V held for {step_s!r} s, expected finite, the step > 0")
        elapsed = state.since_jump_s if voltage_V == state.voltage_V else 0.0
        states = list(state.blocks)
        reading = tip = 0.0
        time = time_s
        for length in lengths_s(elapsed, step_s, self._first_s, self._longest_s):
            reading, tip = self._advance(states, 0, time, length, voltage_V, voltage_V, voltage_V, tip)
            time += length
        return State(voltage_V, min(elapsed + step_s, _LONG_AGO_S), tuple(states)), reading, tip

    def _advance(
        self, states: list[tuple[Any, ...]], begin: int, time: float, h: float, u0: float, um: float, u1: float,
        tip: float,
    ) -> tuple[float, float]:  # fmt: skip
        links = self._links
        structure = self._structure
        for k in range(begin, len(links)):
            if k == structure:
                tip = u1
            step, constants, corner = links[k]
            if corner is not None:
                fraction = corner(states[k], constants, u0, um, u1)
                if fraction < 1.0:
                    left, middle, right, end = cut(u0, um, u1, fraction)
                    _, tip = self._advance(states, k, time, h * fraction, u0, left, middle, tip)
                    after = h * (1.0 - fraction)
                    return self._advance(states, k, time + h * fraction, after, middle, right, end, tip)
            states[k], u0, um, u1 = step(states[k], constants, time, h, u0, um, u1)
        if structure == len(links):
            tip = u1
        return u1, tip


def _sub_step_bounds_s(model: Model) -> tuple[float, float]:
    first = longest = math.inf
    ringing = math.inf
    for settings in model.blocks:
        block = BLOCKS[settings.id]
        if block.memory:
            longest = min(longest, ringing)
        after_jump, always = block.longest_step_s(settings.parameters, model.beam)
        first, longest = min(first, after_jump, always), min(longest, always)
        if block.ringing_step_s is not None:
            ringing = min(ringing, block.ringing_step_s(settings.parameters, model.beam))
    return min(first, longest), longest
