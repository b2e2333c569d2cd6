"""Expressions of Python, evaluated as far as they are known and written as C for the rest."""

import ast
import builtins
import operator
from collections.abc import Iterator
from typing import Any, cast

from bender_native.staging.arithmetic import binary, compared, has_dot, negative, truth
from bender_native.staging.calls import call, sequence
from bender_native.staging.context import Braces, Context, text_of
from bender_native.staging.values import (
    Home,
    Known,
    Number,
    Ring,
    Slice,
    Slot,
    UnjoinableError,
    UntranslatableError,
    WithTail,
    is_staged,
    joined,
    mapped,
    refuse,
)

_KNOWN = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.BitOr: operator.or_,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge, ast.Is: operator.is_, ast.IsNot: operator.is_not,
    ast.In: lambda a, b: a in b, ast.NotIn: lambda a, b: a not in b,
}  # fmt: skip


class Message:
    """A text with numbers in it that are known at run time only: pieces are texts and (number, format)."""

    def __init__(self, pieces: list[Any]) -> None:
        self.pieces = pieces


def evaluate(context: Context, node: ast.expr) -> Any:
    """Return the value of an expression.

    Raises:
        TranslationError: the translator does not know it.
    """
    handler = _EXPRESSIONS.get(type(node))
    if handler is None:
        raise context.error(node, f"found {type(node).__name__}")
    try:
        return handler(context, node)
    except (
        UntranslatableError,
        TypeError,
        AttributeError,
        KeyError,
        IndexError,
        ArithmeticError,
        UnjoinableError,
    ) as found:
        raise context.error(node, f"found {ast.unparse(node)!r} ({found})") from None


def _constant(context: Context, node: ast.Constant) -> Any:
    del context
    return node.value


def _name(context: Context, node: ast.Name) -> Any:
    frame = context.frame
    for names in (frame.names, *frame.outer):
        if node.id in names:
            value = names[node.id]
            if isinstance(value, UnjoinableError):
                raise context.error(node, f"found {node.id!r}, which two ways give different shapes ({value})")
            return value
    if hasattr(builtins, node.id):
        return getattr(builtins, node.id)
    raise context.error(node, f"found {node.id!r}, which is not set on every way that leads here")


def _binary(context: Context, node: ast.BinOp) -> Any:
    return combined(context, node.op, evaluate(context, node.left), evaluate(context, node.right))


def combined(context: Context, symbol: ast.operator, a: Any, b: Any) -> Any:
    """Return the result of an operator on two values."""
    if isinstance(a, Number) or isinstance(b, Number):
        return binary(context, symbol, a, b)
    if isinstance(a, Ring | Slice | WithTail) or isinstance(b, Ring | Slice | WithTail):
        return refuse("an operator on a list of a length that is not known")
    if isinstance(a, list):
        return Known(_KNOWN[type(symbol)](list(a), b), context.region)
    return _KNOWN[type(symbol)](a, b)


def _unary(context: Context, node: ast.UnaryOp) -> Any:
    value = evaluate(context, node.operand)
    if not isinstance(value, Number):
        table = {ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Not: operator.not_}
        return table[type(node.op)](value)
    if isinstance(node.op, ast.Not):
        return Number(f"!{_as_truth(value)}", "b")
    return negative(context, value) if isinstance(node.op, ast.USub) else value


def _as_truth(value: Any) -> str:
    return text_of(truth(value), "b")


def _comparison(context: Context, node: ast.Compare) -> Any:
    values = [evaluate(context, node.left)]
    found: Any = True
    for symbol, right in zip(node.ops, node.comparators, strict=True):
        value = evaluate(context, right)
        if isinstance(value, Number) and right is not node.comparators[-1]:
            value = context.kept("t", value)
        values.append(value)
        a, b = values[-2], values[-1]
        if isinstance(a, Number) or isinstance(b, Number):
            part = _compared(symbol, a, b)
        else:
            part = bool(_KNOWN[type(symbol)](a, b))
        found = _both(found, part)
        if found is False:
            return False
    return found


def _compared(symbol: ast.cmpop, a: Any, b: Any) -> Any:
    if isinstance(symbol, ast.Is | ast.IsNot):
        return (a is b) == isinstance(symbol, ast.Is)
    # truth values are compared as whole numbers
    return compared(symbol, a, b)


