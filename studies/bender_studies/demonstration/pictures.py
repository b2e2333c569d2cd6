"""Pictures that only the demonstration draws."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bender_report.chart import Chart
from bender_report.picture_style import (
    COLOURS,
    NARROW_IN,
    TUNED,
    dress,
    in_both_widths,
    new_figure,
    plain_log_scale,
    to_png,
    write_beside,
    write_title,
)
from bender_tuner.task.tuning import SearchResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = {"bas_printed": "as printed", "bas": "sign corrected", "reliable_bas": "reliable BAS"}
_COLOURS = {"bas_printed": COLOURS["zn"], "bas": COLOURS["simc"], "reliable_bas": TUNED}


def draw_search_race(runs: Mapping[str, Sequence[SearchResult]]) -> bytes:
    """Best value so far over the evaluations: the median over the seeds as a line, all seeds as a band."""
    return to_png(_race_figure(runs))


def race_chart(runs: Mapping[str, Sequence[SearchResult]]) -> Chart:
    """Return the same for a page."""
    label = "Best mean squared error over the evaluations for three forms of the search"
    return in_both_widths("race", label, lambda narrow: _race_figure(runs, narrow))


def _race_figure(runs: Mapping[str, Sequence[SearchResult]], narrow: bool = False) -> "Figure":
    figure = new_figure(NARROW_IN, 5.0) if narrow else new_figure(10.5, 4.6)
    axes = figure.subplots()
    plain_log_scale(axes)
    labels = [_draw_racer(axes, best_so_far(searches), method) for method, searches in runs.items()]
    beetle = "" if narrow else " (three make an iteration of the beetle)"
    dress(axes, x_label=f"evaluation{beetle}", y_label="best MSE so far (µm²)")
    axes.margins(x=0)
    axes.set_xlim(left=0)
    write_beside(axes, labels)
    ends = {method: height for method, (height, _, _) in zip(runs, labels, strict=True)}
    write_title(
        figure,
        f"The search as printed ends {ends['bas_printed'] / ends['reliable_bas']:.0f} times above reliable BAS",
        f"the paper's task: 10 µm step at 100 Hz, MSE (28); median and range of {len(runs['bas_printed'])} seeds",
    )
    return figure


def _draw_racer(axes: "Axes", best: NDArray[np.float64], method: str) -> tuple[float, str, str]:
    """Draw one method; returns its label: height, text, colour."""
    colour, count, median = _COLOURS[method], np.arange(1, best.shape[1] + 1), np.median(best, axis=0)
    axes.fill_between(count, best.min(axis=0), best.max(axis=0), step="post", color=colour, alpha=0.15, lw=0)
    axes.step(count, median, where="post", color=colour, lw=2.2)
    return float(median[-1]), f"{_NAMES[method]}: {median[-1]:.3g} µm²", colour


def best_so_far(searches: Sequence[SearchResult]) -> NDArray[np.float64]:
    """Best value after each evaluation, shape (seeds, evaluations)."""
    return np.array([[evaluation.best for evaluation in run.history] for run in searches])
