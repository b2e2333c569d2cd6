"""Calls: what is known is called, Python functions become C functions, their own C is written once per shape."""

import ast
import dataclasses
import types
from collections.abc import Iterable
from typing import Any, cast

from bender_native.staging.context import (
    Braces,
    Context,
    Frame,
    Function,
    Later,
    bare,
    bare_function,
    dot_of,
    fill_returns,
    slot_kinds,
    source_of,
    struct_of,
    text_of,
)
from bender_native.staging.library import HANDLERS, NATIVE
from bender_native.staging.values import (
    Counted,
    Home,
    Known,
    Number,
    Primitive,
    Ring,
    Slice,
    Slot,
    Stream,
    WithTail,
    is_staged,
    joined,
    leaves,
    literal,
    made,
    mapped,
    refuse,
)

_CAPACITY = 8192
"""Doubles in the arrays of lists whose length is not known; see MOST_UNDER_WAY of the transport delay."""


class NothingKnownError(Exception):
    """A call of a function of whose result nothing is known yet: another way must say it first."""


class Closure:
    """A function that is defined within another one."""

    def __init__(self, node: Any, frame: Frame) -> None:
        self.node, self.frame = node, frame


def sequence(value: Any) -> Iterable[Any]:
    """Return the elements of a value of known length."""
    if isinstance(value, Number | Ring | Slice | WithTail | Home | Counted):
        return refuse("a list of a length that is not known where one is needed that is")
    return value


def call(context: Context, function: Any, arguments: list[Any], named: dict[str, Any], node: Any) -> Any:
    """Return the result of a call."""
    if isinstance(function, tuple) and function and function[0] == "append":
        return _appended(context, function[1], arguments[0], node)
    if isinstance(function, Primitive):
        return function(*arguments, **named)
    if isinstance(function, Closure):
        names = dict(zip([x.arg for x in function.node.args.args], arguments, strict=True)) | named
        frame = function.frame
        inner = Frame(function.node.name, frame.file, frame.line, names, [frame.names, *frame.outer])
        return inlined(context, inner, function.node)
    if isinstance(function, types.MethodType):
        return call(context, function.__func__, [function.__self__, *arguments], named, node)
    if function in (list, tuple):
        return _as_sequence(context, function, arguments)
    if function is range and any(isinstance(x, Number) for x in arguments):
        begin, end, stride = (0, *arguments, 1)[-3:] if len(arguments) == 1 else (*arguments, 1)[:3]
        return Counted(begin, end, stride) if isinstance(stride, int) else refuse("a stride that is not known")
    if function is next and isinstance(arguments[0], list):
        arguments = [iter(arguments[0]), *arguments[1:]]
    staged = is_staged(arguments) or is_staged(named)
    if function in (min, max) and "default" in named:
        default = named.pop("default")
        if not len(arguments[0]):
            return default
    if staged and function in HANDLERS and any(isinstance(leaf, Number | Ring) for leaf in leaves(arguments)):
        return HANDLERS[function](context, arguments)
    if not staged or function in NATIVE or function is dataclasses.fields:
        return cast(Any, function)(*arguments, **named)
    if function is dataclasses.astuple:
        return tuple(getattr(arguments[0], field.name) for field in dataclasses.fields(arguments[0]))
    if function is dataclasses.replace:
        old = arguments[0]
        values = {field.name: getattr(old, field.name) for field in dataclasses.fields(old)} | named
        return constructed(context, type(old), values, node)
    if isinstance(function, type):
        return _constructed_by_call(context, function, arguments, named, node)
    function = bare_function(function)
    if isinstance(function, types.FunctionType):
        return python_call(context, function, arguments, named, node)
    if isinstance(function, types.BuiltinFunctionType) and isinstance(
        getattr(function, "__self__", None), list | dict | tuple
    ):
        return function(*arguments, **named)
    return refuse(f"a call of {getattr(function, '__name__', function)!r} with numbers that are not known")


def _appended(context: Context, holder: Any, value: Any, node: Any) -> None:
    from bender_native.staging.expressions import named
    from bender_native.staging.rings import appended

    if isinstance(holder, Ring):
        appended(context, holder, value)
    elif isinstance(holder, Stream):
        holder.use(named(context, "element", value))
    elif isinstance(holder, Known) and holder.region == context.region:
        holder.append(named(context, "element", value))
    else:
        raise context.error(node, "found a list that grows on one of several ways")


