"""What the translator computes with: Python values that are known, and numbers that are known at run time only.

A tuple, list or dataclass may hold both. Everything that is known is computed at once; C is written for the rest.
"""

import dataclasses
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NoReturn, cast

from bender_loop.errors import InputError

_FIELD = re.compile(r"m->(?!scratch)[\w.]+(\[\d+\])?")


class TranslationError(InputError):
    """What the translator does not know: names the function, the file and the line."""


class Number:
    """A number that is known at run time only.

    Attributes:
        text: a C expression without side effects.
        kind: "d" for a double, "i" for a whole number, "b" for a truth value.
        dot: C expression of its derivative, None where it has none.
        low: bounds that hold whenever the code runs; the number is finite where both are.
        high: see `low`.
    """

    __slots__ = ("dot", "high", "kind", "low", "text")

    def __init__(
        self,
        text: str,
        kind: str = "d",
        dot: str | None = None,
        low: float = float("-inf"),
        high: float = float("inf"),
    ) -> None:
        self.text, self.kind, self.dot, self.low, self.high = text, kind, dot, low, high

    def __bool__(self) -> bool:
        raise TypeError("a number that is known at run time only was asked whether it is true")

    def __repr__(self) -> str:
        return f"Number({self.text})"

    @property
    def in_model(self) -> bool:
        """Whether it is a field of the model's struct, and so needs no passing."""
        return _FIELD.fullmatch(self.text) is not None

    @property
    def is_atom(self) -> bool:
        """Whether it is a name, and so may be written twice."""
        return self.in_model or self.text.isidentifier()


class Known(list[Any]):
    """A list whose length is known; `region` is the stretch of code without branches in which it was made."""

    __slots__ = ("region",)

    def __init__(self, items: Any = (), region: tuple[int, ...] = ()) -> None:
        super().__init__(items)
        self.region = region


@dataclass(eq=False, slots=True)
class Ring:
    """A list of a length that is known at run time only, in an array of fixed size.

    Attributes:
        array: C expression of the array of doubles.
        count: C expression of the number of elements, an lvalue.
        capacity: most elements.
        width: doubles of one element: 1 for numbers, more for tuples of them.
        dots: C expression of the array of their derivatives.
    """

    array: str
    count: str
    capacity: int
    width: int
    dots: str | None = None

    def element(self, place: str) -> Any:
        """Return the element at a place, a C expression of a whole number."""
        if self.width == 1:
            return self._number(place)
        return tuple(self._number(f"{self.width} * {place} + {k}") for k in range(self.width))

    def _number(self, place: str) -> Number:
        return Number(f"{self.array}[{place}]", "d", None if self.dots is None else f"{self.dots}[{place}]")


@dataclass(eq=False, slots=True)
class WithTail:
    """A tuple that begins with elements known in number and ends in those of a ring."""

    head: tuple[Any, ...]
    tail: Any


@dataclass(eq=False, slots=True)
class Slice:
    """The part of a ring from an element on."""

    ring: Ring
    begin: Number | int


@dataclass(eq=False, slots=True)
class Counted:
    """A range whose bounds are known at run time only."""

    begin: Any
    end: Any
    stride: int


@dataclass(eq=False, slots=True)
class Stream:
    """A list that is only appended to and then run through once: each element is used as soon as it is there."""

    use: Callable[[Any], None]


@dataclass(eq=False, slots=True)
class Home:
    """A list that lives in the model's struct: the states of the blocks."""

    values: list[Any]


@dataclass(eq=False, slots=True)
class Primitive:
    """A function that is written in C by hand: writes its call, and returns what stands for the result."""

    write: Callable[..., Any]

    def __call__(self, *arguments: Any) -> Any:
        """Write a call; returns what stands for its result."""
        return self.write(*arguments)


@dataclass(frozen=True, slots=True)
class Slot:
    """A place of a joined value that differs between the ways that lead there."""

    index: int
    kind: str


def literal(value: Any, kind: str = "d") -> str:
    """Return a known number as a C literal that means exactly the same."""
    if kind == "b":
        return "1" if value else "0"
    if kind == "i":
        return f"{int(value)}LL"
    number = float(value)
    if number != number:
        return "NAN"
    if number in (float("inf"), float("-inf")):
        return "INFINITY" if number > 0 else "(-INFINITY)"
    text = repr(number)
    return f"({text})" if text.startswith("-") else text


def kind_of(value: Any) -> str:
    """Return the kind of a number, "" for what is none."""
    if isinstance(value, Number):
        return value.kind
    if isinstance(value, bool):
        return "b"
    if isinstance(value, int):
        return "i"
    return "d" if isinstance(value, float) else ""


