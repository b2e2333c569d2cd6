"""The paper's Fig. 9: the gains over the evaluations of a search, and the objective."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.pid import Gains
from bender_report.picture_style import (
    INK,
    MUTED,
    NARROW_IN,
    TUNED,
    colours_for,
    dress,
    new_figure,
    plain_log_scale,
    to_png,
    write_beside,
    write_title,
)
from bender_report.wording import relabelled, unit_text
from bender_tuner.optimisers.methods import METHODS
from bender_tuner.task.problem import OBJECTIVE_UNITS
from bender_tuner.task.tuning import SearchResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Series = NDArray[np.float64]

_PANELS: tuple[tuple[str, Callable[[Gains], float]], ...] = (
    ("Kp (V/µm)", lambda gains: gains.proportional_V_per_um),
    ("Ki (V/(µm s))", lambda gains: gains.integral_V_per_um_s),
    ("Kd (V s/µm)", lambda gains: gains.derivative_V_s_per_um),
)
_TALLEST = 12.0
_HEADROOM = 1.6
_NEAR = 1.01


def draw_convergence(runs: Sequence[SearchResult], objective: str) -> bytes:
    """Draw the gains of the first run and the objective of all; returns a PNG file.

    Dots are the points tried, lines the best so far.

    Args:
        runs: at least one, with at least one evaluation in the first.
        objective: its name.
    """
    return to_png(convergence_figure(runs, objective))


def convergence_figure(runs: Sequence[SearchResult], objective: str, narrow: bool = False) -> "Figure":
    """Return the same as a figure, on demand one for a phone."""
    figure = new_figure(NARROW_IN, 8.0) if narrow else new_figure(10.5, 6.0)
    panels = figure.subplots(4, 1, sharex=True, squeeze=False) if narrow else figure.subplots(2, 2, sharex=True)
    run = runs[0]
    logarithmic = METHODS[run.method].space == "box"
    *gains, last = panels.ravel()
    for axes, (label, pick) in zip(gains, _PANELS, strict=True):
        _draw_gain(axes, run, label, pick, logarithmic=logarithmic)
    _draw_objective(last, runs, objective)
    beetle = "" if narrow else " (three per iteration of beetle antennae search)"
    for axes in panels[-1]:
        axes.set_xlabel(f"evaluation{beetle}", fontsize=9, color=INK)
        axes.set_xlim(0, len(run.history) + 1)
    write_title(figure, _finding(run, objective), "dots: tried, line: best so far")
    return figure


def best_rows(run: SearchResult) -> NDArray[np.intp]:
    """For every evaluation the row of the best one so far; -1 before the first finite one."""
    rows, row, best = [], -1, np.inf
    for place, evaluation in enumerate(run.history):
        if evaluation.best < best:
            row, best = place, evaluation.best
        rows.append(row)
    return np.array(rows, dtype=np.intp)


def _draw_gain(
    axes: "Axes", run: SearchResult, label: str, pick: Callable[[Gains], float], *, logarithmic: bool
) -> None:
    values = np.array([np.nan if e.gains is None else pick(e.gains) for e in run.history])
    count = np.arange(1, values.size + 1)
    rows = best_rows(run)
    best = np.where(rows >= 0, values[rows], np.nan)
    if logarithmic:
        plain_log_scale(axes)
    axes.plot(count, values, ".", color=MUTED, ms=3.5, alpha=0.7)
    _draw_best(axes, best, TUNED)
    dress(axes, y_label=relabelled(label))
    if np.isfinite(best[-1]):
        write_beside(axes, [(best[-1], f"{best[-1]:.3g}", TUNED)])


def _draw_objective(axes: "Axes", runs: Sequence[SearchResult], objective: str) -> None:
    colours = colours_for([run.method for run in runs])
    plain_log_scale(axes)
    tried = _finite([evaluation.value for evaluation in runs[0].history])
    axes.plot(np.arange(1, tried.size + 1), tried, ".", color=MUTED, ms=3.5, alpha=0.7)
    for run in reversed(runs):
        best = _finite([evaluation.best for evaluation in run.history])
        _draw_best(axes, best, colours[run.method])
    unit = unit_text(OBJECTIVE_UNITS[objective])
    dress(axes, y_label=f"objective: {objective}" + (f" ({unit})" if unit else ""))
    found = [run for run in runs if np.isfinite(run.value)]
    if not found:
        return
    floor = min(run.value for run in found)
    ceiling = max(_TALLEST * floor, *(_HEADROOM * run.value for run in found))
    axes.set_ylim(0.93 * floor, ceiling)
    write_beside(
        axes, [(run.value, run.method if len(runs) > 1 else f"{run.value:.3g}", colours[run.method]) for run in found]
    )
    beyond = int(np.count_nonzero(~(tried <= ceiling)))
    if beyond:
        text = f"{beyond} of {tried.size} points lie above"
        axes.annotate(text, (0.99, 0.97), xycoords="axes fraction", ha="right", va="top", fontsize=8, color=MUTED)


def _draw_best(axes: "Axes", best: Series, colour: str) -> None:
    """A staircase whose last tread can be seen too."""
    axes.step(np.arange(1, best.size + 2), np.append(best, best[-1]), where="post", color=colour, lw=2.0)


def _finite(values: list[float]) -> Series:
    array = np.array(values, dtype=float)
    return np.where(np.isfinite(array), array, np.nan)


def _finding(run: SearchResult, objective: str) -> str:
    best = np.array([evaluation.best for evaluation in run.history])
    if not np.isfinite(best[-1]):
        return f"{run.method} found no gains under which the loop holds in {best.size} evaluations"
    first = best[np.isfinite(best)][0]
    if best[-1] == first:
        return f"{run.method} found nothing better than its first point: {objective} objective {first:.3g}"
    arrived = int(np.argmax(best <= _NEAR * best[-1])) + 1
    return (
        f"{run.method}: {objective} objective from {first:.3g} to {best[-1]:.3g}, "
        f"within 1 % of the end after {arrived} of {best.size} evaluations"
    )