def _as_sequence(context: Context, kind: type, arguments: list[Any]) -> Any:
    from bender_native.staging.rings import copy_of

    if not arguments:
        return Known((), context.region) if kind is list else ()
    (value,) = arguments
    if isinstance(value, Home):
        return value
    if isinstance(value, Ring | Slice):
        width = value.width if isinstance(value, Ring) else value.ring.width
        return copy_of(context, value, "list", _CAPACITY, width)
    return Known(value, context.region) if kind is list else tuple(sequence(value))


def _constructed_by_call(context: Context, kind: type, arguments: list[Any], named: dict[str, Any], node: Any) -> Any:
    if issubclass(kind, tuple):
        return kind(*arguments, **named)
    if dataclasses.is_dataclass(kind):
        fields = dataclasses.fields(kind)
        values = {f.name: f.default for f in fields if f.default is not dataclasses.MISSING}
        values |= dict(zip([f.name for f in fields], arguments, strict=False)) | named
        return constructed(context, kind, values, node)
    if issubclass(kind, BaseException):
        return (kind, *arguments)
    instance = object.__new__(kind)
    python_call(context, cast(Any, kind.__init__), [instance, *arguments], named, node, inline=True)
    return instance


def constructed(context: Context, kind: type, values: dict[str, Any], node: Any) -> Any:
    """Return a dataclass, its own checks written as C."""
    instance = made(kind, values)
    check = getattr(kind, "__post_init__", None)
    if check is not None:
        python_call(context, check, [instance], {}, node, inline=True)
    return instance


def python_call(
    context: Context, function: types.FunctionType, arguments: list[Any], named: dict[str, Any], node: Any,
    inline: bool = False,
) -> Any:  # fmt: skip
    """Call a Python function: write it into the caller, or as a C function of its own."""
    tree, file, line = source_of(function)
    names = _bound(function, tree, arguments, named)
    frame = Frame(function.__qualname__, file, line, names, [function.__globals__])
    rings = any(isinstance(leaf, Ring | Slice | Counted) for value in names.values() for leaf in leaves(value))
    lists = any(isinstance(value, list) for value in names.values())
    many = "list[" in (str(function.__annotations__.get("return", "")))
    inline = inline or context.inline or tree.args.kwarg is not None
    if inline or function.__module__.startswith(context.written_in) or rings or lists or many:
        return inlined(context, frame, tree)
    return _c_call(context, function, frame, tree, node)


def _bound(function: types.FunctionType, tree: Any, arguments: list[Any], named: dict[str, Any]) -> dict[str, Any]:
    parameters = [x.arg for x in tree.args.args]
    names = dict(zip(parameters, arguments, strict=False)) | named
    if len(arguments) > len(parameters) or tree.args.vararg:
        refuse(f"this way of calling {function.__name__}")
    if tree.args.kwarg is not None:
        known = {*parameters, *(x.arg for x in tree.args.kwonlyargs)}
        further = {name: value for name, value in named.items() if name not in known}
        names = {name: value for name, value in names.items() if name not in further} | {tree.args.kwarg.arg: further}
    defaults = function.__defaults__ or ()
    for name, value in zip(parameters[len(parameters) - len(defaults) :], defaults, strict=True):
        names.setdefault(name, value)
    for name, value in (function.__kwdefaults__ or {}).items():
        names.setdefault(name, value)
    return names


def inlined(context: Context, frame: Frame, tree: Any) -> Any:
    """Write a Python function into the C function at hand; returns its result."""
    from bender_native.staging.expressions import placed
    from bender_native.staging.rings import copied_into
    from bender_native.staging.statements import run

    caller = context.frame
    frame.returns = []
    frame.label = ""
    context.frame = frame
    try:
        with context.branch(region=False) as lines:
            ended = run(context, tree.body)
    finally:
        context.frame = caller
    returns = frame.returns
    if not ended:
        context.frame = frame
        later = Later(None)
        returns.append(later)
        lines.append(later)
        context.frame = caller
    if frame.stream is not None:
        for later in returns:
            later.value = None
    if len(returns) == 1 and lines and lines[-1] is returns[0]:
        lines.pop()
        context.out += lines
        return returns[0].value
    if not returns:
        context.out += lines
        return None
    slots: list[list[Any]] = []
    shape = joined([later.value for later in returns], slots)
    label = context.fresh(f"after_{frame.name.rpartition('.')[2]}")
    shape = _rings_placed(context, shape, slots, returns)
    result = placed(context, shape, slots, [later.lines for later in returns], frame.name.rpartition(".")[2])
    jumps = False
    for later in returns:
        if lines and lines[-1] is later:
            continue
        later.lines.append(f"goto {label};")
        jumps = True
    context.out += lines
    if jumps:
        context.emit(f"{label}: ;")
    del copied_into
    return result