def leaves(value: Any) -> Iterator[Any]:
    """Return everything that a value holds and that is not a container."""
    if isinstance(value, Slice):
        yield value.ring
    elif isinstance(value, WithTail):
        yield from leaves(value.head)
        yield from leaves(value.tail)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from leaves(item)
    elif isinstance(value, dict):
        for item in value.values():
            yield from leaves(item)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type | Ring | Home | Stream | Counted):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name))
    else:
        yield value


def is_staged(value: Any, seen: frozenset[int] = frozenset()) -> bool:
    """Return whether a value holds something that is known at run time only."""
    for leaf in leaves(value):
        if isinstance(leaf, Number | Ring | Home | Stream | Counted | Slice):
            return True
        names = getattr(type(leaf), "__slots__", None) or getattr(leaf, "__dict__", ())
        plain = type(leaf).__module__.startswith(("bender_", "tests")) and not isinstance(leaf, type)
        if plain and id(leaf) not in seen:
            inside = [getattr(leaf, name, None) for name in names]
            if is_staged(inside, seen | {id(leaf)}):
                return True
    return False


def mapped(value: Any, change: Callable[[Any], Any]) -> Any:
    """Return a value with every leaf changed."""
    if isinstance(value, WithTail):
        return WithTail(mapped(value.head, change), mapped(value.tail, change))
    if isinstance(value, Known):
        return Known([mapped(item, change) for item in value], value.region)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*[mapped(item, change) for item in value])
    if isinstance(value, tuple | list):
        return type(value)(mapped(item, change) for item in value)
    if isinstance(value, dict):
        return {key: mapped(item, change) for key, item in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type | Ring | Home | Stream | Counted | Slice | Slot):
        return made(type(value), {f.name: mapped(getattr(value, f.name), change) for f in dataclasses.fields(value)})
    return change(value)


def made(kind: type, values: dict[str, Any]) -> Any:
    """Return an instance of a dataclass with these fields, its checks left out."""
    instance = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(instance, name, value)
    return instance


class UntranslatableError(Exception):
    """The translator has no C for something; where it is met, function, file and line are added."""


class UnjoinableError(Exception):
    """Two ways lead to values of different shape."""


def joined(values: list[Any], slots: list[list[Any]], hand_over: bool = False) -> Any:
    """Return one value for several ways that lead to it; where they differ a Slot stands.

    Args:
        values: one for each way.
        slots: gains, for each Slot, the list of what the ways put there.
        hand_over: have a Slot for every number that is not known, although there be one way only.

    Raises:
        UnjoinableError: the ways lead to values of different shape.
    """
    first: Any = values[0]
    if isinstance(values[0], Home) and all(value is first for value in values):
        return first
    if not hand_over and all(value is first for value in values) and not isinstance(values[0], float):
        return first
    if any(isinstance(value, WithTail) for value in values):
        length = next(len(value.head) for value in values if isinstance(value, WithTail))
        split = [_split(value, length) for value in values]
        return WithTail(
            joined([head for head, _ in split], slots, hand_over), joined([tail for _, tail in split], slots, hand_over)
        )
    if any(isinstance(value, Ring | Slice) for value in values):
        slots.append(values)
        return Slot(len(slots) - 1, "r")
    kinds = {kind_of(value) for value in values}
    if "" not in kinds:
        if not any(isinstance(value, Number) for value in values) and len({(type(v), repr(v)) for v in values}) == 1:
            return first
        if not hand_over and all(isinstance(v, Number) and v.text == first.text and v.dot == first.dot for v in values):
            return first
        slots.append(values)
        return Slot(len(slots) - 1, kinds.pop() if len(kinds) == 1 else "d")
    if all(isinstance(value, tuple | list) for value in values):
        if len({len(value) for value in values}) != 1:
            raise UnjoinableError("lists or tuples of different lengths")
        items = [joined([value[k] for value in values], slots, hand_over) for k in range(len(cast(Any, values[0])))]
        if isinstance(first, list):
            return Known(items)
        return type(first)(*items) if hasattr(first, "_fields") else tuple(items)
    if dataclasses.is_dataclass(first) and len({type(value) for value in values}) == 1:
        names = [field.name for field in dataclasses.fields(first)]
        return made(type(first), {name: joined([getattr(v, name) for v in values], slots, hand_over) for name in names})
    if all(type(value) is type(first) and value == first for value in values):
        return first
    raise UnjoinableError(f"{', '.join(sorted({type(value).__name__ for value in values}))}")


def _split(value: Any, length: int) -> tuple[tuple[Any, ...], Any]:
    if isinstance(value, WithTail):
        return value.head, value.tail
    if not isinstance(value, tuple):
        raise UnjoinableError("a tuple and something else")
    return value[:length], Known(value[length:])


def refuse(what: str) -> NoReturn:
    """Refuse something; the translator adds function, file and line.

    Raises:
        UntranslatableError: always.
    """
    raise UntranslatableError(what)
