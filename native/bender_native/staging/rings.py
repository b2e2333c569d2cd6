"""Lists of a length that is known at run time only: copies and growth, with an error when the array is full."""

from typing import Any

from bender_native.staging.context import Braces, Context, Later, dot_of, text_of
from bender_native.staging.values import Number, Ring, Slice, refuse


def appended(context: Context, ring: Ring, value: Any) -> None:
    """Append an element; a full ring fails the step."""
    values = list(value) if isinstance(value, tuple) else [value]
    if len(values) != ring.width:
        refuse(f"an element of {len(values)} numbers in a list of {ring.width}")
    later = Later(None)
    context.function.fails.append(later)
    full = f"found more than {ring.capacity // 2} changes under way, expected as many as there is memory for"
    context.emit(Braces(f"if ({ring.count} >= {ring.capacity})", [f'say(m, "{full}");', later]))
    for k, number in enumerate(values):
        place = ring.count if ring.width == 1 else f"{ring.width} * {ring.count} + {k}"
        context.emit(f"{ring.array}[{place}] = {text_of(number, 'd')};")
        if ring.dots is not None:
            context.emit(f"{ring.dots}[{place}] = {dot_of(number)};")
    context.emit(f"{ring.count} += 1;")


def copied_into(context: Context, ring: Ring, source: Any) -> None:
    """Make a ring equal to a ring, to its end, or to a list of known length."""
    if source is ring:
        return
    if isinstance(source, Ring | Slice):
        origin = source.ring if isinstance(source, Slice) else source
        begin = text_of(source.begin, "i") if isinstance(source, Slice) else "0"
        k = context.fresh("k")
        body = [f"{ring.array}[{k}] = {origin.array}[{begin} * {ring.width} + {k}];"]
        if ring.dots is not None:
            body.append(f"{ring.dots}[{k}] = {origin.dots}[{begin} * {ring.width} + {k}];")
        context.emit(
            Braces(f"for (long long {k} = 0; {k} < ({origin.count} - {begin}) * {ring.width}; {k} += 1)", body)
        )
        context.emit(f"{ring.count} = {origin.count} - {begin};")
        return
    context.emit(f"{ring.count} = 0;")
    for value in source:
        appended(context, ring, value)


def copy_of(context: Context, source: Any, hint: str, capacity: int, width: int) -> Ring:
    """Return a new ring with the elements of a ring or a list of known length."""
    ring = context.ring(hint, capacity, width)
    copied_into(context, ring, source)
    return ring


def width_of(values: list[Any]) -> int:
    """Return how many doubles an element of a list takes."""
    return len(values[0]) if values and isinstance(values[0], tuple) else 1


__all__ = ["Number", "appended", "copied_into", "copy_of", "width_of"]
