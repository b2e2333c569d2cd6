"""Whole records through the compiled chain, equal to the FMU to 1e-9 m.

A signal is a run of sub-steps, on each of which it is a parabola. Blocks act one after the other on the whole signal;
what was computed for the first blocks of a chain is kept, so a fit that varies one block pays for it and what follows.
"""

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_compiled.interrupts import defer_signals
from bender_compiled.kernels import block_run, cut_run, grid_run, uncut_run
from bender_compiled.linear_modes import linear_modes_run, spring_alone
from bender_loop.records.between_rows import Exposed, course, exposed, followed
from bender_plant.blocks import STAGES, Block
from bender_plant.model import Model, ModelError
from bender_plant.plant import AN_INSTANT_S, LONG_AGO_S, effective_settings, sub_step_bounds_s
from bender_plant.substeps import GROWTH

Array = NDArray[np.float64]

RUN_SUBSTEPS = 5_000
"""What a run costs beside its sub-steps, in sub-steps: a millisecond of Python against 0.2 us each."""
LEVELS = 4
"""Of the coarse sub-steps' bounds, to a factor of two."""
SETTLED = 5_000
"""Coarse sub-steps of a command that stands, after which modes have come to rest: hundreds of periods."""
PARABOLAS_PER_ROW = 3
"""Where sub-steps may be coarser, a smooth voltage is followed in parabolas: nearer than in eight straight pieces."""
MOST_KEPT = 500
"""Beginnings of chains that are kept, however short."""


@dataclass(frozen=True, slots=True)
class Drive:
    """What a plant is driven with.

    Attributes:
        row_time_s: (n,) instants of the readings, increasing; row 0 is read at rest where no command acts before it.
        command_time_s: (m,) instants from which the commands act, increasing.
        voltage_V: (m,) commands.
        linear: run straight from each command to the next instead of holding it.
        smooth: be band-limited between the commands; `linear` holds too.
        exposure_s: a reading is the mean over this time around its instant; 0 for a snapshot.
    """

    row_time_s: Array
    command_time_s: Array
    voltage_V: Array
    linear: bool = False
    smooth: bool = False
    exposure_s: float = 0.0

    @classmethod
    def of_rows(
        cls, time_s: Array, voltage_V: Array, command_time_s: Array | None = None, linear: bool = False
    ) -> "Drive":
        """Return the drive of a record: row k is read before command k acts."""
        return cls(time_s, time_s if command_time_s is None else command_time_s, voltage_V, linear)

    def path(self, voltage_V: Array) -> tuple[Array, Array]:
        """Return instants and voltages of commands, (m,) or, where they run smoothly, more of them."""
        return followed(self.command_time_s, voltage_V) if self.smooth else (self.command_time_s, voltage_V)


@dataclass(frozen=True, slots=True)
class Bounds:
    """Longest sub-steps: right after a jump of the command, and at any time; how they grow with its age.

    `eased`: small jumps allow longer ones. What rings sums up what the parabolas miss, so nothing may ring then.
    `lasting_s`: longest where a command stands that has let the modes come to rest.
    """

    first_s: float
    longest_s: float
    growth: float = GROWTH
    eased: bool = False
    lasting_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Signal:
    """A run of parabolas: begin, length, values at start, middle and end, and the sub-step that ends at each row."""

    t: Array
    h: Array
    y0: Array
    ym: Array
    y1: Array
    last: NDArray[np.int64]
    initial: float

    def at_rows(self) -> Array:
        """Return the values at the rows."""
        values = self.y1[self.last]
        values[: np.searchsorted(self.last, 0)] = self.initial
        return values


@dataclass(frozen=True, slots=True)
class Response:
    """What a simulation gives at the rows: the reading and the true tip, in um."""

    reading_um: Array
    tip_um: Array


@dataclass(frozen=True, slots=True)
class _Commanded:
    """What acts on the plant: instants and voltages (m,), and how the voltage runs between the first and the last."""

    instants_s: Array
    voltage_V: Array
    course: Callable[[Array], Array] | None = None


@dataclass(slots=True)
class Stage:
    """What is known behind a part of the chain: the signal there, and those that later blocks ask for beside it."""

    signal: Signal
    voltage: Signal | None = None
    quasi_static: Signal | None = None
    tip_um: Array | None = None


