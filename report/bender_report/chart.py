"""Charts as inline SVG whose colours follow the page, light or dark, and whose text is the page's own."""

import html
import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bender_report.drawing import can_draw, no_pictures
from bender_report.palette import TOKENS, light

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

PIXELS_PER_INCH = 72.0
FONT_PX = 12.0
FEW, FEW_LARGER = 300, 1.6
WIDE_PX, NARROW_PX = 920, 344
MOST_POINTS = 6_000
FEW_DECADES = 300.0
"""Ends of a logarithmic axis whose ratio is smaller have too few powers of ten between them."""
NEARLY = 1e-9
"""Of the length of an axis: a tick that is so far beyond its end is at it."""
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.size": FONT_PX,
    "axes.labelsize": FONT_PX,
    "axes.titlesize": FONT_PX,
    "axes.titlelocation": "left",
    "xtick.labelsize": FONT_PX - 1,
    "ytick.labelsize": FONT_PX - 1,
    "text.color": light("ink"),
    "axes.labelcolor": light("muted"),
    "axes.titlecolor": light("ink"),
    "axes.edgecolor": light("rule"),
    "xtick.color": light("rule"),
    "ytick.color": light("rule"),
    "xtick.labelcolor": light("muted"),
    "ytick.labelcolor": light("muted"),
    "grid.color": light("rule"),
    "grid.linewidth": 0.8,
    "axes.unicode_minus": True,
    "path.simplify": False,
    # about what a layout comes to: ticks are chosen before it
    "figure.subplot.left": 0.08,
    "figure.subplot.right": 0.99,
    "figure.subplot.bottom": 0.12,
    "figure.subplot.top": 0.92,
    "figure.constrained_layout.w_pad": 0.03,
    "figure.constrained_layout.h_pad": 0.03,
}

Draw = Callable[["Figure", bool], None]
"""Draws into an empty figure; told whether the figure is the narrow one of a phone."""


@dataclass(frozen=True, slots=True)
class Chart:
    """One chart in two widths, of which the page shows the one that fits.

    Attributes:
        wide: SVG for a desk, or a paragraph that says what would be drawn.
        narrow: the same for a phone.
    """

    wide: str
    narrow: str


def chart(name: str, label: str, draw: Draw, width_px: int, height_px: int, narrow_height_px: int) -> Chart:
    """Draw a chart in two widths.

    Args:
        name: unique on the page.
        label: what it shows, for those who cannot see it.
        draw: what is drawn.
        width_px: of the wide one.
        height_px: of the wide one.
        narrow_height_px: of the narrow one.
    """
    if not can_draw():
        return missing_chart(label)
    return Chart(
        _svg(f"{name}-wide", label, draw, (width_px, height_px), narrow=False),
        _svg(f"{name}-narrow", label, draw, (NARROW_PX, narrow_height_px), narrow=True),
    )


def missing_chart(label: str) -> Chart:
    """Return what stands in place of a chart where none can be drawn: what it would show, and how drawing comes."""
    text = f"<p>Not drawn: {html.escape(label)}. {html.escape(no_pictures())}</p>"
    return Chart(text, text)


def load() -> None:
    """Import what drawing needs, half a second of work that may be done before there is something to draw."""
    if not can_draw():
        return
    import matplotlib.backends.backend_svg
    import matplotlib.figure  # noqa: F401


def _svg(name: str, label: str, draw: Draw, size_px: tuple[int, int], narrow: bool) -> str:
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with rc_context({**_STYLE, "svg.hashsalt": name}):
        inches = (size_px[0] / PIXELS_PER_INCH, size_px[1] / PIXELS_PER_INCH)
        figure = Figure(figsize=inches, dpi=PIXELS_PER_INCH, layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure, narrow)
        for axes in figure.axes:
            _quieten(axes)
            _keep_ticks(axes)
        lay_out(figure)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return inline(buffer.getvalue(), label)


