"""What the results of a notebook share: axes to draw into, tables of pandas, a table in HTML."""

import functools
import html
import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from bender_loop.errors import InputError, RunError
from bender_loop.shell.extras import install_command
from bender_report.drawing import require_drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

P = ParamSpec("P")
R = TypeVar("R")
Progress = Callable[[str], None]
"""Told what is being done, a few words."""


def silent(text: str) -> None:
    """Report to nobody."""


def axes_or_new(axes: "Axes | None", width_in: float = 9.0, height_in: float = 4.0) -> "Axes":
    """Return the axes that were given, else those of a new figure.

    Raises:
        InputError: matplotlib is not installed.
    """
    if axes is not None:
        return axes
    require_drawing("plot")
    from matplotlib import pyplot

    return pyplot.subplots(figsize=(width_in, height_in), layout="constrained")[1]


def frame_of(columns: Mapping[str, Any]) -> "DataFrame":
    """Return columns as a DataFrame.

    Raises:
        InputError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ModuleNotFoundError:
        raise InputError(f"to_frame needs pandas: {install_command('notebook')}") from None
    return pd.DataFrame(dict(columns))


def interval_frame(rows: Sequence[Mapping[str, Any]], keys: Sequence[str], interval: str) -> "DataFrame":
    """Return a row for each entry, its interval as the columns low_95 and high_95; NaN where it is not known."""
    columns = {key: [row[key] for row in rows] for key in keys}
    ends = [row[interval] or (None, None) for row in rows]
    frame = frame_of(columns | {"low_95": [x for x, _ in ends], "high_95": [x for _, x in ends]})
    numbers = [x for x in ("value", "before", "after", "std", "low_95", "high_95") if x in frame]
    return frame.astype(dict.fromkeys(numbers, float))


def html_table(heading: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a small table as HTML."""
    head = "".join(f"<th>{html.escape(x)}</th>" for x in columns)
    body = "".join(f"<tr>{''.join(f'<td>{_cell(x)}</td>' for x in row)}</tr>" for row in rows)
    return f"<p><b>{html.escape(heading)}</b></p><table><tr>{head}</tr>{body}</table>"


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "–" if value is None else html.escape(str(value))


def one_of(name: str, found: str, allowed: Sequence[str]) -> None:
    """Refuse a word that is none of those that are known.

    Raises:
        InputError: naming the argument, what was found and what was expected.
    """
    if found not in allowed:
        raise InputError(f"{name}: found {found!r}, expected one of {', '.join(allowed)}")


ARGUMENTS = {
    "further-input": "further", "highest-voltage": "highest_V", "input": "input_name", "output": "output_name",
    "set": "parameters", "setpoint": "setpoint_um", "suspect": "suspects", "voltage-limits": "lower_V and upper_V",
    "rate": "rate_Hz", "fmu": "fmu", "duration": "duration_s", "exposure": "exposure_s", "noise": "noise_um",
    "latency": "latency_frames", "gain-error": "gain_error_percent",
}  # fmt: skip
"""Arguments in Python that are not called as the option of the command line."""
_OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)")


def options_as_arguments(sentence: str) -> str:
    """Return a sentence of the command line with arguments in the place of options."""
    return _OPTION.sub(lambda x: ARGUMENTS.get(x[1], x[1].replace("-", "_")), sentence)


def name_arguments_in_errors(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function of the door name arguments where the command line names options."""

    @functools.wraps(function)
    def called(*args: P.args, **settings: P.kwargs) -> R:
        try:
            return function(*args, **settings)
        except (InputError, RunError) as error:
            said = options_as_arguments(str(error))
            if said == str(error):
                raise
            raise type(error)(said) from error

    return called


def shows_settings(settings: type, names: Sequence[str] = ()) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let `**settings` of a function be seen, and completed, as the fields of a dataclass: all, or those of `names`."""

    def shown(function: Callable[P, R]) -> Callable[P, R]:
        own = inspect.signature(function)
        given = [x for x in own.parameters.values() if x.kind is not inspect.Parameter.VAR_KEYWORD]
        more = [
            inspect.Parameter(
                x.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if x.default is MISSING else x.default,
                annotation=x.type,
            )
            for x in fields(settings)
            if x.name not in own.parameters and (not names or x.name in names)
        ]
        function.__signature__ = own.replace(parameters=[*given, *more])  # pyright: ignore[reportFunctionMemberAccess]
        return function

    return shown