@dataclass(slots=True)
class Simulator:
    """Simulates models under one drive and keeps the beginnings of the chains that it has computed.

    `bounds` replaces the sub-steps of each model by common ones, so that their beginnings can be shared. `coarser`
    makes the sub-steps of each model longer by this factor: for a search, where nanometres do not count. `simulated`
    counts the sub-steps of all runs so far, whatever of them was kept, and what a run costs beside them: a measure of
    work that no clock has a part in. A model that would need more than `most_substeps` in one run is refused.
    """

    drive: Drive
    bounds: Bounds | None = None
    coarser: float = 1.0
    keep_substeps: int = 3_000_000
    most_substeps: float = math.inf
    _kept: OrderedDict[Any, Stage] = field(default_factory=OrderedDict)
    _substeps: int = 0
    _courses: dict[bytes, Callable[[Array], Array]] = field(default_factory=dict)
    simulated: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)
    _read: Exposed = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._read = exposed(self.drive.row_time_s, self.drive.exposure_s)

    def __reduce__(self) -> tuple[Any, ...]:
        """Leave what is kept behind when pickled: a later run computes it again."""
        return Simulator, (self.drive, self.bounds, self.coarser, self.keep_substeps, self.most_substeps)

    def run(self, model: Model) -> Response:
        """Simulate a model from rest.

        Raises:
            ArithmeticError: the model ran away.
            ModelError: a block cannot act on commands that are not held, or the model needs too many sub-steps.
        """
        with defer_signals():
            return self._run(model)

    def _run(self, model: Model) -> Response:
        chain = effective_settings(model)
        bounds = self.bounds or own_bounds(model, self.coarser)
        key: tuple[Any, ...] = (bounds, model.beam)
        stage: Stage | None = None
        acting: list[tuple[Block, Any]] = []
        commands: list[tuple[Block, Any]] = []
        for block, parameters in chain:
            (commands if block.command else acting).append((block, parameters))
        key += tuple((block.id, parameters) for block, parameters in commands)
        stage = self._recall(key, lambda: Stage(self._grid(self._commanded(commands, model), bounds)))
        for block, parameters in acting:
            if block.modify:
                continue  # `effective_settings` has put it into the bending modes
            key += ((block.id, parameters),)
            before = stage
            stage = self._recall(key, lambda b=block, p=parameters, s=before: advance(b, p, model, s)[0])
        reading = self._read.readings(stage.signal.at_rows())
        tip = reading if stage.tip_um is None else self._read.readings(stage.tip_um)
        with self._lock:
            self.simulated += stage.signal.h.size + RUN_SUBSTEPS
        if not np.all(np.isfinite(reading)):
            raise ArithmeticError("the plant ran away: the readings are not finite")
        return Response(reading, tip)

    def forget(self) -> None:
        """Let go of the beginnings of chains that are kept; a later run computes them again."""
        with self._lock:
            self._kept.clear()
            self._substeps = 0

    def _recall(self, key: Any, make: Callable[[], Stage]) -> Stage:
        with self._lock:
            stage = self._kept.get(key)
            if stage is not None:
                self._kept.move_to_end(key)
                return stage
        # two threads may make the same stage at once: they are equal, and the first one that is done is kept
        made = make()
        with self._lock:
            stage = self._kept.setdefault(key, made)
            self._substeps += stage.signal.h.size if stage is made else 0
            while len(self._kept) > 1 and (self._substeps > self.keep_substeps or len(self._kept) > MOST_KEPT):
                _, oldest = self._kept.popitem(last=False)
                self._substeps -= oldest.signal.h.size
        return stage

    def _commanded(self, commands: Sequence[tuple[Block, Any]], model: Model) -> _Commanded:
        """Return the command that reaches the plant: what the blocks in front of it make of the drive's.

        Raises:
            ModelError: one that is no rule from voltage to voltage acts on commands that are not held.
        """
        drive, late_s = self.drive, 0.0
        instants, values = drive.command_time_s, drive.voltage_V
        for block, parameters in commands:
            if block.commands is not None:
                later_s, values = block.commands(parameters, values)
                late_s += later_s
            else:
                end_s = float(self._read.instants_s[-1])
                found = _behind(block, block.constants(parameters, model.beam), instants, values, end_s)
                if drive.linear and not np.array_equal(found[0], instants):
                    raise ModelError(f"{block.id}: acts on held commands only, found one that runs between its rows")
                instants, values = found
        if not drive.smooth:
            return _Commanded(instants + late_s, values)
        if self.coarser == 1.0:
            instants, values = followed(instants, values)
            return _Commanded(instants + late_s, values)
        smooth = self._course(instants, values)
        places = np.arange((instants.size - 1) * PARABOLAS_PER_ROW + 1) / PARABOLAS_PER_ROW
        dense = np.interp(places, np.arange(instants.size), instants)
        return _Commanded(dense + late_s, smooth(dense), lambda time_s: smooth(time_s - late_s))

    def _course(self, instants: Array, values: Array) -> Callable[[Array], Array]:
        """Return the course of a smooth voltage; the last one is kept."""
        key = values.tobytes()
        known = self._courses.get(key)
        if known is None:
            known = course(instants, values)
            self._courses = {key: known}
        return known

    def _grid(self, commanded: _Commanded, bounds: Bounds) -> Signal:
        drive, instants, values = self.drive, commanded.instants_s, commanded.voltage_V
        slopes = np.zeros_like(values)
        if drive.linear:
            slopes[:-1] = np.diff(values) / np.diff(instants)
        read_s = self._read.instants_s
        leads = instants[0] < read_s[0]
        rows = np.concatenate([instants[:1], read_s]) if leads else read_s
        # 0 V from long ago stands before the first command
        instants = np.concatenate([[rows[0] - LONG_AGO_S], instants])
        values = np.concatenate([[0.0], values])
        slopes = np.concatenate([[0.0], slopes])
        capacity = 32 * rows.size
        span = float(np.ptp(values)) if bounds.eased else 0.0
        settled_s = SETTLED * bounds.longest_s if bounds.lasting_s > bounds.longest_s else math.inf
        while True:
            n, t, h, u0, u1, last = grid_run()(
                rows,
                instants,
                values,
                slopes,
                LONG_AGO_S,
                bounds.first_s,
                bounds.longest_s,
                bounds.growth,
                span,
                settled_s,
                bounds.lasting_s,
                capacity,
            )
            if n >= 0:
                u0 = u0[:n].copy()
                if not (drive.linear or drive.smooth):  # held: one array of a long record is enough
                    return Signal(t[:n].copy(), h[:n].copy(), u0, u0, u0, last[int(leads) :], 0.0)
                t, h, u1 = t[:n].copy(), h[:n].copy(), u1[:n].copy()
                um = 0.5 * (u0 + u1)
                if commanded.course is not None:
                    along = (t >= instants[1] - AN_INSTANT_S) & (t + h <= instants[-1] + AN_INSTANT_S)
                    u0[along], um[along], u1[along] = (
                        commanded.course(t[along] + x * h[along]) for x in (0.0, 0.5, 1.0)
                    )
                return Signal(t, h, u0, um, u1, last[int(leads) :], 0.0)
            if capacity >= self.most_substeps:
                raise ModelError(
                    f"the model needs more than {capacity:.3g} sub-steps of {bounds.first_s:.2g} s and more"
                )
            capacity *= 4


