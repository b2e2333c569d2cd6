"""One look for all pictures: no pyplot, no global state, a few colours with a meaning each."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bender_report.palette import light

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, MUTED, GRID, BAND = (light(name) for name in ("ink", "muted", "rule", "held"))
COLOURS = {"zn": light("without"), "simc": light("falling"), "start": light("given")}
TUNED = light("with")
OTHERS = ("#6a4c93", "#3d6fb6", "#5a8f3c", "#a0522d", "#4a4e69", "#c06c84")
DPI = 150
_LABEL_GAP = 0.055


def new_figure(width_in: float, height_in: float) -> "Figure":
    """An empty figure that can be saved without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def to_png(figure: "Figure") -> bytes:
    """The figure as a PNG file, without anything that differs from run to run."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def dress(axes: "Axes", *, x_label: str = "", y_label: str = "") -> None:
    """Quiet frame and grid, labels with units."""
    axes.grid(True, color=GRID, lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(MUTED)
    axes.tick_params(colors=INK, labelsize=8.5)
    axes.tick_params(which="both", color=MUTED)
    if x_label:
        axes.set_xlabel(x_label, fontsize=9, color=INK)
    if y_label:
        axes.set_ylabel(y_label, fontsize=9, color=INK)


def plain_log_scale(axes: "Axes") -> None:
    """A logarithmic y axis with plain numbers at 1, 2 and 5."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())


def write_title(figure: "Figure", finding: str, circumstances: str = "") -> None:
    """The finding as the title, the circumstances in small print above the panels."""
    figure.suptitle(finding, x=0.012, ha="left", fontsize=12, fontweight="bold", color=INK)
    if circumstances:
        figure.axes[0].set_title(circumstances, loc="left", fontsize=9, color=MUTED)


def write_beside(axes: "Axes", labels: Sequence[tuple[float, str, str]]) -> None:
    """Write (height in data units, text, colour) to the right of a panel, moved apart where they would overlap.

    Call it when the limits of the panel stand.
    """
    to_axes = axes.transData + axes.transAxes.inverted()
    floor = -1.0
    for height, text, colour in sorted(labels):
        place = max(float(to_axes.transform((axes.get_xlim()[0], height))[1]), floor + _LABEL_GAP)
        floor = place
        axes.annotate(
            text, (1.012, place), xycoords="axes fraction", color=colour, fontsize=9, fontweight="bold", va="center"
        )


def colours_for(methods: Sequence[str]) -> dict[str, str]:
    """A colour for each method: the first one is the tuned one, rules and start have theirs."""
    free = iter(OTHERS * (1 + len(methods) // len(OTHERS)))
    chosen: dict[str, str] = {}
    for place, method in enumerate(methods):
        chosen[method] = TUNED if place == 0 else COLOURS.get(method) or next(free)
    return chosen
