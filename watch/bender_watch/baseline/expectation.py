"""Expected readings and signatures, row by row: of a model of this project, or of any FMU."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import own_bounds
from bender_compiled.stream import Stream
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.process.watched import WatchedPlant
from bender_plant.model import Model
from bender_watch.baseline.candidates import COARSER

Array = NDArray[np.float64]
_Row = tuple[float, float, float]
"""Time, command and reading."""


class Expectation(Protocol):
    """What is expected to be read, and what each signature adds to it."""

    @property
    def resumable(self) -> bool:
        """Whether `state` holds all that it remembers."""
        ...

    def begin(self, time_s: float, voltage_V: float, *, rest: bool) -> None:
        """Begin a record: at rest, or after standing at a voltage for long."""
        ...

    def advance(self, time_s: Array, voltage_V: Array, command_time_s: Array | None) -> tuple[Array, Array]:
        """Return the expected readings (n,) and the raw signatures (n, j), in um."""
        ...

    def state(self) -> Any:
        """Return what is remembered, as JSON can hold it."""
        ...

    def restore(self, state: Any) -> None:
        """Go on from a state."""
        ...


STOOD_S = 1000.0
"""How long a device that is met in motion is taken to have stood at its first command, at most."""
MOST_SUBSTEPS = 2e6


def rest_before_s(stream: Stream) -> float:
    """Return how long a device that is met in motion is taken to have stood."""
    return min(STOOD_S, MOST_SUBSTEPS * stream.bounds.longest_s)


@dataclass(slots=True)
class OfModel:
    """A model, and variants of it with a small effect each.

    Attributes:
        base: the model.
        variants: with an effect.
        linear: the command runs straight from row to row.
    """

    base: Model
    variants: Sequence[Model] = ()
    linear: bool = False
    resumable: bool = field(default=True, init=False)
    _own: Stream = field(init=False)
    _beside: list[tuple[Stream, list[int]]] = field(init=False)
    _lost: set[int] = field(default_factory=set[int], init=False)

    def __post_init__(self) -> None:
        self._own = Stream((self.base,), self.linear)
        groups: dict[tuple[int, int], list[int]] = {}
        for k, model in enumerate(self.variants):
            bounds = own_bounds(model, COARSER)
            groups.setdefault((_decade(bounds.first_s), _decade(bounds.longest_s)), []).append(k)
        self._beside = [
            (Stream((self.base, *(self.variants[k] for k in places)), self.linear, COARSER), places)
            for places in groups.values()
        ]

    def begin(self, time_s: float, voltage_V: float, *, rest: bool) -> None:
        """Begin a record."""
        self._lost = set()
        _begin(self._own, time_s, voltage_V, rest)
        for number, (stream, _) in enumerate(self._beside):
            with self._while_it_lasts(number):
                _begin(stream, time_s, voltage_V, rest)

    @contextmanager
    def _while_it_lasts(self, number: int) -> Iterator[None]:
        """Go on without the signatures of a stream that runs away: the device is its model, which does not."""
        try:
            yield
        except ArithmeticError:
            self._lost.add(number)

    def advance(self, time_s: Array, voltage_V: Array, command_time_s: Array | None) -> tuple[Array, Array]:
        """Return the expected readings (n,) and what each variant reads beyond the model (n, j)."""
        expected = self._own.advance(time_s, voltage_V, command_time_s)[0]
        added = np.zeros((time_s.size, len(self.variants)))
        for number, (stream, places) in enumerate(self._beside):
            if number in self._lost:
                continue
            with self._while_it_lasts(number):
                readings = stream.advance(time_s, voltage_V, command_time_s)
                added[:, places] = (readings[1:] - readings[0]).T
        return expected, added

    @property
    def own_state(self) -> Any:
        """What the stream of the device remembers."""
        return self._own.state()

    def state(self) -> Any:
        """Return what the streams remember."""
        beside = [None if k in self._lost else x.state() for k, (x, _) in enumerate(self._beside)]
        return [self._own.state(), *beside]

    def restore(self, state: Any) -> None:
        """Go on from what the streams remembered."""
        own, *beside = state
        self._own.restore(own)
        self._lost = {k for k, known in enumerate(beside) if known is None}
        for (stream, _), known in zip(self._beside, beside, strict=True):
            if known is not None:
                stream.restore(known)


def _begin(stream: Stream, time_s: float, voltage_V: float, rest: bool) -> None:
    """Begin a record: at rest, or after standing at a voltage for long."""
    if rest:
        stream.begin()
    else:
        stream.stand(time_s - rest_before_s(stream), voltage_V, time_s)


def _decade(step_s: float) -> int:
    return round(math.log10(step_s)) if math.isfinite(step_s) else 99


@dataclass(slots=True)
class OfFmu:
    """Any FMU, in a process of its own; its signatures are what a delay, a curve and a bend of its reading would add.

    Attributes:
        path: of the FMU.
        input_name, output_name: variables; None for the only ones.
        parameters: start values by name.

    Raises:
        InputError: the FMU will not do.
        RunError: it fails to start or to step, crashes or hangs.
    """

    path: Path
    input_name: str | None = None
    output_name: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    resumable: bool = field(default=False, init=False)
    _plant: WatchedPlant = field(init=False)
    _last: _Row | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        plant = WatchedPlant(self.path, input_name=self.input_name, output_name=self.output_name)
        self._plant = plant.with_parameters(self.parameters)

    def begin(self, time_s: float, voltage_V: float, *, rest: bool) -> None:
        """Begin a record."""
        del time_s
        self._plant.reset()
        self._last = None
        if not rest:
            self._plant.run_there(_stand, (voltage_V,), {})

    def advance(self, time_s: Array, voltage_V: Array, command_time_s: Array | None) -> tuple[Array, Array]:
        """Return the expected readings (n,) and the signatures (n, 3): rate, square and cube of the reading."""
        del command_time_s
        expected, rate = self._plant.run_there(_driven, (self._last, time_s, voltage_V), {})
        if time_s.size:
            self._last = (float(time_s[-1]), float(voltage_V[-1]), float(expected[-1]))
        return expected, np.column_stack([rate, expected**2, expected**3])

    def state(self) -> Any:
        """Return nothing: an FMU is driven again from the beginning."""
        return None

    def restore(self, state: Any) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Free the FMU and remove its unpacked files; nothing is expected after that."""
        self._plant.close()


def _stand(plant: FmuPlant, voltage_V: float) -> None:
    """Let an FMU stand at a voltage for long."""
    for _ in range(100):
        plant.step(voltage_V, 0.1)


def _driven(plant: FmuPlant, last: _Row | None, time_s: Array, voltage_V: Array) -> tuple[Array, Array]:
    """Drive an FMU from the row before, and return its readings and what they lose a second, (n,) each."""
    expected, rate = np.empty(time_s.size), np.zeros(time_s.size)
    for k in range(time_s.size):
        if last is None:
            reading = plant.read()
        else:
            before_s, held_V, before_um = last
            step_s = float(time_s[k]) - before_s
            reading = plant.step(held_V, step_s)
            rate[k] = -(reading - before_um) / step_s
        expected[k] = reading
        last = (float(time_s[k]), float(voltage_V[k]), reading)
    return expected, rate
