"""The picture of the comparison: one point per run, one line per method, one panel per plant."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bender_studies.tuning.figures import BEETLES, PlantResult, ratio

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BEETLE, OTHER, MEDIAN = "#d1495b", "#8fb8de", "#333333"
SMALLEST = 1e-5
_TICKS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0, 1000.0)
_TARGETS = (0.01, 0.05)


def draw_ratios(results: Sequence[PlantResult]) -> bytes:
    """Draw the ratio to the optimum of every run and return the picture as a PNG file.

    The axis is logarithmic in the excess over 1, so that values close to the optimum can be distinguished; a run
    closer than 1e-5 stands at the left edge. Methods are in the order of their medians, the best on top.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    most = max(len(result.figures) for result in results)
    figure = Figure(figsize=(6.8 * len(results), 1.6 + 0.42 * most), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(results), squeeze=False)[0]
    worst = max(_excess(row.worst_ratio) for result in results for row in result.figures)
    for axes, result in zip(panels, results, strict=True):
        _draw_plant(axes, result, right=3.0 * max(worst, 1e-2))
    seeds = len({run.seed for run in results[0].runs})
    marks = "beetles in red; bar: median; dashed: 1.01, 1.05"
    figure.suptitle(f"MSE found over the optimum, {seeds} runs of each method ({marks})", fontsize=11)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _draw_plant(axes: "Axes", result: PlantResult, right: float) -> None:
    names = [row.method for row in result.figures]
    for place, row in enumerate(result.figures):
        excess = np.array(
            [_excess(run.best_um2 / result.reference_um2) for run in result.runs if run.method == row.method]
        )
        spread = 0.25 * np.linspace(-1.0, 1.0, excess.size) if excess.size > 1 else np.zeros(1)
        colour = BEETLE if row.method in BEETLES else OTHER
        axes.plot(excess, place + spread, "o", ms=4, color=colour, alpha=0.6, mew=0.0)
        median = _excess(row.median_ratio)
        axes.plot([median, median], [place - 0.35, place + 0.35], color=MEDIAN, lw=1.8)
    for place, row in enumerate(result.figures):
        label = f"{ratio(row.median_ratio)} / {ratio(row.worst_ratio)}"
        axes.annotate(label, (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=8)
    for bound in _TARGETS:
        axes.axvline(bound, color="0.75", lw=0.8, ls="--")
    axes.set_xscale("log")
    axes.set_xlim(0.7 * SMALLEST, right)
    shown = [tick for tick in _TICKS if tick <= right]
    axes.set_xticks(shown, [f"{1.0 + tick:g}" for tick in shown], fontsize=8)
    axes.minorticks_off()
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel("ratio to the optimum (right: median / worst)")
    axes.set_title(f"{result.plant.name}: {result.plant.title}", loc="left", fontsize=9)
    axes.grid(True, axis="x", color="0.92", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _excess(value: float) -> float:
    """How far a ratio lies above 1, within what the picture shows."""
    return float(np.clip(value - 1.0, SMALLEST, _TICKS[-1]))
