"""Arithmetic on numbers that are known at run time only, as Python does it, with the derivative beside it."""

import ast
from typing import Any

from bender_native.staging.context import Context, dot_of, text_of
from bender_native.staging.values import Number, kind_of, refuse

_ORDER = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_EQUAL = {ast.Eq: "==", ast.NotEq: "!="}


def has_dot(*values: Any) -> bool:
    """Return whether one of the numbers has a derivative."""
    return any(isinstance(value, Number) and value.dot is not None for value in values)


def paired(context: Context, text: str, dot: str | None) -> Number:
    """Return a double; with a derivative it is put into variables, so that nothing is computed twice."""
    if dot is None:
        return Number(text)
    return context.variable("t", "d", constant_text=text, dot=dot)


def _named(context: Context, value: Any) -> Any:
    return context.kept("t", value) if isinstance(value, Number) else value


def binary(context: Context, operator: ast.operator, a: Any, b: Any) -> Number:
    """Return the result of an operator on two numbers, one of them at least not known.

    Raises:
        UntranslatableError: the operator or the kind of a number is not known to the translator.
    """
    kinds = kind_of(a), kind_of(b)
    if "" in kinds:
        refuse(f"an operator on a {type(a).__name__} and a {type(b).__name__}")
    whole = set(kinds) <= {"i", "b"}
    if has_dot(a, b):
        a, b = _named(context, a), _named(context, b)
    if isinstance(operator, ast.Add | ast.Sub | ast.Mult):
        sign = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}[type(operator)]
        if whole:
            return Number(f"({text_of(a, 'i')} {sign} {text_of(b, 'i')})", "i")
        text = f"({text_of(a, 'd')} {sign} {text_of(b, 'd')})"
        if not has_dot(a, b):
            return Number(text)
        if sign == "*":
            parts = [f"{dot_of(x)} * {text_of(y, 'd')}" for x, y in ((a, b), (b, a)) if has_dot(x)]
            return paired(context, text, f"({' + '.join(parts)})")
        return paired(context, text, f"({dot_of(a)} {sign} {dot_of(b)})")
    if isinstance(operator, ast.Div):
        return quotient(context, a, b)
    if isinstance(operator, ast.Pow):
        return power(context, a, b)
    return refuse(f"the operator {type(operator).__name__}")


def quotient(context: Context, a: Any, b: Any) -> Number:
    """Return a / b; where Python raises for a division by zero, NaN is handed on."""
    over, under = text_of(a, "d"), text_of(b, "d")
    nonzero = (not isinstance(b, Number) and float(b) != 0.0) or (
        isinstance(b, Number) and (b.low > 0.0 or b.high < 0.0)
    )
    text = f"({over} / {under})" if nonzero else f"py_div({over}, {under})"
    if not has_dot(a, b):
        return Number(text)
    value = context.variable("t", "d", constant_text=text)
    slope = f"({dot_of(a)} - chain({value.text}, {dot_of(b)}))" if has_dot(b) else dot_of(a)
    return paired(context, value.text, f"chain(1.0 / {under}, {slope})")


def power(context: Context, a: Any, b: Any) -> Number:
    """Return a ** b as C's `pow` gives it; where Python raises, NaN is handed on."""
    x, y = text_of(a, "d"), text_of(b, "d")
    text = f"py_pow({x}, {y})"
    if not has_dot(a, b):
        return Number(text)
    parts = []
    if has_dot(a):
        parts.append(f"chain(slope_of_pow({x}, {y}), {dot_of(a)})")
    if has_dot(b):
        parts.append(f"chain({x} > 0.0 ? {text} * log({x}) : 0.0, {dot_of(b)})")
    return paired(context, text, f"({' + '.join(parts)})")


def negative(context: Context, a: Number) -> Number:
    """Return -a."""
    if has_dot(a):
        a = context.kept("t", a)
        return paired(context, f"(-{a.text})", f"(-{a.dot})")
    return Number(f"(-{a.text})", "i" if a.kind == "b" else a.kind, None, -a.high, -a.low)


def truth(value: Any) -> bool | Number:
    """Return whether a value is true."""
    if isinstance(value, Number):
        return value if value.kind == "b" else Number(f"({value.text} != {'0.0' if value.kind == 'd' else '0'})", "b")
    return bool(value)


def compared(operator: ast.cmpop, a: Any, b: Any) -> bool | Number:
    """Return the result of a comparison of which one side at least is not known."""
    if isinstance(operator, ast.Is | ast.IsNot):
        same = a is b
        return same if isinstance(operator, ast.Is) else not same
    symbol = _ORDER.get(type(operator)) or _EQUAL.get(type(operator))
    kinds = kind_of(a), kind_of(b)
    if symbol is None or "" in kinds:
        return refuse(f"a comparison ({type(operator).__name__}) of a {type(a).__name__} and a {type(b).__name__}")
    decided = _decided(symbol, a, b)
    if decided is not None:
        return decided
    kind = "d" if "d" in kinds else "i"
    return Number(f"({text_of(a, kind)} {symbol} {text_of(b, kind)})", "b")


def _bounds(value: Any) -> tuple[float, float]:
    return (value.low, value.high) if isinstance(value, Number) else (float(value), float(value))


def _decided(symbol: str, a: Any, b: Any) -> bool | None:
    """Decide a comparison by the bounds of the parameters, where they do."""
    (a_low, a_high), (b_low, b_high) = _bounds(a), _bounds(b)
    for value in (a, b):
        if isinstance(value, Number) and not finite(value):
            return None
    if symbol in (">", ">="):
        a_low, a_high, b_low, b_high = b_low, b_high, a_low, a_high
        symbol = {">": "<", ">=": "<="}[symbol]
    if symbol == "<":
        return True if a_high < b_low else False if a_low >= b_high else None
    if symbol == "<=":
        return True if a_high <= b_low else False if a_low > b_high else None
    if a_high < b_low or b_high < a_low:
        return symbol == "!="
    return None


def finite(value: Number) -> bool:
    """Return whether a number is finite whenever the code runs, by its bounds."""
    return value.low > float("-inf") and value.high < float("inf")
