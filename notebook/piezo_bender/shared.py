"""What the results of a notebook share: axes to draw into, tables of pandas, a table in HTML."""

import functools
import html
import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from numbers import Real
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


def kind_of(found: object) -> str:
    """Return what something is, for a sentence: `a list`, `an OvenModel`."""
    name = type(found).__name__
    return f"{'an' if name[0] in 'aeiouAEIOU' else 'a'} {name}"


def require_text(name: str, found: object, example: str) -> None:
    """Refuse what is no text, where it is given.

    Raises:
        InputError: naming the argument, what was found and what was expected.
    """
    if found is not None and not isinstance(found, str):
        raise InputError(f"{name}: found {kind_of(found)}, expected text such as {example!r}")


def require_number(name: str, found: object, what: str = "number") -> None:
    """Refuse what is no number.

    Raises:
        InputError: naming the argument, what was found and what was expected.
    """
    if isinstance(found, bool) or not isinstance(found, Real):
        raise InputError(f"{name}: found {found!r}, expected a {what}")


def share_of(name: str, found: object) -> float:
    """Return a share that is given as a number or in per cent.

    Raises:
        InputError: it is neither.
    """
    text, per = (found.strip(), 1.0) if isinstance(found, str) else ("", 1.0)
    if text.endswith("%"):
        text, per = text[:-1], 0.01
    try:
        if isinstance(found, bool) or not isinstance(found, str | Real):
            raise ValueError
        return per * float(text or found)
    except ValueError:
        raise InputError(f"{name}: found {found!r}, expected a share such as 0.005 or '0.5%'") from None


def is_table(given: object) -> bool:
    """Return whether something has named columns: a DataFrame or a mapping, no Series."""
    return isinstance(given, Mapping) or hasattr(given, "columns")


ARGUMENTS = {
    "further-input": "further", "highest-voltage": "highest_V", "input": "input_name", "output": "output_name",
    "set": "parameters", "setpoint": "setpoint_um", "suspect": "suspects", "voltage-limits": "lower_V and upper_V",
    "rate": "rate_Hz", "fmu": "fmu", "duration": "duration_s", "exposure": "exposure_s", "noise": "noise_um",
    "latency": "latency_frames", "gain-error": "gain_error_percent",
}  # fmt: skip
"""Arguments in Python that are not called as the option of the command line."""
_OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)")
_CALLS = {
    "calibrate-model": "calibrate(records, fmu, suspects)", "compare": "compare(record, model)",
    "diagnose": "diagnose(records, model)", "effects": "effects()", "fmu build": "build_fmu(model)",
    "hil": "run_bench(bench)", "identify": "identify(records)", "model fit": "fit_model(records)",
    "simulate": "simulate_loop(gains, model)", "tune": "tune(model)", "watch": "watch(records, model, training=first)",
}  # fmt: skip
"""Functions that do what a command does."""
_COMMAND = re.compile(rf"(?<![\w-])bender ({'|'.join(_CALLS)})(?![\w-]| [\w./-]*\.\w| --)")


def options_as_arguments(sentence: str) -> str:
    """Return a sentence of the command line with functions in the place of commands, arguments in that of options."""
    told = _COMMAND.sub(lambda x: _CALLS[x[1]], sentence)
    return _OPTION.sub(lambda x: ARGUMENTS.get(x[1], x[1].replace("-", "_")), told)


def name_arguments_in_errors(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function of the door name arguments where the command line names options; no progress is as silent."""

    @functools.wraps(function)
    def called(*args: P.args, **settings: P.kwargs) -> R:
        if settings.get("progress", silent) is None:
            del settings["progress"]
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
