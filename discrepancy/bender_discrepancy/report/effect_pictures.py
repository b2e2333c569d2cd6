"""What each effect does in a record: the readings less all the rest of the corrected model, and what the effect adds.

It is the component-plus-residual plot of regression (Larsen and McCleary 1972, doi:10.1080/00401706.1972.10488966),
over what shows the effect best: its loop or curve over the input or the reading, or its course over time.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bender_discrepancy.conclusion.sentences import heading_of
from bender_discrepancy.report.overlay_pictures import is_smooth
from bender_discrepancy.report.pictured_record import STRETCH_ROWS, Array, PicturedRecord
from bender_effects.catalogue import EFFECTS
from bender_report.chart import WIDE_PX, Chart, bulk_limits, chart, dots, spread, thinned
from bender_report.palette import light
from bender_report.wording import axis_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bender_discrepancy.conclusion.findings import Findings

OVER_INPUT = ("voltage", "voltage_in_time")
OVER_READING = ("reading", "parity")
POINTS = {False: 1600, True: 800}


@dataclass(frozen=True, slots=True, eq=False)
class Component:
    """One effect in one record, arrays of shape (n,).

    Attributes:
        id: of the effect.
        left_um: the readings less what the corrected model reads without the effect; NaN where one did not count.
        added_um: what the effect adds to the corrected model.
        without_um: what the corrected model reads without it.
    """

    id: str
    left_um: Array
    added_um: Array
    without_um: Array


def components(findings: "Findings", record: int) -> list[Component]:
    """Return the effects of the best hypothesis in a record, in the order of adding; the others keep their numbers."""
    search = findings.search
    problem, best = search.problem, search.best
    seen, calibration = problem.observations[record], best.calibration
    measured_um = np.where(seen.usable, seen.measured_um, np.nan)
    every = problem.readings(best.hypothesis)
    found = []
    for k, part in enumerate(best.hypothesis.parts):
        rest = problem.readings(best.hypothesis.minus(k))
        if every is None or rest is None:
            continue
        without_um = calibration.gain * rest[record] + calibration.offsets_um[record]
        added_um = calibration.gain * (every[record] - rest[record])
        found.append(Component(part.form.effect, measured_um - without_um, added_um, without_um))
    return found


def component_charts(findings: "Findings", shown: PicturedRecord, record: int) -> dict[str, dict[str, Chart | str]]:
    """Return a chart of each effect that is said to be missing, and over what it is drawn, by their ids."""
    return {
        x.id: {"chart": _chart(x, shown), "over": _over(x)}
        for x in components(findings, record)
        if any(x.id == y.id for y in findings.added)
    }


def _over(component: Component) -> str:
    view = EFFECTS[component.id].view
    if view in OVER_INPUT:
        return "input"
    return "reading" if view in OVER_READING else "time"


def _chart(component: Component, shown: PicturedRecord) -> Chart:
    over = _over(component)

    def draw(figure: "Figure", narrow: bool) -> None:
        axes = figure.subplots()
        if over == "time":
            _draw_course(axes, component, shown, narrow)
        else:
            at = shown.acting_V if over == "input" else component.without_um
            _draw_branches(axes, component, shown, at, POINTS[narrow])
            axes.set_xlabel(axis_text("voltage (V)" if over == "input" else "displacement (µm)"))
        axes.set_ylim(*bulk_limits(np.concatenate([component.left_um, component.added_um]), 2.0 * shown.noise_um))
        axes.set_ylabel(axis_text("displacement (µm)"))

    name = f"component-{component.id}"
    return chart(name, f"what {heading_of(component.id)} adds in this record", draw, WIDE_PX, 300, 260)


def _draw_branches(axes: "Axes", component: Component, shown: PicturedRecord, at: Array, most: int) -> None:
    for mask, colour in ((shown.rising, "rising"), (~shown.rising, "falling")):
        rows = np.flatnonzero(mask & np.isfinite(component.left_um))
        rows = rows[spread(rows.size, most)] if rows.size else rows
        dots(axes, at[rows], component.left_um[rows], colour, 2.0, 0.6)
    rows = spread(at.size, most)
    if is_smooth(at[rows]):
        axes.plot(at[rows], component.added_um[rows], color=light("with"), lw=1.6)
    else:
        dots(axes, at[rows], component.added_um[rows], "with", 2.6)


def _draw_course(axes: "Axes", component: Component, shown: PicturedRecord, narrow: bool) -> None:
    stretch = _most_active(component.added_um)
    x, left_um, added_um = shown.axis[stretch], component.left_um[stretch], component.added_um[stretch]
    seen = np.flatnonzero(np.isfinite(left_um))
    dots(axes, x[seen], left_um[seen], "measured", 2.2 if narrow else 3.0)
    rows = thinned(added_um)
    axes.plot(x[rows], added_um[rows], color=light("with"), lw=1.6)
    axes.set_xlabel(shown.axis_label)
    axes.margins(x=0.01)


def _most_active(added_um: Array) -> slice:
    """Return the rows, as many as can be shown one by one, in which an effect moves the reading most."""
    if added_um.size <= STRETCH_ROWS:
        return slice(0, added_um.size)
    energy = np.concatenate([[0.0], np.cumsum(np.square(added_um - np.median(added_um)))])
    begin = int(np.argmax(energy[STRETCH_ROWS:] - energy[:-STRETCH_ROWS]))
    return slice(begin, begin + STRETCH_ROWS)