def _both(a: Any, b: Any) -> Any:
    if a is True:
        return b
    if b is True or a is False:
        return a
    return False if b is False else Number(f"({a.text} && {b.text})", "b")


def _logical(context: Context, node: ast.BoolOp) -> Any:
    """Return what Python's `and` and `or` give; what is not known must be a truth value."""
    is_and = isinstance(node.op, ast.And)
    found = evaluate(context, node.values[0])
    for following in node.values[1:]:
        if not isinstance(found, Number):
            if bool(found) != is_and:
                return found
            found = evaluate(context, following)
            continue
        test = context.kept("t", cast(Number, truth(found))) if has_dot(found) else truth(found)
        with context.branch() as lines:
            right = evaluate(context, following)
            right = truth(right)
        if not isinstance(right, Number):
            found = test if bool(right) == is_and else right
            if not lines and isinstance(found, bool):
                continue
        if lines:
            found = _with_lines(context, test, lines, right, is_and)
        elif isinstance(right, Number):
            found = Number(f"({text_of(test, 'b')} {'&&' if is_and else '||'} {right.text})", "b")
    return found


def _with_lines(context: Context, test: Any, lines: list[Any], right: Any, is_and: bool) -> Number:
    result = context.variable("both" if is_and else "either", "b")
    lines.append(f"{result.text} = {text_of(right, 'b')};")
    context.emit(Braces(f"if ({text_of(test, 'b') if is_and else '!' + text_of(test, 'b')})", lines))
    context.emit(Braces("else", [f"{result.text} = {0 if is_and else 1};"]))
    return result


def _conditional(context: Context, node: ast.IfExp) -> Any:
    test = truth(evaluate(context, node.test))
    if not isinstance(test, Number):
        return evaluate(context, node.body if test else node.orelse)
    test = context.kept("test", test) if context.dual else test
    with context.branch() as then:
        a = evaluate(context, node.body)
    with context.branch() as otherwise:
        b = evaluate(context, node.orelse)
    if not then and not otherwise and not has_dot(a, b):
        try:
            slots: list[list[Any]] = []
            shape = joined([a, b], slots)
        except UnjoinableError:
            shape, slots = None, []
        if isinstance(shape, Slot) and shape.kind != "r":
            x, y = slots[0]
            return Number(f"({test.text} ? {text_of(x, shape.kind)} : {text_of(y, shape.kind)})", shape.kind)
    return merge(context, test, [(then, a), (otherwise, b)], "t")


def merge(context: Context, test: Number, ways: list[tuple[list[Any], Any]], hint: str) -> Any:
    """Write both ways of a branch, each of which ends with a value; returns the value behind it."""
    slots: list[list[Any]] = []
    shape = joined([value for _, value in ways], slots)
    result = placed(context, shape, slots, [lines for lines, _ in ways], hint)
    context.emit(Braces(f"if ({test.text})", ways[0][0]))
    context.emit(Braces("else", ways[1][0]))
    return result


def placed(context: Context, shape: Any, slots: list[list[Any]], ends: list[list[Any]], hint: str) -> Any:
    """Declare a variable for every slot, write into it at the end of every way; returns the joined value.

    Raises:
        UntranslatableError: a list of a length that is not known differs between the ways.
    """
    variables: dict[int, Number] = {}

    def variable(leaf: Any) -> Any:
        if not isinstance(leaf, Slot):
            return leaf
        if leaf.kind == "r":
            return refuse("a list of a length that is not known differs between two ways")
        if leaf.index not in variables:
            made = context.variable(hint, leaf.kind)
            variables[leaf.index] = made
            for lines, value in zip(ends, slots[leaf.index], strict=True):
                context.out, kept = lines, context.out
                context.assign(made.text, leaf.kind, value)
                context.out = kept
        return variables[leaf.index]

    return mapped(shape, variable)


def _call(context: Context, node: ast.Call) -> Any:
    function = evaluate(context, node.func)
    arguments: list[Any] = []
    for part in node.args:
        if isinstance(part, ast.Starred):
            arguments += sequence(evaluate(context, part.value))
        elif isinstance(part, ast.GeneratorExp):
            arguments.append(Known(_comprehended(context, part.elt, part.generators), context.region))
        else:
            arguments.append(evaluate(context, part))
    named: dict[str, Any] = {}
    for keyword in node.keywords:
        value = evaluate(context, keyword.value)
        if keyword.arg is not None:
            named[keyword.arg] = value
        elif isinstance(value, dict):
            named |= value
        else:
            return refuse("** of a value that is not known in a call")
    return call(context, function, arguments, named, node)