def _rings_placed(context: Context, shape: Any, slots: list[list[Any]], returns: list[Later]) -> Any:
    """Have every return copy its list of unknown length into one and the same ring."""
    from bender_native.staging.rings import copied_into, width_of

    def ring(leaf: Any) -> Any:
        if not (isinstance(leaf, Slot) and leaf.kind == "r"):
            return leaf
        values = slots[leaf.index]
        known = next((value for value in values if isinstance(value, Ring | Slice)), None)
        base = known.ring if isinstance(known, Slice) else known
        capacity = max((x.ring if isinstance(x, Slice) else x).capacity for x in values if isinstance(x, Ring | Slice))
        made_ring = context.ring("result", max(capacity, _CAPACITY), base.width if base else width_of(values[0]))
        for later, value in zip(returns, values, strict=True):
            out, context.out = context.out, later.lines
            copied_into(context, made_ring, value)
            context.out = out
        return made_ring

    return mapped(shape, ring)


def _key(value: Any) -> Any:
    if isinstance(value, Number):
        return ("number", value.kind)
    if isinstance(value, tuple | list):
        return (type(value).__name__, tuple(_inner_key(item) for item in value))
    return _inner_key(value)


def _inner_key(value: Any) -> Any:
    if isinstance(value, Number):
        return ("in", value.text) if value.in_model else ("number", value.kind)
    if isinstance(value, tuple | list):
        return (type(value).__name__, tuple(_inner_key(item) for item in value))
    if isinstance(value, dict):
        return ("dict", tuple((key, _inner_key(item)) for key, item in value.items()))
    if dataclasses.is_dataclass(value) and not isinstance(value, type | Home):
        return (type(value).__name__, tuple(_inner_key(getattr(value, f.name)) for f in dataclasses.fields(value)))
    if isinstance(value, int | float | str | bool | None | type(None)):
        return (type(value).__name__, repr(value))
    return ("id", id(value))


def _uses_model(value: Any, seen: frozenset[int] = frozenset()) -> bool:
    for leaf in leaves(value):
        if (isinstance(leaf, Number) and leaf.in_model) or isinstance(leaf, Home):
            return True
        names = getattr(type(leaf), "__slots__", None) or getattr(leaf, "__dict__", ())
        plain = type(leaf).__module__.startswith("bender_plant") and not isinstance(leaf, type)
        if plain and id(leaf) not in seen:
            inside = (getattr(leaf, name, None) for name in names)
            if any(_uses_model(value, seen | {id(leaf)}) for value in inside):
                return True
    return False


def _c_call(context: Context, function: types.FunctionType, frame: Frame, tree: Any, node: Any) -> Any:
    if function in context.general or _calls_itself(tree):
        # one C function for all turns, whatever was known at the first
        frame.names = {name: _forgotten(value) for name, value in frame.names.items()}
    values = [frame.names[x.arg] for x in tree.args.args + tree.args.kwonlyargs]
    names = [x.arg for x in tree.args.args + tree.args.kwonlyargs]
    key = (id(function), tuple(_key(value) for value in values))
    given: list[str] = []
    made_function = context.functions.get(key)
    if made_function is None:
        made_function = _written_function(context, function, frame, tree, names, key)
    elif made_function.writing:
        made_function.recursive = True
        if made_function.assumed is None:
            raise NothingKnownError
    for value in values:
        _given(context, value, given, top=True)
    if made_function.uses_model:
        given.insert(0, "m")
    return _result(context, made_function, given)


def _calls_itself(tree: Any) -> bool:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = node.func
            name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
            if name == tree.name:
                return True
    return False


def _forgotten(value: Any) -> Any:
    """Return an argument with its known floats taken for unknown ones."""
    if isinstance(value, float):
        return Number(literal(value))
    if type(value) is tuple:
        return tuple(_forgotten(item) for item in value)
    return value


def _given(context: Context, value: Any, given: list[str], top: bool) -> None:
    """List what is handed over for an argument."""
    if isinstance(value, Number):
        if top or not value.in_model:
            given.append(bare(value.text) if value.dot is None else context.kept("t", value).text)
            if context.dual and value.kind == "d":
                given.append(bare(dot_of(value)))
    elif isinstance(value, tuple | list):
        for item in value:
            _given(context, item, given, top=False)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type | Home):
        for field in dataclasses.fields(value):
            _given(context, getattr(value, field.name), given, top=False)