def lay_out(figure: "Figure") -> None:
    """Place the axes of a figure for good: saving it would draw all of it once more to that end."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


def _quieten(axes: "Axes") -> None:
    axes.grid(axes.get_label() != "<colorbar>")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(length=0, pad=4)


def _keep_ticks(axes: "Axes") -> None:
    """Choose ticks and their labels once: a layout and a drawing would ask for them a dozen times."""
    from matplotlib.ticker import FixedFormatter, FixedLocator

    for axis in (axes.xaxis, axes.yaxis):
        ends = axis.get_view_interval()
        room = NEARLY * abs(ends[1] - ends[0])
        ticks = [x for x in axis.get_majorticklocs() if min(ends) - room <= x <= max(ends) + room]
        chosen = axis.get_major_formatter()
        kept = FixedFormatter(chosen.format_ticks(ticks))
        kept.set_offset_string(chosen.get_offset())
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_major_formatter(kept)


def inline(svg: str, label: str) -> str:
    """Return an SVG file as it stands in a page: no header, no fixed size, the page's colours and font."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<(metadata|style)\b.*?</\1>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = svg.replace("xlink:href=", "href=")
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg))
    svg = re.sub(r' id="([^"]+)"', lambda m: m.group(0) if m.group(1) in used else "", svg)
    head, body = svg.split(">", 1)
    view = re.search(r'viewBox="[^"]+"', head)
    size = view.group(0) if view else ""
    for name, (colour, _) in TOKENS.items():
        body = body.replace(colour, f"var(--{name})")
    body = re.sub(r"font: ([\d.]+)px [^;\"]+", r"font-size: \1px", body)
    body = re.sub(r' d="[^"]+"', lambda m: re.sub(r"\d+\.\d{2,}", _tenth, m.group(0)), body)
    body = re.sub(r"\s*\n\s*", "\n", body)
    return f'<svg role="img" aria-label="{label}" {size}>{body.strip()}'


def _tenth(number: re.Match[str]) -> str:
    return f"{float(number.group(0)):.1f}"


def thinned(values: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return rows that keep the look of a long signal: the smallest and largest value of each of many pieces."""
    if values.size <= most:
        return np.arange(values.size)
    pieces = np.array_split(np.nan_to_num(values), max(most // 2, 1))
    starts = np.cumsum([0, *(piece.size for piece in pieces[:-1])], dtype=np.intp)
    lows = starts + [int(piece.argmin()) for piece in pieces]
    highs = starts + [int(piece.argmax()) for piece in pieces]
    return np.unique(np.concatenate([lows, highs])).astype(np.intp)


def spread(count: int, most: int) -> NDArray[np.intp]:
    """Return at most so many rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def dots(axes: "Axes", x: Array, y: Array, colour: str, size: float, alpha: float = 1.0) -> None:
    """Draw dots as one path of strokes without length: a tenth of the size of as many markers."""
    seen = np.isfinite(x) & np.isfinite(y)
    gap = np.full(int(seen.sum()), np.nan)
    size *= FEW_LARGER if gap.size < FEW else 1.0
    axes.plot(
        np.stack([x[seen], x[seen], gap], axis=1).ravel(),
        np.stack([y[seen], y[seen], gap], axis=1).ravel(),
        color=light(colour),
        lw=size,
        alpha=alpha,
        solid_capstyle="round",
    )


def plain_logarithmic(axes: "Axes") -> None:
    """Label logarithmic axes with plain numbers, at the powers of ten, and at 2 and 5 of each where these are few."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        few = high < FEW_DECADES * low
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=12))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())


def bulk_limits(values: Array, least: float = 0.0) -> tuple[float, float]:
    """Return limits of an axis that hold all but a few stray values; some room where all are alike."""
    seen = values[np.isfinite(values)]
    low, high = np.quantile(seen, [0.002, 0.998])
    margin = 0.25 * (high - low)
    low, high = max(low - margin, float(seen.min())), min(high + margin, float(seen.max()))
    room = 0.06 * max(high - low, least) or 0.1 * (abs(high) or 1.0)
    return min(low - room, -least), max(high + room, least)