def _attribute(context: Context, node: ast.Attribute) -> Any:
    value = evaluate(context, node.value)
    if isinstance(value, Number | Home | WithTail):
        return refuse(f"an attribute {node.attr!r} of a number")
    if isinstance(value, Ring | list) and node.attr == "append":
        return ("append", value)
    if hasattr(value, "use") and node.attr == "append":
        return ("append", value)
    return getattr(value, node.attr)


def _subscript(context: Context, node: ast.Subscript) -> Any:
    return item_of(context, evaluate(context, node.value), node.slice)


def item_of(context: Context, holder: Any, place: ast.expr) -> Any:
    """Return an element or a slice."""
    if isinstance(place, ast.Slice):
        bounds = [None if x is None else evaluate(context, x) for x in (place.lower, place.upper, place.step)]
        return _sliced(holder, bounds)
    index = evaluate(context, place)
    if isinstance(holder, Home):
        return holder.values[index]
    if isinstance(holder, WithTail) and not isinstance(index, Number):
        return holder.head[index]
    if isinstance(holder, Ring):
        return holder.element(text_of(index, "i"))
    if isinstance(index, Number):
        return refuse("an index that is not known")
    return cast(Any, holder)[index]


def _sliced(holder: Any, bounds: list[Any]) -> Any:
    lower, upper, step = bounds
    if isinstance(holder, WithTail):
        if lower == len(holder.head) and upper is None and step is None:
            return holder.tail
        return refuse("this slice of a tuple of unknown length")
    if isinstance(holder, Ring) and upper is None and step is None:
        return Slice(holder, lower or 0)
    if any(isinstance(x, Number) for x in bounds):
        return refuse("a slice that is not known")
    return cast(Any, holder)[slice(*bounds)]


def _tuple(context: Context, node: ast.Tuple) -> Any:
    items: list[Any] = []
    for part in node.elts:
        if isinstance(part, ast.Starred):
            value = evaluate(context, part.value)
            if isinstance(value, Ring | Slice):
                if part is not node.elts[-1]:
                    return refuse("a list of unknown length before the end of a tuple")
                return WithTail(tuple(items), value)
            items += sequence(value)
        else:
            items.append(evaluate(context, part))
    return tuple(items)


def _list(context: Context, node: ast.List) -> Any:
    if not node.elts and context.frame.stream is not None:
        from bender_native.staging.values import Stream

        return Stream(context.frame.stream)
    return Known(_tuple(context, ast.Tuple(node.elts, ast.Load())), context.region)


def _dict(context: Context, node: ast.Dict) -> Any:
    found: dict[Any, Any] = {}
    for key, value in zip(node.keys, node.values, strict=True):
        if key is None:
            return refuse("** in a dict")
        found[evaluate(context, key)] = evaluate(context, value)
    return found


def _list_comprehension(context: Context, node: ast.ListComp) -> Any:
    return Known(_comprehended(context, node.elt, node.generators), context.region)


def _dict_comprehension(context: Context, node: ast.DictComp) -> Any:
    pairs = _comprehended(context, ast.Tuple([node.key, node.value], ast.Load()), node.generators)
    return dict(pairs)


def _comprehended(context: Context, element: ast.expr, generators: list[ast.comprehension]) -> Iterator[Any]:
    def run(level: int) -> Iterator[Any]:
        if level == len(generators):
            yield evaluate(context, element)
            return
        generator = generators[level]
        for value in sequence(evaluate(context, generator.iter)):
            bind(context, generator.target, value)
            tests = [truth(evaluate(context, test)) for test in generator.ifs]
            if any(isinstance(test, Number) for test in tests):
                refuse("a comprehension with a condition that is not known")
            if all(tests):
                yield from run(level + 1)

    names = dict(context.frame.names)
    found = list(run(0))
    context.frame.names = names
    return iter(found)