def own_bounds(model: Model, coarser: float = 1.0) -> Bounds:
    """Return the sub-steps that a model needs, or those that are longer by a factor."""
    first, longest = sub_step_bounds_s(model)
    if coarser == 1.0:
        return Bounds(first, longest)
    chain = effective_settings(model)
    eased = all(math.isinf(b.ringing_step_s(p, model.beam)) for b, p in chain)
    # an equation that is integrated step by step has its bound also where nothing moves
    always = (b.longest_step_s(p, model.beam)[1] for b, p in chain if b.id != "bending_modes")
    lasting = coarser * min(always, default=math.inf)
    levels = (_level(coarser * first), _level(coarser * longest))
    return Bounds(*levels, coarser * GROWTH, eased, _level(lasting))


def _level(longest_s: float) -> float:
    """Return the next shorter of few lengths: a time constant that a fit moves a little moves no sub-step then."""
    return 2.0 ** (math.floor(LEVELS * math.log2(longest_s)) / LEVELS) if math.isfinite(longest_s) else longest_s


def _behind(
    block: Block, constants: tuple[Any, ...], instants: Array, values: Array, end_s: float
) -> tuple[Array, Array]:
    """Return instants and voltages (m,) of held commands behind a block, by its own kernel."""
    assert block.command is not None
    state, times, volts = block.initial(constants), [], []
    lengths = np.diff(instants, append=max(end_s, float(instants[-1]) + AN_INSTANT_S))
    for instant, value, length in zip(instants.tolist(), values.tolist(), lengths.tolist(), strict=True):
        state, pieces = block.command(state, constants, value, length)
        for piece_s, voltage in pieces:
            times.append(instant)
            volts.append(voltage)
            instant += piece_s
    return np.array(times), np.array(volts)


def constants_of(block: Block, parameters: Any, model: Model) -> tuple[Any, ...]:
    """Return the constants of a block as its compiled run takes them: lists of numbers as arrays."""
    numbers = block.constants(parameters, model.beam)
    if block.id == "bending_modes":
        return numbers
    return tuple(np.array(x, dtype=float) if isinstance(x, tuple) else x for x in numbers)


def initial_of(block: Block, constants: tuple[Any, ...]) -> Any:
    """Return the state of a block at rest as its compiled run takes it."""
    state = block.initial(constants)
    return np.array(state, dtype=float) if block.state_of_any_length else state


