"""The picture of the loops: readings and models over voltage, and the residual that is left in time."""

import io
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.resimulation import Bank
from bender_identify.identification_result import Identification, Row
from bender_identify.records.experiment import Experiment
from bender_report.palette import light
from bender_report.record_overlay import MEASURED, ON_TOP, window
from bender_report.wording import drawable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

COLOURS = {
    "sindy": light("without"),
    "prandtl_ishlinskii": light("with"),
    "bouc_wen": light("falling"),
    "first_order_lag": light("given"),
}
MOST_DRAWN = 4
HELD_OUT_SHADE = light("held")
SHOWN_SHARE = 0.995


def draw_loops(outcome: Identification) -> bytes:
    """Draw each record (four at most) in four panels and return them as a PNG file.

    Left the loop over the voltage, below it the same with a straight line taken out, so that it opens; right the
    readings and the written model in time, below what each model leaves. The held-out part is shaded.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = outcome.experiments[:MOST_DRAWN]
    figure = Figure(figsize=(13.0, 7.6 * len(shown)), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(2 * len(shown), 2, squeeze=False, width_ratios=(1.0, 1.5))
    readings = {row.candidate.id: Bank(shown).run(row.candidate.model) for row in outcome.rows}
    for k, experiment in enumerate(shown):
        simulated = {name: values[k] for name, values in readings.items()}
        _draw_loop(grid[2 * k, 0], outcome, experiment, simulated, False)
        _draw_loop(grid[2 * k + 1, 0], outcome, experiment, simulated, True)
        _draw_time(grid[2 * k, 1], outcome.written, experiment, simulated)
        _draw_left(grid[2 * k + 1, 1], outcome, experiment, simulated)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _draw_loop(
    axes: "Axes", outcome: Identification, experiment: Experiment, simulated: dict[str, Array], opened: bool
) -> None:
    part = _shown(outcome.written, experiment, simulated)
    volts, measured = experiment.acting_V[part], experiment.measured_um[part]
    seen = np.isfinite(measured)
    line = np.polyval(np.polyfit(volts[seen], measured[seen], 1), volts) if opened else np.zeros_like(volts)
    axes.plot(volts, measured - line, ".", color=MEASURED, ms=_dot(volts.size), label="measured", zorder=ON_TOP)
    for row in outcome.rows:
        name = row.candidate.id
        width, order = (1.6, 3) if row is outcome.written else (0.9, 2)
        axes.plot(volts, simulated[name][part] - line, color=COLOURS[name], lw=width, zorder=order, label=name)
    axes.set_xlabel("voltage (V)")
    axes.set_ylabel("displacement (µm)" if not opened else "displacement - line (µm)")
    axes.set_title(
        "straight line taken out" if opened else drawable(f"{experiment.name}: loops"), loc="left", fontsize=10
    )
    if not opened:
        axes.legend(fontsize=7, frameon=False)


def _draw_time(axes: "Axes", written: Row, experiment: Experiment, simulated: dict[str, Array]) -> None:
    part = _shown(written, experiment, simulated)
    time = experiment.time_s[part]
    name = written.candidate.id
    measured = experiment.measured_um[part]
    axes.plot(time, measured, ".", color=MEASURED, ms=_dot(time.size), label="measured", zorder=ON_TOP)
    axes.plot(time, simulated[name][part], color=COLOURS[name], lw=1.3, label=f"{name} (written)")
    _shade(axes, experiment, float(time[0]), float(time[-1]))
    axes.set_xlabel("time (s)")
    axes.set_title(
        "in time" if part == slice(0, experiment.time_s.size) else "in time, the swings with the largest residual",
        loc="left",
        fontsize=10,
    )
    axes.legend(fontsize=7, frameon=False, loc="upper right")


def _shown(written: Row, experiment: Experiment, simulated: dict[str, Array]) -> slice:
    """Return all rows of a record of few swings, of a longer one those on which the written model is furthest off."""
    return window(experiment.acting_V, experiment.measured_um - simulated[written.candidate.id])


def _draw_left(axes: "Axes", outcome: Identification, experiment: Experiment, simulated: dict[str, Array]) -> None:
    counted = experiment.fitted | experiment.held_out
    largest = 0.0
    for row in reversed(outcome.rows):
        name = row.candidate.id
        left = np.where(counted, experiment.measured_um - simulated[name], np.nan)
        width = 0.9 if row is outcome.written else 0.5
        largest = max(largest, float(np.quantile(np.abs(left[counted]), SHOWN_SHARE)))
        axes.plot(experiment.time_s, left, color=COLOURS[name], lw=width, label=f"{name}")
    _shade(axes, experiment, float(experiment.time_s[0]), float(experiment.time_s[-1]))
    axes.set_xlabel("time (s)")
    axes.set_ylabel("residual (µm)")
    axes.set_title("residual, measured − simulated (shaded: held out)", loc="left", fontsize=10)
    axes.axhline(0.0, color="#999999", lw=0.5)
    if largest > 0.0:
        axes.set_ylim(-1.3 * largest, 1.3 * largest)


def _shade(axes: "Axes", experiment: Experiment, first_s: float, last_s: float) -> None:
    rows = np.flatnonzero(experiment.held_out)
    if rows.size:
        begin, end = float(experiment.time_s[rows[0]]), float(experiment.time_s[rows[-1]])
        axes.axvspan(max(begin, first_s), max(min(end, last_s), first_s), color=HELD_OUT_SHADE, zorder=0)


def _dot(count: int) -> float:
    return 3.0 if count < 500 else 1.5
