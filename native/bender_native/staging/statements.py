"""Statements of Python: branches, loops, returns and refusals."""

import ast
from typing import Any, cast

from bender_native.staging.arithmetic import truth
from bender_native.staging.calls import Closure, NothingKnownError, call, inlined
from bender_native.staging.calls import _bound as bound_names
from bender_native.staging.context import Braces, Context, Frame, Later, Loop, bare_function, dot_of, source_of, text_of
from bender_native.staging.expressions import Message, bind, combined, evaluate, named, placed
from bender_native.staging.rings import copied_into, copy_of, width_of
from bender_native.staging.values import (
    Counted,
    Known,
    Number,
    Ring,
    Slot,
    Stream,
    UnjoinableError,
    UntranslatableError,
    is_staged,
    joined,
    kind_of,
    leaves,
    mapped,
)

_RING_DOUBLES = 8192


def run(context: Context, statements: list[ast.stmt]) -> bool:
    """Write statements; returns whether the end of them is never reached.

    Raises:
        TranslationError: the translator does not know one.
    """
    for statement in statements:
        handler = _STATEMENTS.get(type(statement))
        if handler is None:
            raise context.error(statement, f"found {type(statement).__name__}")
        try:
            if handler(context, statement):
                return True
        except (UntranslatableError, UnjoinableError) as found:
            raise context.error(statement, f"found {ast.unparse(statement).splitlines()[0]!r} ({found})") from None
    return False


def _nothing(context: Context, node: ast.stmt) -> bool:
    del context, node
    return False


def _assign(context: Context, node: ast.Assign) -> bool:
    value = evaluate(context, node.value)
    if len(node.targets) > 1:
        value = named(context, "t", value)
    for target in node.targets:
        bind(context, target, value)
    return False


def _annotated(context: Context, node: ast.AnnAssign) -> bool:
    if node.value is not None:
        bind(context, node.target, evaluate(context, node.value))
    return False


def _augmented(context: Context, node: ast.AugAssign) -> bool:
    old = evaluate(context, node.target if not isinstance(node.target, ast.Name) else ast.Name(node.target.id))
    value = evaluate(context, node.value)
    if isinstance(old, Known) and isinstance(node.op, ast.Add):
        if isinstance(value, Ring):
            if len(old):
                raise context.error(node, "found a list that gains one of unknown length")
            bind(context, node.target, value)
            return False
        if old.region != context.region:
            raise context.error(node, "found a list that grows on one of several ways")
        old += [named(context, "element", x) for x in value]
        return False
    if isinstance(old, Ring):
        from bender_native.staging.rings import appended

        for element in value:
            appended(context, old, element)
        return False
    bind(context, node.target, combined(context, node.op, old, value))
    return False


def _expression(context: Context, node: ast.Expr) -> bool:
    if not isinstance(node.value, ast.Constant):
        evaluate(context, node.value)
    return False


def _return(context: Context, node: ast.Return) -> bool:
    frame = context.frame
    value = None if node.value is None else evaluate(context, node.value)
    if frame.stream is not None:
        if not isinstance(value, Stream):
            for element in cast(Any, value):
                frame.stream(named(context, "element", element))
        value = None
    if frame.returns is not None:
        value = _copied_out(context, named(context, "result", value))
    later = Later(value)
    (context.function.returns if frame.returns is None else frame.returns).append(later)
    context.emit(later)
    return True


def _copied_out(context: Context, value: Any) -> Any:
    """Return a value with copies of what it holds of the state: the state may change before it is used."""

    def copied(leaf: Any) -> Any:
        if not (isinstance(leaf, Number) and leaf.text.startswith("m->state.")):
            return leaf
        return context.variable("kept", leaf.kind, constant_text=leaf.text, dot=leaf.dot)

    return mapped(value, copied)


def _raise(context: Context, node: ast.Raise) -> bool:
    if isinstance(node.exc, ast.Call) and node.exc.args:
        found = evaluate(context, node.exc.args[0])
        if context.function.uses_model:
            context.emit(said(context, found))
    later = Later(None)
    context.function.fails.append(later)
    context.emit(later)
    return True


def said(context: Context, found: Any) -> str:
    """Return the C statement that keeps a sentence as the reason of a failure."""
    pieces = found.pieces if isinstance(found, Message) else [str(found)]
    text, arguments = "", []
    for piece in pieces:
        if isinstance(piece, str):
            text += piece.replace("%", "%%")
        else:
            number, style = piece
            kept = context.kept("t", number)
            if style == "g":
                text += "%g"
                arguments.append(text_of(kept, "d"))
            else:
                text += "%s"
                arguments.append(f"py_repr({text_of(kept, 'd')}, (char[40]){{0}})")
    quoted = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
    words = ", ".join(["m", f'"{quoted}"', *arguments])
    return f"say({words});"