def bind(context: Context, target: ast.expr, value: Any) -> None:
    """Give names to a value, each number in it to a C constant where it is an expression.

    Raises:
        TranslationError: the target is not one that the translator knows.
    """
    if isinstance(target, ast.Name):
        context.frame.names[target.id] = named(context, target.id, value)
    elif isinstance(target, ast.Tuple | ast.List):
        items = list(sequence(value))
        if any(isinstance(x, ast.Starred) for x in target.elts) or len(items) != len(target.elts):
            raise context.error(target, f"found {len(items)} values for {ast.unparse(target)!r}")
        # all of the right side is there before any name on the left changes
        items = [
            x if isinstance(t, ast.Name) else named(context, "t", x) for x, t in zip(items, target.elts, strict=True)
        ]
        for part, item in zip(target.elts, items, strict=True):
            bind(context, part, item)
    elif isinstance(target, ast.Subscript):
        store(context, evaluate(context, target.value), evaluate(context, target.slice), value, target)
    elif isinstance(target, ast.Attribute):
        holder = evaluate(context, target.value)
        setattr(holder, target.attr, named(context, target.attr, value))
    else:
        raise context.error(target, f"found {ast.unparse(target)!r} on the left")


def store(context: Context, holder: Any, index: Any, value: Any, node: ast.AST) -> None:
    """Put a value into a list."""
    if isinstance(holder, Home):
        _store_in_home(context, holder.values[index], value, node)
    elif isinstance(holder, Known) and not isinstance(index, Number):
        if holder.region != context.region[: len(holder.region)] or holder.region != context.region:
            raise context.error(node, "found a list that is changed on one of several ways")
        holder[index] = named(context, "t", value)
    elif isinstance(holder, dict) and not is_staged(index):
        holder[index] = value
    else:
        raise context.error(node, f"found a change of a {type(holder).__name__}")


def _store_in_home(context: Context, place: Any, value: Any, node: ast.AST) -> None:
    from bender_native.staging.rings import copied_into

    if isinstance(place, WithTail):
        head, tail = (value.head, value.tail) if isinstance(value, WithTail) else (value[: len(place.head)], ())
        _store_in_home(context, place.head, head, node)
        copied_into(context, place.tail, tail)
        return
    if isinstance(place, Number):
        context.emit(f"{place.text} = {text_of(value, place.kind)};")
        if context.dual:
            from bender_native.staging.context import dot_of

            context.emit(f"{place.dot} = {dot_of(value)};")
        return
    if len(place) != len(value):
        raise context.error(node, "found a state whose length changes")
    # a number that is read from the home itself stays as it is
    for old, new in zip(place, value, strict=True):
        if not (isinstance(new, Number) and isinstance(old, Number) and new.text == old.text):
            _store_in_home(context, old, new, node)


def named(context: Context, hint: str, value: Any) -> Any:
    """Return a value with every expression in it put into a C constant."""
    if isinstance(value, Number):
        return context.kept(hint, value)
    if isinstance(value, Known):
        region, items = value.region, [named(context, hint, x) for x in value]
        value[:] = items
        value.region = region
        return value
    if isinstance(value, tuple) and not (value and value[0] == "append"):
        items = [named(context, f"{hint}_{k}", x) for k, x in enumerate(value)]
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    return value


def _joined_text(context: Context, node: ast.JoinedStr) -> Any:
    pieces: list[Any] = []
    for part in node.values:
        if isinstance(part, ast.Constant):
            pieces.append(str(part.value))
            continue
        assert isinstance(part, ast.FormattedValue)
        value = evaluate(context, part.value)
        style = "" if part.format_spec is None else ast.literal_eval(ast.unparse(part.format_spec).lstrip("f"))
        if isinstance(value, Message):
            pieces += value.pieces
        elif isinstance(value, Number):
            pieces.append((value, style))
        elif is_staged(value):
            pieces.append("?")
        else:
            pieces.append(format(repr(value) if part.conversion == ord("r") else value, style))
    if all(isinstance(piece, str) for piece in pieces):
        return "".join(pieces)
    return Message(pieces)


_EXPRESSIONS: dict[type, Any] = {
    ast.Constant: _constant,
    ast.Name: _name,
    ast.BinOp: _binary,
    ast.UnaryOp: _unary,
    ast.Compare: _comparison,
    ast.BoolOp: _logical,
    ast.IfExp: _conditional,
    ast.Call: _call,
    ast.Attribute: _attribute,
    ast.Subscript: _subscript,
    ast.Tuple: _tuple,
    ast.List: _list,
    ast.Dict: _dict,
    ast.ListComp: _list_comprehension,
    ast.GeneratorExp: _list_comprehension,
    ast.DictComp: _dict_comprehension,
    ast.JoinedStr: _joined_text,
}
