"""The picture of a comparison: simulation over measurement in time and over voltage, and the gap left."""

import io
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.acting_voltage import direction
from bender_loop.records.compare import Comparison, Signal
from bender_report.chart import MOST_POINTS, thinned
from bender_report.palette import light
from bender_report.picture_style import NARROW_IN, is_narrow, new_figure
from bender_report.wording import axis_text, drawable, input_word, relabelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURED, GIVEN, RECALIBRATED, RISING, FALLING = (
    light(name) for name in ("measured", "given", "without", "rising", "falling")
)
# what was measured lies on top of the simulated lines
ON_TOP = 4
_OVER: dict[str, Any] = {"ls": (0, (3, 2)), "zorder": 3}
"""As given, dashed over the recalibrated line, so that both are seen where they are the same."""
MOST_REVERSALS, SHOWN_REVERSALS = 16, 8
COMMON = 0.98
# characters of the heading on a phone
NARROW_LINE = 46


@dataclass(frozen=True, slots=True)
class Overlay:
    """What is drawn: signals of one shape (n,).

    Attributes:
        title: one line, the record's and the model's names.
        axis: time in s, or the row number of an untimed record.
        axis_label: its name with the unit.
        acting_V: the voltage that was acting when a row was read.
        measured_um: with NaN where a frame was lost.
        simulated_um: as the model stands, not recalibrated.
    """

    title: str
    axis: Signal
    axis_label: str
    acting_V: Signal
    measured_um: Signal
    simulated_um: Signal


def draw_overlay(overlay: Overlay, comparison: Comparison) -> bytes:
    """Draw the panels of `overlay_figure` and return them as a PNG file."""
    buffer = io.BytesIO()
    overlay_figure(overlay, comparison).savefig(buffer, format="png")
    return buffer.getvalue()


def overlay_figure(overlay: Overlay, comparison: Comparison, narrow: bool = False) -> "Figure":
    """Draw the panels, on demand one below the other for a phone.

    Above, the overlay in time and the loop over voltage; below, the residual of the recalibrated simulation in time and
    over voltage, apart for rising and falling voltage. A record of many swings has a panel between them with the few
    swings on which the residual is largest; the loop shows these.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    recalibrated_um = comparison.recalibration.apply(overlay.simulated_um)
    residual_um = overlay.measured_um - recalibrated_um
    whole = slice(0, overlay.axis.size)
    shown = window(overlay.acting_V, residual_um)
    has_worst = shown != whole
    rows = ("whole", "worst", "residual") if has_worst else ("whole", "residual")
    if narrow:
        figure = new_figure(NARROW_IN, 2.6 * (len(rows) + 2))
        panels = figure.subplot_mosaic([[name] for name in (*rows[:-1], "loop", "residual", "voltage")])
    else:
        figure = Figure(figsize=(12.0, 10.0 if has_worst else 7.0), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplot_mosaic(
            [[name, "voltage" if name == "residual" else "loop"] for name in rows],
            width_ratios=(1.7, 1.0),
            height_ratios=(*(1.6,) * (len(rows) - 1), 1.0),
        )
    _draw_time(panels["whole"], overlay, recalibrated_um, whole, "overlay, the whole record", has_keys=not narrow)
    if narrow:
        handles, texts = panels["whole"].get_legend_handles_labels()
        figure.legend(handles, texts, loc="outside lower left", fontsize=8.5, frameon=False)
    if has_worst:
        begin, end = overlay.axis[shown][[0, -1]]
        panels["whole"].axvspan(begin, end, color="0.92", zorder=0)
        unit = " s" if overlay.axis_label.endswith("(s)") else ""
        title = f"the swings with the largest residual, {begin:.4g} to {end:.4g}{unit}"
        _draw_time(panels["worst"], overlay, recalibrated_um, shown, title, has_keys=False)
    _draw_loop(panels["loop"], overlay, recalibrated_um, shown)
    _draw_residual(panels["residual"], overlay, residual_um, comparison.recalibrated.rms_um)
    _draw_residual_over_voltage(panels["voltage"], overlay, residual_um)
    _write_heading(figure, overlay, comparison)
    return figure


def reversals(signal: Signal) -> NDArray[np.intp]:
    """Rows where a signal turns round by more than a twentieth of its span, in order."""
    band = 0.05 * float(np.ptp(signal))
    turns: list[int] = []
    extreme, heading = 0, 0
    for row, value in enumerate(signal):
        step = value - signal[extreme]
        if heading == 0:
            heading = int(np.sign(step)) if abs(step) > band else 0
            extreme = row if heading else extreme
        elif step * heading >= 0.0:
            extreme = row
        elif abs(step) > band:
            turns.append(extreme)
            extreme, heading = row, -heading
    return np.asarray(turns, dtype=np.intp)


def window(voltage_V: Signal, residual_um: Signal) -> slice:
    """The rows that can be shown legibly: all, or of many swings the few on which the residual's rms is largest."""
    turns = reversals(voltage_V)
    if turns.size <= MOST_REVERSALS:
        return slice(0, voltage_V.size)
    seen = np.isfinite(residual_um)
    square = np.where(seen, residual_um, 0.0) ** 2
    # a few stray readings do not make swings worth showing
    square = np.minimum(square, np.quantile(square[seen], COMMON))
    energy, count = (np.concatenate([[0.0], np.cumsum(x)]) for x in (square, seen))
    first, last = turns[:-SHOWN_REVERSALS], turns[SHOWN_REVERSALS:]
    mean = (energy[last] - energy[first]) / np.maximum(count[last] - count[first], 1.0)
    worst = int(np.argmax(mean))
    return slice(int(first[worst]), int(last[worst]) + 1)