def _if(context: Context, node: ast.If) -> bool:
    test = truth(evaluate(context, node.test))
    if not isinstance(test, Number):
        return run(context, node.body if test else node.orelse)
    _grow_apart(context, [*node.body, *node.orelse])
    frame = context.frame
    before = frame.names
    test = context.kept("test", test) if context.dual else test
    ways: list[tuple[list[Any], dict[str, Any], bool]] = []
    for body in (node.body, node.orelse):
        frame.names = dict(before)
        with context.branch() as lines:
            try:
                ended = run(context, body)
            except NothingKnownError:
                ended = True
        ways.append((lines, frame.names, ended))
    (then, after_then, then_ended), (otherwise, after_otherwise, otherwise_ended) = ways
    if then_ended and otherwise_ended:
        frame.names = before
    elif then_ended or otherwise_ended:
        frame.names = after_otherwise if then_ended else after_then
    else:
        frame.names = {}
        for name in after_then:
            if name in after_otherwise:
                frame.names[name] = _joined_name(
                    context, name, [after_then[name], after_otherwise[name]], [then, otherwise]
                )
    context.emit(Braces(f"if ({_inner(test.text)})", then))
    if otherwise:
        context.emit(Braces("else", otherwise))
    return then_ended and otherwise_ended


def _inner(text: str) -> str:
    from bender_native.staging.context import bare

    return bare(text)


def _joined_name(context: Context, name: str, values: list[Any], ends: list[list[Any]]) -> Any:
    if all(value is values[0] for value in values):
        return values[0]
    slots: list[list[Any]] = []
    try:
        shape = joined(values, slots)
        return placed(context, shape, slots, ends, name)
    except (UnjoinableError, UntranslatableError) as found:
        return UnjoinableError(str(found))


def _assigned(statements: list[ast.stmt]) -> list[str]:
    """List the names that statements give values to, those of functions inside left out."""
    found: list[str] = []
    for statement in statements:
        for node in ast.walk(statement):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id not in found:
                found.append(node.id)
    return found


def _grow_apart(context: Context, statements: list[ast.stmt]) -> None:
    """Turn every list that grows inside into one of a length that is not known."""
    for statement in statements:
        for node in ast.walk(statement):
            name = None
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "append":
                name = node.func.value.id if isinstance(node.func.value, ast.Name) else None
            if name is None or not isinstance(context.frame.names.get(name), Known):
                continue
            known = context.frame.names[name]
            element = next(arg for arg in node.args) if isinstance(node, ast.Call) else None
            width = width_of(known) if known else len(element.elts) if isinstance(element, ast.Tuple) else 1
            context.frame.names[name] = copy_of(context, known, name, _RING_DOUBLES, width)


def _breaks(statements: list[ast.stmt]) -> bool:
    """Return whether a loop with this body is left or cut short from inside."""
    for statement in statements:
        if isinstance(statement, ast.Break | ast.Continue):
            return True
        if isinstance(statement, ast.If | ast.With) and _breaks([*statement.body, *getattr(statement, "orelse", [])]):
            return True
    return False


class _Carried:
    """The names that a C loop hands from turn to turn, each number in a variable of its own."""

    def __init__(self, context: Context, names: list[str]) -> None:
        self.context = context
        self.frame: Frame = context.frame
        self.names: dict[str, list[Number]] = {}
        for name in names:
            old = self.frame.names.get(name)
            if old is None or any(isinstance(leaf, Ring | Stream) for leaf in leaves(old)):
                continue
            if any(not kind_of(leaf) for leaf in leaves(old)):
                continue
            variables: list[Number] = []

            def declared(leaf: Any, name: str = name, variables: list[Number] = variables) -> Number:
                kind = kind_of(leaf)
                made = context.variable(name, kind)
                context.assign(made.text, kind, leaf)
                variables.append(made)
                return made

            self.frame.names[name] = mapped(old, declared)
            self.names[name] = variables
        self.values = {name: self.frame.names[name] for name in self.names}

    def sync(self) -> None:
        """Write the values at the end of a turn into the variables."""
        context = self.context
        pairs: list[tuple[Number, Any]] = []
        for name, variables in self.names.items():
            found = [leaf for leaf in leaves(self.frame.names[name])]
            if len(found) != len(variables):
                raise UntranslatableError(f"{name!r} changes its shape in a loop")
            for variable, value in zip(variables, found, strict=True):
                if isinstance(value, Number) and value.text == variable.text:
                    continue
                if variable.kind != "d" and kind_of(value) != variable.kind:
                    raise UntranslatableError(f"{name!r} changes from whole numbers to others in a loop")
                pairs.append((variable, value))
        targets = {variable.text for variable, _ in pairs}
        crossing = any(isinstance(value, Number) and value.text in targets for _, value in pairs)
        if crossing:
            held = []
            for variable, value in pairs:
                dot = dot_of(value) if context.dual and variable.kind == "d" else None
                text = text_of(value, variable.kind)
                held.append((variable, context.variable("next", variable.kind, constant_text=text, dot=dot)))
            pairs = held
        for variable, value in pairs:
            context.assign(variable.text, variable.kind, value)

    def reset(self) -> None:
        """Have the names mean the variables again."""
        self.frame.names.update(self.values)


