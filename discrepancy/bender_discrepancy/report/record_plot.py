"""One record in axes of a notebook: measured, recalibrated and corrected."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bender_discrepancy.conclusion.findings import Findings, worst_record
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.report.pictured_record import pictured_record
from bender_inference.records.record_names import distinct_names
from bender_report.drawing import require_drawing
from bender_report.palette import light
from bender_report.wording import axis_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_record(findings: Findings, measured: Measured, names: Sequence[str], axes: "Axes | None" = None) -> "Axes":
    """Draw the record with the largest gap; return the axes drawn into.

    Args:
        findings: of a diagnosis.
        measured: its gap.
        names: of the records.
        axes: to draw into; those of a new figure where None.

    Raises:
        InputError: matplotlib is not installed.
    """
    if axes is None:
        require_drawing("plot")
        from matplotlib import pyplot

        _, axes = pyplot.subplots(figsize=(9.0, 4.0), layout="constrained")
    worst = worst_record(findings.search)
    shown = pictured_record(findings, measured, worst, distinct_names(names)[worst])
    axes.plot(shown.axis, shown.measured_um, ".", ms=2.5, color=light("measured"), label="measured")
    axes.plot(shown.axis, shown.recalibrated_um, lw=1.0, color=light("without"), label="recalibrated")
    if shown.corrected:
        axes.plot(shown.axis, shown.after_um, lw=1.0, color=light("with"), label="corrected")
    axes.set(xlabel=shown.axis_label, ylabel=axis_text("displacement (µm)"), title=f"{shown.name}: {findings.verdict}")
    axes.legend(frameon=False)
    return axes
