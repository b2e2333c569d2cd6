"""Python's own functions on numbers that are known at run time only."""

import ast
import builtins
import math
import sys
from collections.abc import Callable
from typing import Any, cast

from bender_native.staging.arithmetic import binary, compared, finite, has_dot, negative, paired, power
from bender_native.staging.context import Context, Later, dot_of, text_of
from bender_native.staging.values import Known, Number, Ring, Slice, WithTail, kind_of, refuse

Handler = Callable[[Context, list[Any]], Any]


def _plain(name: str, slope: str) -> Handler:
    """Return a function of one argument: its name in C, and its derivative with {x} and {r} for argument and result."""

    def handle(context: Context, arguments: list[Any]) -> Number:
        (value,) = arguments
        x = text_of(context.kept("t", value) if has_dot(value) else value, "d")
        if not has_dot(value):
            return Number(f"{name}({x})")
        result = context.variable("t", "d", constant_text=f"{name}({x})")
        return paired(context, result.text, f"chain({slope.format(x=x, r=result.text)}, {dot_of(value)})")

    return handle


def _pow(context: Context, arguments: list[Any]) -> Number:
    a, b = (context.kept("t", x) if has_dot(x) else x for x in arguments)
    return power(context, a, b)


def _copysign(context: Context, arguments: list[Any]) -> Number:
    size, sign = (context.kept("t", x) if isinstance(x, Number) else x for x in arguments)
    text = f"copysign({text_of(size, 'd')}, {text_of(sign, 'd')})"
    if not has_dot(size):
        return Number(text)
    slope = f"copysign(1.0, {text_of(size, 'd')}) * copysign(1.0, {text_of(sign, 'd')})"
    return paired(context, text, f"({slope} * {dot_of(size)})")


def _abs(context: Context, arguments: list[Any]) -> Number:
    (value,) = arguments
    if value.kind != "d":
        return refuse("abs of a whole number")
    if not has_dot(value):
        return Number(f"fabs({value.text})")
    value = context.kept("t", value)
    return paired(context, f"fabs({value.text})", f"({value.text} < 0.0 ? -{value.dot} : {value.dot})")


def _extreme(name: str, symbol: str) -> Handler:
    def handle(context: Context, arguments: list[Any]) -> Any:
        if len(arguments) == 1:
            arguments = list(arguments[0])
        best = arguments[0]
        for value in arguments[1:]:
            if not isinstance(best, Number) and not isinstance(value, Number):
                best = getattr(builtins, name)(best, value)
            elif has_dot(best, value):
                a, b = (context.kept("t", x) if isinstance(x, Number) else x for x in (best, value))
                test = f"{text_of(b, 'd')} {symbol} {text_of(a, 'd')}"
                text = f"py_{name}({text_of(a, 'd')}, {text_of(b, 'd')})"
                best = paired(context, text, f"({test} ? {dot_of(b)} : {dot_of(a)})")
            else:
                best = Number(f"py_{name}({text_of(best, 'd')}, {text_of(value, 'd')})")
        return best

    return handle


def _sum(context: Context, arguments: list[Any]) -> Any:
    items = list(arguments[0])
    total: Any = arguments[1] if len(arguments) > 1 else 0
    if sys.version_info >= (3, 12) and not has_dot(*items):
        # this Python adds with compensation, and so must the C
        name = context.fresh("sum")
        context.emit(f"py_sum_t {name} = {{{text_of(total, 'd')}, 0.0}};")
        for item in items:
            context.emit(f"{name} = py_sum_add({name}, {text_of(item, 'd')});")
        return Number(f"py_sum_end({name})")
    for item in items:
        known = not isinstance(total, Number) and not isinstance(item, Number)
        total = cast(Any, total) + item if known else binary(context, ast.Add(), total, item)
    return total


def _round(context: Context, arguments: list[Any]) -> Number:
    if len(arguments) != 1:
        return refuse("round to digits")
    return Number(f"py_round({text_of(arguments[0], 'd')})")


def _floor(context: Context, arguments: list[Any]) -> Number:
    # Python gives a whole number, which has no negative zero
    return Number(f"py_floor({text_of(arguments[0], 'd')})")


def _int(context: Context, arguments: list[Any]) -> Number:
    (value,) = arguments
    if value.kind != "d":
        return Number(value.text, "i")
    value = context.kept("t", value)
    context.emit(f"if (!({value.text} > -9e15 && {value.text} < 9e15))")
    later = Later(None)
    context.function.fails.append(later)
    context.emit(later)
    return Number(f"((long long){value.text})", "i")


def _float(context: Context, arguments: list[Any]) -> Number:
    (value,) = arguments
    return value if value.kind == "d" else Number(text_of(value, "d"))


def _isfinite(context: Context, arguments: list[Any]) -> bool | Number:
    (value,) = arguments
    return True if finite(value) else Number(f"(isfinite({value.text}) != 0)", "b")


def _isinstance(context: Context, arguments: list[Any]) -> bool:
    value, kinds = arguments
    standing = {"d": 1.5, "i": 1, "b": True}[value.kind] if isinstance(value, Number) else value
    return isinstance(standing, kinds)


def _len(context: Context, arguments: list[Any]) -> Any:
    (value,) = arguments
    if isinstance(value, Ring):
        return Number(value.count, "i")
    return len(value) if not isinstance(value, WithTail | Slice) else refuse("len of a tuple of unknown length")


def _any(context: Context, arguments: list[Any]) -> Any:
    found: Any = False
    for value in arguments[0]:
        if isinstance(value, Number):
            found = value if found is False else Number(f"({found.text} || {value.text})", "b")
        elif value:
            return True
    return found


def _bool(context: Context, arguments: list[Any]) -> Any:
    return compared(ast.NotEq(), arguments[0], 0.0)


HANDLERS: dict[Any, Handler] = {
    math.exp: _plain("py_exp", "{r}"),
    math.expm1: _plain("py_expm1", "({r} + 1.0)"),
    math.log1p: _plain("py_log1p", "1.0 / (1.0 + {x})"),
    math.log: _plain("py_log", "1.0 / {x}"),
    math.sqrt: _plain("sqrt", "0.5 / {r}"),
    math.sin: _plain("sin", "cos({x})"),
    math.cos: _plain("cos", "-sin({x})"),
    math.tanh: _plain("tanh", "(1.0 - {r} * {r})"),
    math.pow: _pow,
    math.copysign: _copysign,
    math.fabs: _abs,
    math.isfinite: _isfinite,
    math.floor: _floor,
    abs: _abs,
    min: _extreme("min", "<"),
    max: _extreme("max", ">"),
    sum: _sum,
    round: _round,
    int: _int,
    float: _float,
    isinstance: _isinstance,
    len: _len,
    any: _any,
    bool: _bool,
}
"""How each function of Python is written in C, by the function."""

NATIVE = frozenset({zip, enumerate, reversed, getattr, next, iter, dict, set, repr, str, sorted, id, type})
"""Functions that only move what they are given."""

__all__ = ["HANDLERS", "NATIVE", "Known", "kind_of", "negative"]