def _draw_time(
    axes: "Axes", overlay: Overlay, recalibrated_um: Signal, shown: slice, title: str, *, has_keys: bool = True
) -> None:
    measured = overlay.measured_um[shown]
    rows = thinned(measured)
    axis = overlay.axis[shown][rows]
    axes.plot(axis, measured[rows], ".", color=MEASURED, ms=_dot(rows.size), label="measured", zorder=ON_TOP)
    if _is_near(overlay):
        axes.plot(axis, overlay.simulated_um[shown][rows], color=GIVEN, lw=1.6, label="simulated, as given", **_OVER)
    else:
        axes.plot([], [], color=GIVEN, lw=1.6, label="simulated, as given: beyond this picture", **_OVER)
    axes.plot(axis, recalibrated_um[shown][rows], color=RECALIBRATED, lw=1.8, label="simulated, recalibrated")
    axes.set_ylabel(axis_text("displacement (µm)"))
    axes.set_title(title, loc="left", fontsize=10)
    if has_keys:
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=8, frameon=False)
    axes.margins(x=0.01)


def _draw_loop(axes: "Axes", overlay: Overlay, recalibrated_um: Signal, shown: slice) -> None:
    size = overlay.axis[shown].size
    rows = np.arange(shown.start, shown.start + size, max(1, size // MOST_POINTS))
    acting = overlay.acting_V[rows]
    axes.plot(acting, overlay.measured_um[rows], ".", color=MEASURED, ms=_dot(rows.size), zorder=ON_TOP)
    if _is_near(overlay):
        axes.plot(acting, overlay.simulated_um[rows], color=GIVEN, lw=1.2, **_OVER)
    axes.plot(acting, recalibrated_um[rows], color=RECALIBRATED, lw=1.6)
    axes.set_ylabel(axis_text("displacement (µm)"))
    axes.set_title(f"over the acting {input_word()}", loc="left", fontsize=10)


def _draw_residual(axes: "Axes", overlay: Overlay, residual_um: Signal, rms_um: float) -> None:
    rows = thinned(residual_um)
    axes.axhspan(-rms_um, rms_um, color="0.92", label=relabelled(f"± rms, {rms_um:.3g} µm"))
    axes.plot(overlay.axis[rows], residual_um[rows], color=RECALIBRATED, lw=0.8)
    axes.axhline(0.0, color="0.5", lw=0.8)
    axes.set_xlabel(overlay.axis_label)
    axes.set_ylabel(axis_text("residual (µm)"))
    axes.set_title("measured − recalibrated, the whole record", loc="left", fontsize=10)
    axes.legend(loc="lower right", fontsize=8, framealpha=0.9)
    axes.margins(x=0.01)
    _limit_to_the_bulk(axes, residual_um)


def _draw_residual_over_voltage(axes: "Axes", overlay: Overlay, residual_um: Signal) -> None:
    sense = direction(overlay.acting_V)
    stride = max(1, residual_um.size // MOST_POINTS)
    for sign, colour, label in ((1, RISING, "rising"), (-1, FALLING, "falling")):
        rows = np.flatnonzero(sense == sign)[::stride]
        axes.plot(overlay.acting_V[rows], residual_um[rows], ".", color=colour, ms=_dot(2 * rows.size), label=label)
    axes.axhline(0.0, color="0.5", lw=0.8)
    axes.set_xlabel(axis_text("voltage (V)"))
    axes.set_ylabel(axis_text("residual (µm)"))
    axes.set_title(f"the same over the {input_word()}", loc="left", fontsize=10)
    axes.legend(loc="lower right", fontsize=8, framealpha=0.9, markerscale=1.5)
    _limit_to_the_bulk(axes, residual_um)


def _write_heading(figure: "Figure", overlay: Overlay, comparison: Comparison) -> None:
    line, before, after = comparison.recalibration, comparison.before, comparison.recalibrated
    lines = (
        overlay.title,
        f"rms {before.rms_um:.3g} µm as given, {after.rms_um:.3g} µm recalibrated "
        f"(gain × {line.gain:.4g}, offset {line.offset_told_um(before.rms_um):+.4g} µm)",
    )
    shown = [textwrap.fill(x, NARROW_LINE) for x in lines] if is_narrow(figure) else lines
    figure.suptitle(relabelled(drawable("\n".join(shown))), fontsize=10 if is_narrow(figure) else 11)
    for axes in figure.axes:
        if is_narrow(figure):
            axes.set_title(textwrap.fill(axes.get_title("left"), NARROW_LINE), loc="left", fontsize=9)
        axes.grid(True, color="0.9", lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)


def _is_near(overlay: Overlay) -> bool:
    """Whether the simulation as given fits into the picture without flattening everything else."""
    lowest, highest = float(np.nanmin(overlay.measured_um)), float(np.nanmax(overlay.measured_um))
    beyond = max(float(overlay.simulated_um.max()) - highest, lowest - float(overlay.simulated_um.min()))
    return beyond <= 1.5 * (highest - lowest)


def _limit_to_the_bulk(axes: "Axes", residual_um: Signal) -> None:
    """Keep a few outlying rows from flattening the rest, and say how many lie beyond."""
    seen = residual_um[np.isfinite(residual_um)]
    low, high = np.quantile(seen, [0.005, 0.995])
    margin = 0.4 * (high - low)
    beyond = int(np.count_nonzero((seen < low - margin) | (seen > high + margin)))
    if margin == 0.0 or not beyond:
        return
    axes.set_ylim(low - margin, high + margin)
    axes.annotate(f"{beyond} rows beyond", (0.99, 0.96), xycoords="axes fraction", ha="right", va="top", fontsize=8)


def _dot(points: int) -> float:
    return 5.0 if points < 300 else 2.5 if points < 3_000 else 1.5
