"""The record before and after: overlay over time, row by row where the gap was largest, and over the voltage."""

from typing import TYPE_CHECKING

import numpy as np

from bender_discrepancy.report.pictured_record import Array, PicturedRecord
from bender_report.chart import WIDE_PX, Chart, Draw, chart, dots, spread, thinned
from bender_report.palette import light
from bender_report.wording import axis_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOP_POINTS = {False: 1600, True: 800}
LINE_POINTS = {False: 1600, True: 700}
# a voltage that moves by less than this part of its span from row to row draws a line, not dots
SMOOTH = 0.12
# the model as given is drawn where it does not flatten the rest
NEAR = 0.5


def overlay(pictured: PicturedRecord) -> Chart:
    """Return the stretch of held-out rows on which the gap was largest, before and after."""

    def draw(figure: "Figure", narrow: bool) -> None:
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        shown = pictured.stretch
        x = pictured.axis[shown]
        if is_near(pictured):
            axes.plot(x, pictured.given_um[shown], color=light("given"), lw=1.3)
        axes.plot(x, pictured.recalibrated_um[shown], color=light("without"), lw=1.5)
        if pictured.corrected:
            axes.plot(x, pictured.after_um[shown], color=light("with"), lw=1.7)
        dots(axes, x, pictured.measured_um[shown], "measured", 2.6 if narrow else 3.4)
        axes.set_ylabel(axis_text("displacement (µm)"))
        axes.margins(x=0.01)
        below.axhspan(-pictured.noise_um, pictured.noise_um, color=light("noise"), lw=0)
        below.plot(x, pictured.without_um[shown], color=light("without"), lw=1.2)
        if pictured.corrected:
            below.plot(x, pictured.with_um[shown], color=light("with"), lw=1.2)
        below.set_ylabel(axis_text("residual (µm)"))
        below.set_xlabel(pictured.axis_label)
        figure.align_ylabels([axes, below])

    return chart("overlay", "measured and simulated displacement over time", draw, WIDE_PX, 430, 360)


def whole(pictured: PicturedRecord) -> Chart | None:
    """Return the whole record, before and after, the stretch of `overlay` shaded; None where that is all of it."""
    if pictured.is_short:
        return None

    def draw(figure: "Figure", narrow: bool) -> None:
        axes = figure.subplots()
        stretch = pictured.axis[pictured.stretch]
        axes.axvspan(stretch[0], stretch[-1], color=light("held"), lw=0)
        lines = [(pictured.recalibrated_um, "without")]
        if pictured.corrected:
            lines.append((pictured.after_um, "with"))
        for simulated, colour in lines:
            rows = thinned(simulated, LINE_POINTS[narrow])
            axes.plot(pictured.axis[rows], simulated[rows], color=light(colour), lw=1.0)
        seen = np.flatnonzero(np.isfinite(pictured.measured_um))
        rows = seen[thinned(pictured.measured_um[seen], LINE_POINTS[narrow])]
        dots(axes, pictured.axis[rows], pictured.measured_um[rows], "measured", 2.2)
        axes.set_ylabel(axis_text("displacement (µm)"))
        axes.set_xlabel(pictured.axis_label)
        axes.margins(x=0.005)

    return chart("whole", "measured and simulated displacement over the whole record", draw, WIDE_PX, 250, 230)


def is_near(pictured: PicturedRecord) -> bool:
    """Return whether the model as given fits into the pictures, and is not the recalibrated one."""
    span = float(np.nanmax(pictured.measured_um) - np.nanmin(pictured.measured_um))
    apart = float(np.max(np.abs(pictured.given_um - pictured.recalibrated_um)))
    return 0.004 * span < apart < NEAR * span


def loop(pictured: PicturedRecord) -> Chart:
    """Return measured and simulated displacement over the voltage, recalibrated and corrected."""
    return chart("loop", "displacement over the voltage, before and after", _loops(pictured), WIDE_PX, 340, 520)


def _loops(pictured: PicturedRecord) -> Draw:
    panels = [("recalibrated", pictured.recalibrated_um, "without")]
    if pictured.corrected:
        panels.append(("corrected", pictured.after_um, "with"))

    def draw(figure: "Figure", narrow: bool) -> None:
        shape = (len(panels), 1) if narrow else (1, len(panels))
        grid = np.atleast_1d(figure.subplots(*shape, sharex=True, sharey=True)).ravel()
        for axes, (title, simulated, colour) in zip(grid, panels, strict=True):
            _loop(axes, pictured, simulated, colour, LOOP_POINTS[narrow])
            axes.set_title(title)
        for axes in grid if narrow else grid[:1]:
            axes.set_ylabel(axis_text("displacement (µm)"))
        for axes in grid[-1:] if narrow else grid:
            axes.set_xlabel(axis_text("voltage (V)"))

    return draw


def _loop(axes: "Axes", pictured: PicturedRecord, simulated: Array, colour: str, most: int) -> None:
    rows = spread(pictured.axis.size, most)
    if is_smooth(pictured.acting_V[rows]):
        axes.plot(pictured.acting_V[rows], simulated[rows], color=light(colour), lw=3.2)
    else:
        dots(axes, pictured.acting_V[rows], simulated[rows], colour, 3.2)
    # what was measured lies on top, narrower than the model below it, so that both are seen
    dots(axes, pictured.acting_V[rows], pictured.measured_um[rows], "measured", 1.8)


def is_smooth(voltage_V: Array) -> bool:
    """Return whether a voltage runs from row to row, so that a line may join its points."""
    return float(np.max(np.abs(np.diff(voltage_V)), initial=0.0)) < SMOOTH * float(np.ptp(voltage_V))