def _at_rest(block: Block, parameters: Any, model: Model, stage: Stage, time_s: float) -> float:
    """Return the block's output at rest, the reading before anything has moved."""
    if block.step is None:
        return stage.signal.initial
    constants = block.constants(parameters, model.beam)
    still = (stage.signal.initial,) * 3
    other = () if block.beside is None else (_beside(block, stage).initial,) * 3
    return block.step(block.initial(constants), constants, time_s, AN_INSTANT_S, *still, *other)[3]


def has_linear_modes(block: Block, constants: tuple[Any, ...]) -> bool:
    """Return whether a block is one of modes without loads but a spring, which have a compiled run of their own."""
    return block.id == "bending_modes" and spring_alone(constants) is not None


def uncut_values(
    block: Block, constants: tuple[Any, ...], arguments: tuple[Array, ...], state: Any = None
) -> tuple[Array, Array, Array, Any]:
    """Return the values (n,) that a block without corners gives at the start, middle and end of every sub-step.

    Args:
        block: the block.
        constants: its own, as `constants_of` returns them.
        arguments: (t, h, u0, um, u1, x0, xm, x1), each (n,), as `kernels.uncut_run` takes them.
        state: of the block at the beginning; None for rest.

    Returns:
        The values, and the state of the block at the end.
    """
    state = initial_of(block, constants) if state is None else state
    spring = spring_alone(constants) if block.id == "bending_modes" else None
    if spring is not None:
        return linear_modes_run()(state, tuple(mode[:3] for mode in constants), spring, *arguments[1:5])
    return uncut_run(block.id)(state, constants, *arguments)


def _beside(block: Block, stage: Stage) -> Signal:
    signal = stage.voltage if block.beside == "voltage" else stage.quasi_static
    return signal if signal is not None else stage.signal


def _cut_like(signal: Signal, parent: NDArray[np.int64], start: Array, stop: Array, like: Signal) -> Signal:
    """Return a signal on the sub-steps that another one was cut into."""
    values = cut_run()(signal.y0, signal.ym, signal.y1, parent, start, stop)
    return Signal(like.t, like.h, *values, like.last, signal.initial)


def _last_of_parts(parent: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return which part, of those that sub-steps were cut into, ends at each row; -1 where none does."""
    ends = np.cumsum(np.bincount(parent)) - 1
    return np.where(last < 0, -1, ends[last])


def advance(
    block: Block, parameters: Any, model: Model, stage: Stage, state: Any = None,
    known: tuple[tuple[Any, ...], float] | None = None,
) -> tuple[Stage, Any]:  # fmt: skip
    """Take what is known before a block through it.

    Args:
        block: a block that acts on the signal of the chain.
        parameters: its own.
        model: whose block it is.
        stage: before it.
        state: of the block at the beginning; None for rest.
        known: its constants and what it gives at rest, where they were computed before.

    Returns:
        What is known behind it, and the state of the block at the end.
    """
    signal = stage.signal
    after = Stage(signal, stage.voltage, stage.quasi_static, stage.tip_um)
    if block.transducer:
        after.voltage = signal
    place = STAGES.index(block.stage)
    if place >= STAGES.index("structure") and after.quasi_static is None:
        after.quasi_static = signal
    if place > STAGES.index("structure") and after.tip_um is None:
        after.tip_um = signal.at_rows()
    constants = constants_of(block, parameters, model) if known is None else known[0]
    x = _beside(block, after) if block.beside else signal
    arguments: tuple[Any, ...] = (signal.t, signal.h, signal.y0, signal.ym, signal.y1, x.y0, x.ym, x.y1)
    begin_s = float(signal.t[0]) if signal.t.size else 0.0
    initial = _at_rest(block, parameters, model, after, begin_s) if known is None else known[1]
    if block.corner is None:
        y0, ym, y1, state = uncut_values(block, constants, arguments, state)
        # of a long record every array is large: stages on the same sub-steps share what says where these are
        after.signal = Signal(signal.t, signal.h, y0, ym, y1, signal.last, initial)
        return after, state
    state = initial_of(block, constants) if state is None else state
    run, capacity = block_run(block.id), 2 * signal.h.size
    while True:
        n, end, t, h, y0, ym, y1, parent, start, stop = run(state, constants, *arguments, capacity)
        if n >= 0:
            break
        capacity *= 4
    cut = n != signal.h.size
    last = _last_of_parts(parent[:n], signal.last) if cut else signal.last
    where_to = (t[:n], h[:n]) if cut else (signal.t, signal.h)
    after.signal = Signal(*where_to, y0[:n], ym[:n], y1[:n], last, initial)
    if cut:
        where = (parent[:n], start[:n], stop[:n], after.signal)
        after.voltage = None if after.voltage is None else _cut_like(after.voltage, *where)
        after.quasi_static = None if after.quasi_static is None else _cut_like(after.quasi_static, *where)
    return after, end
