"""What the results of a notebook share: axes to draw into, tables of pandas, a table in HTML."""

import html
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

Progress = Callable[[str], None]
"""Told what is being done, a few words."""


def silent(text: str) -> None:
    """Report to nobody."""


def axes_or_new(axes: "Axes | None", width_in: float = 9.0, height_in: float = 4.0) -> "Axes":
    """Return the axes that were given, else those of a new figure."""
    if axes is not None:
        return axes
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
