"""What is being written: the C functions, the one at hand, and the Python frame that it is made from."""

import ast
import inspect
import keyword
import re
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from types import FunctionType
from typing import Any

from bender_native.staging.values import Number, Ring, Slot, TranslationError, literal

TYPES = {"d": "double", "i": "long long", "b": "int"}
_POISON = {"d": "NAN", "i": "0", "b": "0"}
# words of C and names of its library that Python code may use as it likes
_RESERVED = frozenset(
    [
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
        "extern",
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "register",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "typedef",
        "union",
        "unsigned",
        "void",
        "volatile",
        "while",
        "main",
        "m",
        "j0",
        "j1",
        "jn",
        "y0",
        "y1",
        "yn",
        "gamma",
        "lgamma",
        "tgamma",
        "signgam",
        "exp",
        "exp2",
        "expm1",
        "log",
        "log1p",
        "log2",
        "pow",
        "sqrt",
        "sin",
        "cos",
        "tan",
        "tanh",
        "sinh",
        "cosh",
        "fabs",
        "floor",
        "ceil",
        "round",
        "rint",
        "index",
        "time",
        "div",
        "abs",
        "remainder",
        "scalb",
        "drem",
        "NAN",
        "INFINITY",
        "I",
        "near",
        "far",
        "small",
        "interface",
    ]
)


@dataclass(eq=False, slots=True)
class Later:
    """Lines that are filled in when the whole function is known: what a `return` hands over."""

    value: Any
    lines: list[Any] = field(default_factory=list)


@dataclass(eq=False, slots=True)
class Braces:
    """Lines between braces."""

    head: str
    lines: list[Any]


@dataclass(eq=False, slots=True)
class Function:
    """A C function in the making.

    Attributes:
        name: in C.
        parameters: C declarations.
        uses_model: whether it takes the model's struct.
        lines: its body.
        shape: what it returns, with a Slot for every number; None while it is not known.
        kinds: of the slots.
        assumed: shape that calls of itself rely on.
    """

    name: str
    parameters: list[str]
    uses_model: bool
    lines: list[Any] = field(default_factory=list)
    returns: list[Later] = field(default_factory=list)
    fails: list[Later] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    shape: Any = None
    kinds: str = ""
    writing: bool = False
    assumed: Any = None
    recursive: bool = False


@dataclass(eq=False, slots=True)
class Frame:
    """A Python function at work.

    Attributes:
        name: of the function, for messages.
        place: file and first line of its source.
        names: its local names.
        outer: where other names are looked up, the innermost first.
        returns: its returns so far, where it is written into the function that calls it.
        label: where these go to.
        stream: takes each element of the list that it returns.
    """

    name: str
    file: str
    line: int
    names: dict[str, Any]
    outer: list[dict[str, Any]]
    returns: list[Later] | None = None
    label: str = ""
    stream: Callable[[Any], None] | None = None


@dataclass(eq=False, slots=True)
class Loop:
    """A C loop: writes the values of the next turn into its variables."""

    sync: Callable[[], None]


class Context:
    """The state of a translation.

    Attributes:
        dual: write the derivative beside every value.
        inline: write every Python function into the one that calls it.
        written_in: beginnings of the modules whose functions are.
        general: Python functions that become one C function, whatever numbers are known where they are called.
    """

    def __init__(self, dual: bool = False) -> None:
        self.dual = dual
        self.inline = False
        self.functions: dict[Any, Function] = {}
        self.order: list[Function] = []
        self.structs: dict[str, str] = {}
        self.frame = Frame("", "", 0, {}, [])
        self.function = Function("", [], False)
        self.out: list[Any] = []
        self.region: tuple[int, ...] = ()
        self.loops: list[Loop] = []
        self.rings: list[tuple[str, int]] = []
        self.written_in: tuple[str, ...] = ()
        self.general: set[Any] = set()
        self._counter = 0
        self._c_names: set[str] = set()

    def count(self) -> int:
        """Return a number that was not there before."""
        self._counter += 1
        return self._counter

    def emit(self, line: Any) -> None:
        """Write a line."""
        self.out.append(line)

    def fresh(self, hint: str) -> str:
        """Return a name that the C function at hand does not bear yet."""
        name = re.sub(r"\W", "_", hint).strip("_") or "t"
        if name in _RESERVED or name[0].isdigit() or keyword.iskeyword(name):
            name = f"{name}_" if not name[0].isdigit() else f"t{name}"
        names, made, n = self.function.names, name, 0
        while made in names:
            n += 1
            made = f"{name}_{n}"
        names.add(made)
        return made

    def c_name(self, hint: str) -> str:
        """Return a name for a C function."""
        base = re.sub(r"\W", "_", hint).strip("_")
        name, n = base, 1
        while name in self._c_names:
            n += 1
            name = f"{base}_{n}"
        self._c_names.add(name)
        return name

    def variable(self, hint: str, kind: str, *, constant_text: str | None = None, dot: str | None = None) -> Number:
        """Declare a variable, with its value where it is constant; returns it."""
        name = self.fresh(hint)
        if constant_text is None:
            self.emit(f"{TYPES[kind]} {name};")
            if self.dual and kind == "d":
                self.emit(f"double {name}_d;")
                return Number(name, kind, f"{name}_d")
            return Number(name, kind)
        self.emit(f"const {TYPES[kind]} {name} = {bare(constant_text)};")
        if dot is None:
            return Number(name, kind)
        self.emit(f"const double {name}_d = {bare(dot)};")
        return Number(name, kind, f"{name}_d")

    def kept(self, hint: str, number: Number) -> Number:
        """Return a number as a name that may be written many times."""
        if number.is_atom and (number.dot is None or number.dot.isidentifier() or number.in_model):
            return number
        made = self.variable(hint, number.kind, constant_text=number.text, dot=number.dot)
        made.low, made.high = number.low, number.high
        return made

    def assign(self, target: str, kind: str, value: Any) -> None:
        """Write a value into a variable that stands already."""
        self.emit(f"{target} = {bare(text_of(value, kind))};")
        if self.dual and kind == "d":
            self.emit(f"{target}_d = {dot_of(value)};")

    def ring(self, hint: str, capacity: int, width: int) -> Ring:
        """Return an empty ring among the scratch arrays of the model."""
        name = f"{hint}_{len(self.rings)}"
        self.rings.append((name, capacity * width))
        self.emit(f"m->scratch.{name}_count = 0;")
        dots = f"m->scratch.{name}_d" if self.dual else None
        return Ring(f"m->scratch.{name}", f"m->scratch.{name}_count", capacity, width, dots)

    @contextmanager
    def branch(self, region: bool = True) -> Iterator[list[Any]]:
        """Write into a list of its own."""
        out, before = self.out, self.region
        self.out = []
        if region:
            self.region = (*before, self.count())
        try:
            yield self.out
        finally:
            self.out, self.region = out, before

    def error(self, node: ast.AST | None, what: str) -> TranslationError:
        """Return the refusal of something at a place of the source."""
        frame = self.frame
        line = frame.line + getattr(node, "lineno", 1) - 1
        return TranslationError(f"{frame.file}, line {line}, in {frame.name}: {what}: no C is written for this")


