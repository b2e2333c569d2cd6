"""The section of a report that shows a lead: the equation, its numbers, what it gives beside the residual."""

from typing import TYPE_CHECKING, Any

import numpy as np

from bender_discrepancy.report.device_words import for_device
from bender_discrepancy.report.pictured_record import PicturedRecord
from bender_inference.equation.lead import Drawn, Lead
from bender_report.chart import WIDE_PX, Chart, bulk_limits, chart, dots, spread, thinned
from bender_report.palette import light
from bender_report.wording import axis_text, figure, input_word, is_other_rig, percent, relabelled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE_POINTS = {False: 1600, True: 600}
DOT_POINTS = {False: 1400, True: 500}
SYMBOLS = {
    "r": "r: residual (µm)",
    "v": "v: the acting voltage (V)",
    "y": "y: the simulated tip (µm)",
}


def section(lead: Lead | None, pictured: PicturedRecord, record: int, *, in_model: bool) -> dict[str, Any] | None:
    """Return what the page says of a lead, None where there is no such section.

    Args:
        lead: of the diagnosis.
        pictured: the record that the page shows.
        record: its number.
        in_model: whether the corrected model has the equation.
    """
    if lead is None:
        return None
    x = lead.equation
    if x is None:
        return {"text": "", "reason": lead.reason}
    symbols = {name: relabelled(for_device(text, bender=not is_other_rig())) for name, text in SYMBOLS.items()}
    used = [text for name, text in symbols.items() if name == "r" or any(name in t.name for t in x.terms)]
    return {
        "text": _unbroken(lead.text),
        "covers": percent(lead.explains),
        "in_model": in_model,
        "symbols": f"{', '.join(used)}, t: time (s). A jump of the {input_word()} counts as a very fast change.",
        "title": "What is left, and what the equation gives",
        "chart": picture(lead.drawn[record], pictured),
        "rows": [
            {"term": t.name, "value": f"{figure(value, 4)} {_read(t.unit(x.per_second))}".strip()}
            for t, value in zip(x.terms, x.coefficients, strict=True)
        ],
    }


def picture(drawn: Drawn, pictured: PicturedRecord) -> Chart:
    """Return the residual over the whole record and over a held-out stretch, with what the equation gives."""

    def draw(figure: "Figure", narrow: bool) -> None:
        whole, near = figure.subplots(2, 1)
        at = pictured.axis[drawn.rows]
        for begin, end in _runs(drawn.held_out):
            whole.axvspan(at[begin], at[end - 1], color=light("held"), lw=0)
        some = np.flatnonzero(np.isfinite(drawn.left_um))
        some = some[spread(some.size, DOT_POINTS[narrow])]
        dots(whole, at[some], drawn.left_um[some], "measured", 2.0, 0.7)
        line = thinned(drawn.gives_um, LINE_POINTS[narrow])
        whole.plot(at[line], drawn.gives_um[line], color=light("falling"), lw=1.2)
        whole.set_ylim(*bulk_limits(np.concatenate([drawn.left_um, drawn.gives_um]), 2.0 * pictured.noise_um))
        whole.margins(x=0.005)
        begin, end = pictured.axis[pictured.stretch][[0, -1]]
        rows = (at >= begin) & (at <= end)
        dots(near, at[rows], drawn.left_um[rows], "measured", 2.6 if narrow else 3.4)
        near.plot(at[rows], drawn.gives_um[rows], color=light("falling"), lw=1.6)
        near.margins(x=0.01)
        near.set_xlabel(pictured.axis_label)
        for axes in (whole, near):
            axes.set_ylabel(axis_text("residual (µm)"))
        figure.align_ylabels([whole, near])

    return chart("lead", "the residual over time, and what the equation gives", draw, WIDE_PX, 360, 380)


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _read(unit: str) -> str:
    return "" if unit == "1" else unit.replace("um", "µm").replace("2", "²").replace("3", "³").replace("4", "⁴")


def _unbroken(text: str) -> str:
    """Return an equation that breaks between its terms only."""
    for sign in (" + ", " − "):
        text = text.replace(sign, f"\n{sign[1]} ")
    return text.replace(" ", "\u00a0").replace("\n", " ")
