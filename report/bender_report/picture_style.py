"""One look for all pictures: no pyplot, no global state, a few colours with a meaning each."""

import io
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bender_report.chart import Chart, inline, lay_out
from bender_report.palette import light

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, MUTED, GRID, BAND = (light(name) for name in ("ink", "muted", "rule", "held"))
COLOURS = {"zn": light("without"), "simc": light("falling"), "start": light("given")}
TUNED = light("with")
OTHERS = ("#6a4c93", "#3d6fb6", "#5a8f3c", "#a0522d", "#4a4e69", "#c06c84")
DPI = 150
NARROW_IN = 3.9
"""Width of a picture for a phone: its text is then a little larger there than it is on a desk."""
_LABEL_GAP = 0.055
_CHARACTERS_PER_IN = 12.0


def new_figure(width_in: float, height_in: float) -> "Figure":
    """An empty figure that can be saved without a display; one as narrow as a phone has its labels below."""
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


def is_narrow(figure: "Figure") -> bool:
    """Whether a figure is one for a phone."""
    return figure.get_figwidth() <= NARROW_IN


def in_both_widths(name: str, label: str, figure_of: Callable[[bool], "Figure"]) -> Chart:
    """Return a picture as a page shows it, on a desk and on a phone.

    Args:
        name: unique on the page.
        label: what is to be seen, for those who cannot see it.
        figure_of: draws the figure; told whether it is the narrow one.
    """
    return Chart(*(_svg(f"{name}-{k}", label, figure_of(bool(k))) for k in (0, 1)))


def _svg(name: str, label: str, figure: "Figure") -> str:
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        lay_out(figure)
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return inline(buffer.getvalue(), label)


def write_key(figure: "Figure", labels: Sequence[tuple[str, str]]) -> None:
    """Write (text, colour) one below the other under a narrow figure."""
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color=colour, lw=2.2) for _, colour in labels]
    texts = [textwrap.fill(text, round(_CHARACTERS_PER_IN * NARROW_IN)) for text, _ in labels]
    figure.legend(lines, texts, loc="outside lower left", fontsize=8.5, frameon=False, handlelength=1.2, labelcolor=INK)


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
    size = 12
    if is_narrow(figure):
        size, characters = 10, round(_CHARACTERS_PER_IN * NARROW_IN)
        finding = textwrap.fill(finding.replace(" %", "\u00a0%"), round(0.85 * characters))
        circumstances = textwrap.fill(circumstances, characters)
    figure.suptitle(finding, x=0.012, ha="left", fontsize=size, fontweight="bold", color=INK)
    if circumstances:
        figure.axes[0].set_title(circumstances, loc="left", fontsize=9, color=MUTED)


def write_beside(axes: "Axes", labels: Sequence[tuple[float, str, str]]) -> None:
    """Write (height in data units, text, colour) to the right of a panel, moved apart where they would overlap.

    A narrow figure has one label above its panel and more below all panels. Call it when the limits of the panel stand.
    """
    figure = axes.get_figure(root=True)
    if figure is not None and is_narrow(figure):
        if len(labels) == 1:
            axes.set_title(labels[0][1], loc="right", fontsize=9, fontweight="bold", color=labels[0][2])
        else:
            write_key(figure, [(text, colour) for _, text, colour in sorted(labels, reverse=True)])
        return
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