def _result(context: Context, function: Function, given: list[str]) -> Any:
    shape = function.shape if function.assumed is None else function.assumed
    kinds, text = function.kinds, f"{function.name}({', '.join(given)})"
    if not kinds:
        if function.writing or (function.lines and any(not isinstance(line, Later) for line in function.lines)):
            context.emit(f"{text};")
        return shape
    hint = function.name.rpartition("_")[2]
    struct = struct_of(context, kinds)
    if not struct.startswith(("numbers_", "pairs_")):
        if function.uses_model:
            number: Number = context.variable(hint, kinds, constant_text=text)
        else:
            number = Number(text, kinds)
        return mapped(shape, lambda leaf: number if isinstance(leaf, Slot) else leaf)
    name = context.fresh(hint)
    if function.recursive:
        later = Later(None)
        context.function.fails.append(later)
        too_deep = 'say(m, "found corners within corners without end");'
        context.emit(Braces("if (m->depth >= MOST_DEPTH)", [too_deep, later]))
        context.emit("m->depth += 1;")
    context.emit(f"const {struct} {name} = {text};")
    if function.recursive:
        context.emit("m->depth -= 1;")

    def field(leaf: Any) -> Any:
        if not isinstance(leaf, Slot):
            return leaf
        place = f"{name}.f{leaf.index}"
        dotted = context.dual and leaf.kind == "d"
        return context.variable(
            f"{hint}_{leaf.index}", leaf.kind, constant_text=place, dot=f"{place}_d" if dotted else None
        )

    return mapped(shape, field)


def _written_function(
    context: Context, function: types.FunctionType, frame: Frame, tree: Any, names: list[str], key: Any
) -> Function:
    module = function.__module__.rpartition(".")[2]
    c_name = context.c_name(f"{module}_{function.__name__}")
    made_function = Function(c_name, [], any(_uses_model(x) for x in _inside(frame.names, names)))
    context.functions[key] = made_function
    _write(context, made_function, frame, tree, names)
    if made_function.recursive:
        made_function.assumed = made_function.shape
        shape = repr(made_function.shape)
        _write(context, made_function, frame, tree, names)
        if repr(made_function.shape) != shape:
            raise context.error(tree, "found a recursion whose result changes its shape")
        made_function.assumed = None
    context.order.append(made_function)
    return made_function


def _inside(values: dict[str, Any], names: list[str]) -> list[Any]:
    """List the arguments that are not handed over as a number of their own."""
    return [values[name] for name in names if not isinstance(values[name], Number)]


def _write(context: Context, made_function: Function, frame: Frame, tree: Any, names: list[str]) -> None:
    from bender_native.staging.statements import run

    made_function.returns, made_function.fails, made_function.names = [], [], {"m"}
    made_function.parameters = ["Model *m"] if made_function.uses_model else []
    saved = context.frame, context.function, context.out, context.region, context.loops
    arguments = {name: frame.names[name] for name in names}
    context.function, context.region, context.loops = made_function, (context.count(),), []
    made_function.lines = context.out = []
    local = {name: _parameter(context, name, value, top=True) for name, value in arguments.items()}
    context.frame = Frame(frame.name, frame.file, frame.line, local, frame.outer)
    made_function.writing = True
    try:
        if not run(context, tree.body):
            later = Later(None)
            made_function.returns.append(later)
            context.emit(later)
        slots: list[list[Any]] = []
        made_function.shape = joined([later.value for later in made_function.returns], slots, hand_over=True)
        made_function.kinds = slot_kinds(slots, made_function.shape)
        fill_returns(context, made_function, slots)
    finally:
        made_function.writing = False
        context.frame, context.function, context.out, context.region, context.loops = saved


def _parameter(context: Context, name: str, value: Any, top: bool) -> Any:
    """Return what stands for an argument inside the function."""
    if isinstance(value, Number):
        if value.in_model and not top:
            return value
        made_name = context.fresh(name)
        c_type = {"d": "double", "i": "long long", "b": "int"}[value.kind]
        context.function.parameters.append(f"{c_type} {made_name}")
        if not (context.dual and value.kind == "d"):
            return Number(made_name, value.kind)
        context.function.parameters.append(f"double {made_name}_d")
        return Number(made_name, value.kind, f"{made_name}_d")
    if isinstance(value, tuple):
        items = [_parameter(context, f"{name}_{k}", item, top=False) for k, item in enumerate(value)]
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    if dataclasses.is_dataclass(value) and not isinstance(value, type | Home):
        fields = [field.name for field in dataclasses.fields(value)]
        return made(type(value), {f: _parameter(context, f, getattr(value, f), top=False) for f in fields})
    return value


__all__ = ["Closure", "NothingKnownError", "call", "constructed", "inlined", "python_call", "sequence", "text_of"]
