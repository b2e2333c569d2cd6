"""Models driven row by row without an end: what every block remembers is carried from one stretch of rows to the next.

The kernels are those of `simulation`, on the same sub-steps. Models that begin alike are computed together up to where
they part. Memory is that of the longest stretch that is given at once; in a long pause between two rows the device
stands at the last command.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from bender_compiled.interrupts import defer_signals
from bender_compiled.kernels import grid_run
from bender_compiled.simulation import Array, Bounds, Signal, Stage, advance, constants_of, initial_of, own_bounds
from bender_plant.blocks import Block
from bender_plant.model import Model, ModelError
from bender_plant.plant import AN_INSTANT_S, LONG_AGO_S, Plant, effective_settings

SUBSTEPS_PER_ROW = 16
"""That room is made for at first; where a stretch needs more, it is cut once more with room for them."""
LOOKED_AT_S = 10.0
"""After which it is looked whether a device that stands has come to rest, and again each time that has doubled."""
MOST_SUBSTEPS, MOST_PARTS = 5e4, 40
"""In which a device that stands is driven at once, and how often at most."""


Key = tuple[Any, ...]
State = dict[str, Any]


@dataclass(slots=True)
class _Feed:
    """The command behind the blocks in front of the plant, from the one in force at the last row on.

    Attributes:
        blocks: those blocks with their parameters.
        instants_s: (m,) from which commands act, the first one in force.
        voltage_V: (m,) commands.
        since_jump_s: since the command last jumped, at the last row.
    """

    blocks: tuple[tuple[Block, Any], ...]
    instants_s: Array
    voltage_V: Array
    since_jump_s: float = LONG_AGO_S

    def take(self, instants_s: Array, voltage_V: Array) -> None:
        """Add commands."""
        for block, parameters in self.blocks:
            assert block.commands is not None
            late_s, voltage_V = block.commands(parameters, voltage_V)
            instants_s = instants_s + late_s
        self.instants_s = np.concatenate([self.instants_s, instants_s])
        self.voltage_V = np.concatenate([self.voltage_V, voltage_V])

    def slopes_V_per_s(self, linear: bool) -> Array:
        """Return how fast the command runs from each instant on; 0 V from long ago stand."""
        slopes = np.zeros_like(self.voltage_V)
        if linear and slopes.size > 1:
            lengths = np.diff(self.instants_s)
            slopes[:-1] = np.where(lengths < 0.5 * LONG_AGO_S, np.diff(self.voltage_V) / lengths, 0.0)
        return slopes

    def forget_until(self, begin_s: float, end_s: float, linear: bool) -> None:
        """Let go of the commands before the one in force at `end_s`; the feed was at `begin_s` before."""
        in_force = int(np.searchsorted(self.instants_s, end_s + AN_INSTANT_S, side="right")) - 1
        jumps = np.flatnonzero(np.diff(self.voltage_V[: in_force + 1])) + 1
        if linear:
            jumps = jumps[np.diff(self.instants_s)[jumps - 1] > 0.5 * LONG_AGO_S]
        since = end_s - float(self.instants_s[jumps[-1]]) if jumps.size else self.since_jump_s + end_s - begin_s
        self.since_jump_s = min(since, LONG_AGO_S)
        self.instants_s, self.voltage_V = self.instants_s[in_force:], self.voltage_V[in_force:]


@dataclass(slots=True)
class _Node:
    """A block of the chains, which are a tree: models that begin alike share the blocks up to where they part.

    Attributes:
        before: place of the node before it; from -1 downwards the feeds, as `~before`.
        block, parameters: of it.
        model: the first one that has it.
        state: that is remembered; None for rest.
        known: constants and output at rest, where they were computed.
    """

    before: int
    block: Block
    parameters: Any
    model: Model
    state: Any = None
    known: tuple[tuple[Any, ...], float] | None = None

    def through(self, before: Stage) -> Stage:
        """Take what is known before the block through it."""
        after, self.state = advance(self.block, self.parameters, self.model, before, self.state, self.known)
        if self.known is None:
            self.known = constants_of(self.block, self.parameters, self.model), after.signal.initial
        return after


@dataclass(slots=True)
class Stream:
    """Models under one command.

    Attributes:
        models: at least one.
        linear: the command runs straight from each row to the next instead of being held.
        coarser: makes sub-steps longer by this factor, where nanometres do not count.
        bounds: of the sub-steps, the finest that one of the models needs.

    Raises:
        ModelError: a block in front of the plant is none that can be followed without an end.
    """

    models: tuple[Model, ...]
    linear: bool = False
    coarser: float = 1.0
    bounds: Bounds = field(init=False)
    _nodes: list[_Node] = field(default_factory=list[_Node], init=False)
    _feeds: list[_Feed] = field(default_factory=list[_Feed], init=False)
    _ends: list[int] = field(default_factory=list[int], init=False)
    _plants: list[Plant] = field(default_factory=list[Plant], init=False)
    _time_s: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.bounds = _finest([own_bounds(x, self.coarser) for x in self.models])
        places: dict[Key, int] = {}
        for model in self.models:
            commands, acting = _split_blocks(model)
            key: Key = tuple((block.id, parameters) for block, parameters in commands)
            if key not in places:
                places[key] = ~len(self._feeds)
                self._feeds.append(_Feed(commands, np.array([-LONG_AGO_S]), np.zeros(1)))
            place = places[key]
            key = (model.beam, key)
            for block, parameters in acting:
                key += ((block.id, parameters),)
                if key not in places:
                    places[key] = len(self._nodes)
                    self._nodes.append(_Node(place, block, parameters, model))
                place = places[key]
            self._ends.append(place)

    def begin(self, time_s: float | None = None, voltage_V: float = 0.0) -> None:
        """Go back to rest under 0 V.

        Args:
            time_s: from which `voltage_V` acts before the first row; None for nothing before it.
            voltage_V: that a device in motion has been standing at before the first row.
        """
        self._feeds = [_Feed(x.blocks, np.array([-LONG_AGO_S]), np.zeros(1)) for x in self._feeds]
        for node in self._nodes:
            node.state = None
        self._time_s = None
        if time_s is not None:
            self.advance(np.array([time_s]), np.array([voltage_V]))

    def stand(self, time_s: float, voltage_V: float, until_s: float) -> None:
        """Go back to rest under 0 V, and stand at a voltage from one time up to the first row at another."""
        self.begin(time_s, voltage_V)
        self._stand_still(until_s)

    def _stand_still(self, until_s: float) -> None:
        """Stand at the command in force until shortly before a row.

        What no longer moves, and what has stood for so many sub-steps, is not driven: the clock is moved on.
        """
        assert self._time_s is not None
        begin_s, states, stood_s = self._time_s, self._states(), LOOKED_AT_S
        most_s = self._most_at_once_s
        last_s = until_s - min(LOOKED_AT_S, most_s)
        if last_s <= begin_s:
            return
        end_s = min(last_s, begin_s + MOST_PARTS * most_s)
        while self._time_s < end_s:
            self._read(np.array([min(begin_s + stood_s, self._time_s + most_s, end_s)]))
            stood_s = max(stood_s, 2.0 * (self._time_s - begin_s))
            before, states = states, self._states()
            if not self._commands_wait and all(np.array_equal(x, y) for x, y in zip(before, states, strict=True)):
                break
        for feed in self._feeds:
            feed.forget_until(self._time_s, last_s, self.linear)
            if self.linear:
                feed.instants_s[0] = last_s
        self._time_s = last_s

    @property
    def _most_at_once_s(self) -> float:
        return MOST_SUBSTEPS * self.bounds.longest_s

    @property
    def _commands_wait(self) -> bool:
        return any(x.instants_s[-1] > self._time_s for x in self._feeds)

    def _states(self) -> list[Array]:
        return [np.zeros(0) if x.state is None else np.array(x.state, dtype=float) for x in self._nodes]

    def advance(self, time_s: Array, voltage_V: Array, command_time_s: Array | None = None) -> Array:
        """Take further rows.

        Args:
            time_s: (n,) of the readings, increasing, behind the last one.
            voltage_V: (n,) commands, each from its row on.
            command_time_s: (n,) from when they act; None for `time_s`.

        Returns:
            (models, n) readings in um.

        Raises:
            ArithmeticError: a model ran away.
        """
        acting_s = time_s if command_time_s is None else command_time_s
        before_s = float(time_s[0]) if self._time_s is None else self._time_s
        pauses = np.flatnonzero(np.diff(time_s, prepend=before_s) > 2.0 * self._most_at_once_s).tolist()
        begin, readings = 0, np.empty((len(self.models), time_s.size))
        for end in [*pauses, time_s.size]:
            part = slice(begin, end)
            if begin < end:
                for feed in self._feeds:
                    feed.take(acting_s[part], voltage_V[part])
                readings[:, part] = self._read(time_s[part])
            if end < time_s.size:
                self._stand_still(float(time_s[end]))
            begin = end
        return readings

    def _read(self, time_s: Array) -> Array:
        """Return the readings (models, n) at further instants under the commands that were taken."""
        readings = np.empty((len(self.models), time_s.size))
        first = self._time_s is None
        begin_s = float(time_s[0]) if self._time_s is None else self._time_s
        rows_s = time_s if first else np.concatenate([[begin_s], time_s])
        with defer_signals():
            if first:
                self._plants = self._plants or [Plant(x) for x in self.models]
                readings[:, 0] = [x.at_rest(begin_s)[0] for x in self._plants]
            if rows_s.size > 1:
                readings[:, int(first) :] = self._through(rows_s)
        for feed in self._feeds:
            feed.forget_until(begin_s, float(time_s[-1]), self.linear)
        self._time_s = float(time_s[-1])
        if not np.all(np.isfinite(readings)):
            raise ArithmeticError(f"the model ran away at or after {begin_s:g} s: its readings are not finite")
        return readings

    def _through(self, rows_s: Array) -> Array:
        fed = [Stage(self._grid(x, rows_s)) for x in self._feeds]
        stages: list[Stage] = []
        for node in self._nodes:
            stages.append(node.through(stages[node.before] if node.before >= 0 else fed[~node.before]))
        ends = (stages[x] if x >= 0 else fed[~x] for x in self._ends)
        return np.array([x.signal.at_rows() for x in ends])

    def _grid(self, feed: _Feed, rows_s: Array) -> Signal:
        bounds, slopes = self.bounds, feed.slopes_V_per_s(self.linear)
        capacity = SUBSTEPS_PER_ROW * rows_s.size
        while True:
            n, t, h, u0, u1, last = grid_run()(
                rows_s, feed.instants_s, feed.voltage_V, slopes, feed.since_jump_s, bounds.first_s, bounds.longest_s,
                bounds.growth, 0.0, math.inf, 0.0, capacity,
            )  # fmt: skip
            if n >= 0:
                t, h, u0, u1 = t[:n].copy(), h[:n].copy(), u0[:n].copy(), u1[:n].copy()
                return Signal(t, h, u0, 0.5 * (u0 + u1), u1, last[1:], 0.0)
            capacity *= 4

    def state(self) -> State:
        """Return all that is remembered, as JSON can hold it."""
        feeds = [[x.instants_s.tolist(), x.voltage_V.tolist(), x.since_jump_s] for x in self._feeds]
        states = [None if x.state is None else list(x.state) for x in self._nodes]
        return {"time_s": self._time_s, "feeds": feeds, "states": states}

    def restore(self, state: State) -> None:
        """Go on from where `state` was taken of a stream of the same models.

        Raises:
            ValueError: it is of other models.
        """
        if len(self._nodes) != len(state["states"]) or len(self._feeds) != len(state["feeds"]):
            raise ValueError("found the state of other models")
        self._time_s = state["time_s"]
        for feed, (instants_s, voltage_V, since_s) in zip(self._feeds, state["feeds"], strict=True):
            feed.instants_s, feed.voltage_V, feed.since_jump_s = np.array(instants_s), np.array(voltage_V), since_s
        for node, values in zip(self._nodes, state["states"], strict=True):
            node.state = None if values is None else _like(node, values)


def _like(node: _Node, values: Sequence[Any]) -> Any:
    """Return a state of a block as its compiled run takes it, from its numbers."""
    if node.block.state_of_any_length:
        return np.array(values, dtype=float)
    initial = initial_of(node.block, constants_of(node.block, node.parameters, node.model))
    return tuple(type(x)(y) for x, y in zip(initial, values, strict=True))


def _split_blocks(model: Model) -> tuple[tuple[tuple[Block, Any], ...], list[tuple[Block, Any]]]:
    """Return the blocks in front of the plant, and those that act on the signal of the chain."""
    chain = effective_settings(model)
    commands = tuple(x for x in chain if x[0].command)
    for block, _ in commands:
        if block.commands is None:
            raise ModelError(f"{block.id}: cannot be followed without an end, expected a model without it")
    return commands, [x for x in chain if not (x[0].command or x[0].modify)]


def _finest(bounds: Sequence[Bounds]) -> Bounds:
    least = {x.name: min(getattr(y, x.name) for y in bounds) for x in fields(Bounds) if x.name != "eased"}
    return Bounds(**least, eased=False)