def text_of(value: Any, kind: str) -> str:
    """Return the C expression of a number, as a number of this kind."""
    if isinstance(value, Number):
        return value.text if value.kind == kind or kind != "d" else f"(double){value.text}"
    return literal(value, kind)


def dot_of(value: Any) -> str:
    """Return the C expression of the derivative of a number."""
    return value.dot if isinstance(value, Number) and value.dot is not None else "0.0"


def bare(text: str) -> str:
    """Return an expression without the parentheses around it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0 and place < len(text) - 1:
            return text
    return text[1:-1]


def bare_function(function: Any) -> Any:
    """Return a function as it is written; one that keeps its last results calls that one."""
    return inspect.unwrap(function) if callable(function) else function


@cache
def source_of(function: FunctionType) -> tuple[ast.FunctionDef, str, int]:
    """Return the syntax tree of a Python function, its file and first line.

    Raises:
        TranslationError: there is no source.
    """
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
        file = inspect.getsourcefile(function) or "?"
    except (OSError, TypeError, SyntaxError) as problem:
        raise TranslationError(f"{function.__qualname__}: no source to translate: {problem}") from None
    if not isinstance(tree, ast.FunctionDef):
        raise TranslationError(f"{file}, line {first}: {function.__qualname__} is not a plain function")
    return tree, file, first


def struct_of(context: Context, kinds: str) -> str:
    """Return the C type of what a function with these slots returns."""
    if not kinds:
        return "void"
    if len(kinds) == 1 and not (context.dual and kinds == "d"):
        return TYPES[kinds]
    name = f"{'pairs' if context.dual else 'numbers'}_{kinds}"
    if name not in context.structs:
        fields = []
        for k, kind in enumerate(kinds):
            fields.append(f"{TYPES[kind]} f{k};")
            if context.dual and kind == "d":
                fields.append(f"double f{k}_d;")
        context.structs[name] = f"typedef struct {{ {' '.join(fields)} }} {name};"
    return name


def fill_returns(context: Context, function: Function, slots: list[list[Any]]) -> None:
    """Write the returns of a function, now that all of them are known."""
    kinds = function.kinds
    struct = struct_of(context, kinds)
    for way, later in enumerate(function.returns):
        values = [slots[k][way] for k in range(len(kinds))]
        if not kinds:
            later.lines = ["return;"]
        elif not struct.startswith(("numbers_", "pairs_")):
            later.lines = [f"return {bare(text_of(values[0], kinds))};"]
        else:
            parts = []
            for kind, value in zip(kinds, values, strict=True):
                parts.append(bare(text_of(value, kind)))
                if context.dual and kind == "d":
                    parts.append(bare(dot_of(value)))
            later.lines = [f"return ({struct}){{{', '.join(parts)}}};"]
    poison = []
    for kind in kinds:
        poison += [_POISON[kind]] * (2 if context.dual and kind == "d" else 1)
    for later in function.fails:
        if not kinds:
            later.lines = ["return;"]
        elif not struct.startswith(("numbers_", "pairs_")):
            later.lines = [f"return {poison[0]};"]
        else:
            later.lines = [f"return ({struct}){{{', '.join(poison)}}};"]


def slot_kinds(slots: list[list[Any]], shape: Any) -> str:
    """Return the kinds of the slots of a shape, in their order."""
    from bender_native.staging.values import leaves

    kinds = ["d"] * len(slots)
    for leaf in leaves(shape):
        if isinstance(leaf, Slot):
            kinds[leaf.index] = leaf.kind
    return "".join(kinds)


def written(lines: list[Any], depth: int = 1) -> str:
    """Return lines as C text."""
    out: list[str] = []
    for line in lines:
        if isinstance(line, Later):
            out.append(written(line.lines, depth))
        elif isinstance(line, Braces):
            inside = written(line.lines, depth + 1)
            out.append(f"{'    ' * depth}{line.head} {{\n{inside}{'    ' * depth}}}\n")
        elif line:
            out.append(f"{'    ' * depth}{line}\n")
    return "".join(out)