def _looped(context: Context, head: str, body: list[ast.stmt], before: Any, test: ast.expr | None) -> None:
    """Write a C loop around a body."""
    frame = context.frame
    _grow_apart(context, body)
    carried = _Carried(context, [name for name in _assigned(body) if name in frame.names])
    outside = dict(frame.names)
    context.loops.append(Loop(carried.sync))
    with context.branch() as lines:
        if test is not None:
            condition = truth(evaluate(context, test))
            if isinstance(condition, Number):
                context.emit(f"if (!{condition.text})")
                context.emit("    break;")
        before()
        if not run(context, body):
            carried.sync()
    context.loops.pop()
    frame.names = outside
    carried.reset()
    context.emit(Braces(head, lines))


def _while(context: Context, node: ast.While) -> bool:
    if node.orelse:
        raise context.error(node, "found while with else")
    endless = isinstance(node.test, ast.Constant) and node.test.value is True
    _looped(context, "for (;;)", node.body, lambda: None, None if endless else node.test)
    return endless and not _breaks(node.body)


def _for(context: Context, node: ast.For) -> bool:
    if node.orelse:
        raise context.error(node, "found for with else")
    if isinstance(node.iter, ast.Call) and _streamed(context, node, node.iter):
        return False
    items = evaluate(context, node.iter)
    if isinstance(items, Counted):
        _counted(context, node, items.begin, items.end, items.stride)
    elif isinstance(items, Ring):
        k = context.fresh("k")
        count = context.variable("count", "i", constant_text=items.count)
        element = items.element(k)
        head = f"for (long long {k} = 0; {k} < {count.text}; {k} += 1)"
        _looped(context, head, node.body, lambda: bind(context, node.target, element), None)
    elif isinstance(items, range) and _breaks(node.body):
        _counted(context, node, items.start, items.stop, items.step)
    elif _breaks(node.body):
        raise context.error(node, "found break or continue in a loop over a list")
    else:
        for item in items:
            bind(context, node.target, item)
            if run(context, node.body):
                return True
    return False


def _counted(context: Context, node: ast.For, begin: Any, end: Any, stride: int) -> None:
    k = context.fresh(node.target.id if isinstance(node.target, ast.Name) else "k")
    limit = context.kept("limit", end) if isinstance(end, Number) and not end.in_model else end
    if isinstance(end, Number) and end.in_model:
        limit = context.variable("limit", "i", constant_text=end.text)
    head = f"for (long long {k} = {text_of(begin, 'i')}; {k} < {text_of(limit, 'i')}; {k} += {stride})"
    _looped(context, head, node.body, lambda: bind(context, node.target, Number(k, "i")), None)


def _streamed(context: Context, node: ast.For, source: ast.Call) -> bool:
    """Write a loop over the list that a function makes as that function, with the body where it appends."""
    from types import FunctionType

    function = bare_function(evaluate(context, source.func))
    if not isinstance(function, FunctionType) or "list[" not in str(function.__annotations__.get("return", "")):
        return False
    if not any(isinstance(inside, ast.While) for inside in ast.walk(source_of(function)[0])):
        return False
    arguments = [evaluate(context, x) for x in source.args]
    if source.keywords or not is_staged(arguments):
        return False
    consumer = context.frame
    carried = _Carried(context, [name for name in _assigned(node.body) if name in consumer.names])

    def use(element: Any) -> None:
        producer = context.frame
        context.frame = consumer
        outside = dict(consumer.names)
        bind(context, node.target, element)
        if run(context, node.body):
            raise context.error(node, "found a return or break in a loop over the list of a function")
        carried.sync()
        consumer.names = outside
        carried.reset()
        context.frame = producer

    tree, file, line = source_of(function)
    names = bound_names(function, tree, [named(context, "t", x) for x in arguments], {})
    inlined(context, Frame(function.__qualname__, file, line, names, [function.__globals__], stream=use), tree)
    return True


def _break(context: Context, node: ast.Break) -> bool:
    del node
    context.loops[-1].sync()
    context.emit("break;")
    return True


def _continue(context: Context, node: ast.Continue) -> bool:
    del node
    context.loops[-1].sync()
    context.emit("continue;")
    return True


def _function(context: Context, node: ast.FunctionDef) -> bool:
    context.frame.names[node.name] = Closure(node, context.frame)
    return False


_STATEMENTS: dict[type, Any] = {
    ast.Assign: _assign,
    ast.AnnAssign: _annotated,
    ast.AugAssign: _augmented,
    ast.Expr: _expression,
    ast.Return: _return,
    ast.Raise: _raise,
    ast.If: _if,
    ast.While: _while,
    ast.For: _for,
    ast.Break: _break,
    ast.Continue: _continue,
    ast.FunctionDef: _function,
    ast.Delete: _nothing,
    ast.Pass: _nothing,
}

__all__ = ["Slot", "call", "copied_into", "run"]
