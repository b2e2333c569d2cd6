"""The picture of an effect's signature: the plant with and without it, the residual, and the view that shows it."""

import io
import textwrap
from typing import TYPE_CHECKING, Any, cast

from bender_discrepancy.report.signature.drives import Signature
from bender_discrepancy.report.signature.views import NOISE, RESIDUAL, VIEWS, WITHOUT
from bender_effects.catalogue import Effect
from bender_report.chart import thinned
from bender_report.record_overlay import MEASURED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

CAPTION_WIDTH = 185
ROUNDING_um = 1e-9


def draw_signature(effect: Effect, signature: Signature) -> bytes:
    """Draw a signature and return it as a PNG file.

    Left: the voltage, the readings with and without the effect, and the residual once gain and offset are
    recalibrated, all over time. Right: the view of the residual that the catalogue names for this effect.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 7.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    top, below = _pair(figure.subfigures(2, 1, height_ratios=(1.0, 7.6)))
    _write_heading(top, effect)
    left, right = _pair(below.subfigures(1, 2, width_ratios=(1.45, 1.0)))
    _draw_time(left, signature)
    VIEWS[effect.view](right, signature)
    _tidy(figure, [*left.axes, *right.axes])
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def spoken(value: Any) -> str:
    """Return a parameter as it is said in a caption: a list of numbers, a number or a word."""
    if isinstance(value, tuple):
        return "(" + ", ".join(spoken(x) for x in value) + ")"
    return value if isinstance(value, str) else f"{value:g}"


def _pair(figures: object) -> "tuple[SubFigure, SubFigure]":
    """Return two sub-figures as what they are; matplotlib declares a single one."""
    return cast("tuple[SubFigure, SubFigure]", figures)


def _write_heading(figure: "SubFigure", effect: Effect) -> None:
    values = ", ".join(f"{name} = {spoken(value)}" for name, value in effect.example.items())
    figure.text(0.008, 0.97, effect.title, fontsize=14, weight="bold", va="top")
    figure.text(0.995, 0.97, f"{effect.id}: {values}", fontsize=9, va="top", ha="right", family="monospace")
    caption = textwrap.fill(effect.signature, CAPTION_WIDTH)
    figure.text(0.008, 0.56, caption, fontsize=9, va="top", color="0.25", linespacing=1.35)


def _draw_time(figure: "SubFigure", signature: Signature) -> None:
    drive, comparison = signature.drive, signature.comparison
    voltage, reading, residual = figure.subplots(3, 1, sharex=True, height_ratios=(0.55, 1.5, 1.2))
    rows = thinned(drive.voltage_V)
    voltage.plot(drive.time_s[rows], drive.voltage_V[rows], color="0.45", lw=0.9, drawstyle=_style(signature))
    voltage.set_ylabel("voltage (V)")
    voltage.set_title(drive.words, loc="left", fontsize=10)
    for values, colour, width, name in (
        (signature.without_um, WITHOUT, 2.4, "without the effect"),
        (signature.with_um, MEASURED, 1.0, "with it"),
    ):
        rows = thinned(values)
        reading.plot(drive.time_s[rows], values[rows], color=colour, lw=width, label=name)
    reading.set_ylabel("reading (µm)")
    reading.set_title("the reading", loc="left", fontsize=10)
    before = signature.with_um - signature.without_um
    for values, colour, width, name in (
        (before, "0.70", 0.9, "as it stands"),
        (signature.residual_um, RESIDUAL, 1.0, "recalibrated"),
    ):
        rows = thinned(values)
        residual.plot(drive.time_s[rows], values[rows], color=colour, lw=width, label=name)
    residual.axhspan(-drive.noise_um, drive.noise_um, color=NOISE, zorder=0, label=f"noise ± {drive.noise_um:g} µm")
    residual.set_ylabel("with − without (µm)")
    residual.set_xlabel("time (s)")
    line = comparison.recalibration
    residual.set_title(
        f"the residual: rms {_um(comparison.before.rms_um)}, recalibrated {_um(comparison.recalibrated.rms_um)} "
        f"(gain × {line.gain:.3g}, offset {_um(line.offset_um)})",
        loc="left",
        fontsize=10,
    )
    figure.legend(loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    voltage.margins(x=0.01)


def _um(value: float) -> str:
    return "0 µm" if abs(value) < ROUNDING_um else f"{value:.3g} µm"


def _style(signature: Signature) -> str:
    return "default" if signature.drive.linear else "steps-post"


def _tidy(figure: "Figure", all_axes: list["Axes"]) -> None:
    for axes in all_axes:
        axes.grid(True, color="0.92", lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    for side in ("w_pad", "h_pad"):
        figure.get_layout_engine().set(**{side: 0.05})  # pyright: ignore[reportOptionalMemberAccess]
