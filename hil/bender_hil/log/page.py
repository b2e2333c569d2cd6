"""`summary.html`: a run on one page that needs nothing else, with charts as inline SVG, for a desk and for a phone."""

import io
import re
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bender_hil.log.ending import Conduct, EndOfRun
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import applied_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
COLOURS = {
    "ink": ("#1b1f24", "#e6e9ec"),
    "muted": ("#5b6570", "#a3adb8"),
    "rule": ("#dde1e5", "#343b43"),
    "aim": ("#8a6d1f", "#e0bd5c"),
    "tip": ("#0b6e8f", "#56b6d8"),
    "told": ("#7a4fb0", "#bb9be6"),
    "read": ("#2f7d4f", "#70c794"),
    "bad": ("#b3261e", "#ff8a80"),
}
"""By name: on a light and on a dark page."""
WIDE_PX, NARROW_PX = (920, 300), (344, 260)
MOST_POINTS, _FEW = 3000, 200
_PIXELS_PER_INCH, _FONT_PX = 72.0, 12.0
_EVENTS = {"armed": "armed", "trip": "trip", "output_off": "output off"}
Draw = Callable[["Figure"], None]

_STYLE = """
:root { color-scheme: light dark; LIGHT }
@media (prefers-color-scheme: dark) { :root { DARK } }
body { margin: 0 auto; max-width: 60rem; padding: 1.5rem 1rem 3rem; font: 16px/1.5 system-ui, sans-serif;
  color: var(--ink); background: Canvas; }
h1 { font-size: 1.5rem; margin: 0 0 .25rem; } h2 { font-size: 1.05rem; margin: 2rem 0 .25rem; }
p { margin: .25rem 0; overflow-wrap: anywhere; } .muted, td:first-child { color: var(--muted); }
.ended { border-left: 4px solid var(--read); padding: .5rem .75rem; margin: 1rem 0; font-weight: 600; }
.ended.remarked { border-color: var(--aim); } .ended.tripped { border-color: var(--bad); }
table { border-collapse: collapse; width: 100%; } td { padding: .3rem .5rem .3rem 0; vertical-align: top;
  border-top: 1px solid var(--rule); overflow-wrap: anywhere; }
.key span { display: inline-block; margin-right: 1rem; } .key i { display: inline-block; width: 1.2em; height: 3px;
  vertical-align: middle; margin-right: .35em; }
svg { display: block; width: 100%; height: auto; font-family: inherit; } svg.narrow { display: none; }
@media (max-width: 40rem) { svg.wide { display: none; } svg.narrow { display: block; } }
"""


def page(log: RunLog, rows: Sequence[Sequence[Any]], line: str, said: Conduct, end: EndOfRun) -> str:
    """Return the page of a run.

    Args:
        log: its journals.
        rows: what and found, as they are printed.
        line: how it ended.
        said: what speaks against it.
        end: what ended it.
    """
    where = "emulated bench" if log.start.get("emulated") else "bench"
    state = "tripped" if end.code or end.alarm or end.signal else "remarked" if said.remarks else ""
    cells = "".join(f"<tr><td>{escape(str(a))}</td><td>{escape(str(b))}</td></tr>" for a, b in rows)
    tokens = [" ".join(f"--{name}: {pair[k]};" for name, pair in COLOURS.items()) for k in (0, 1)]
    style = _STYLE.replace("LIGHT", tokens[0]).replace("DARK", tokens[1])
    version = log.start.get("versions", {}).get("piezo-bender", "unknown")
    date = str(log.start.get("date", ""))[:16].replace("T", " ")
    origin = " · ".join(filter(None, [log.directory.name, date, f"piezo-bender {version}"]))
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(log.directory.name)}: run on the {where}</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f"<h1>Run on the {where}</h1>\n"
        f'<p class="muted">{escape(origin)}</p>\n'
        f'<p class="ended {state}">{escape(line)}</p>\n<table>{cells}</table>\n{_charts(log)}</body>\n</html>\n'
    )


def _charts(log: RunLog) -> str:
    if not log.ticks:
        return "<p>There is nothing to draw: not one frame led to a command.</p>\n"
    origin_s = float(log.ticks[0]["grabbed_s"])
    time_s = _column(log.ticks, "grabbed_s") - origin_s
    tip_um, aim_um = _column(log.ticks, "measured_um"), _column(log.ticks, "setpoint_um")
    events = [(float(entry["t"]) - origin_s, _EVENTS[entry["kind"]]) for entry in log.guard if entry["kind"] in _EVENTS]

    times_s = [*time_s, *(at_s for at_s, _ in events)]
    room_s = 0.02 * (max(times_s) - min(times_s)) or 1.0
    shown_s = (min(times_s) - room_s, max(times_s) + room_s)

    def tip(figure: "Figure") -> None:
        axes = _axes(figure, "µm", shown_s)
        axes.step(*_thin(time_s, aim_um), where="post", color=_light("aim"), lw=1.4)
        axes.plot(*_thin(time_s, tip_um), color=_light("tip"), lw=1.4)
        axes.plot(time_s[np.isnan(tip_um)], np.zeros(int(np.isnan(tip_um).sum())), "|", color=_light("bad"), ms=9)

    def volts(figure: "Figure") -> None:
        axes = _axes(figure, "V", shown_s)
        axes.step(*_thin(time_s, _column(log.ticks, "command_V")), where="post", color=_light("told"), lw=1.4)
        measured = [entry for entry in log.guard if entry["kind"] == "measured"]
        read_s, read_V = _column(measured, "t") - origin_s, _column(measured, "supply_voltage_V")
        axes.plot(*_thin(read_s, read_V), ".", color=_light("read"), ms=5 if time_s.size < _FEW else 3)
        for at_s, what in events:
            axes.axvline(at_s, color=_light("bad"), lw=0.9, ls=(0, (4, 3)))
            if figure.get_figwidth() * _PIXELS_PER_INCH < WIDE_PX[0]:
                continue
            where = {"x": at_s, "y": 1.0, "s": what, "transform": axes.get_xaxis_transform()}
            axes.text(**where, color=_light("bad"), rotation=90, ha="right", va="top", size=_FONT_PX - 2)

    def delay(figure: "Figure") -> None:
        axes = _axes(figure, "ms", shown_s)
        applied, period_s = applied_times(log), float(log.start.get("period_s") or np.nan)
        delay_ms = np.array(
            [1e3 * (applied.get(tick["sequence"], np.nan) - tick["grabbed_s"]) for tick in log.ticks], dtype=float
        )
        axes.plot(*_thin(time_s, delay_ms), ".", color=_light("told"), ms=5 if time_s.size < _FEW else 3)
        axes.axhline(1e3 * period_s, color=_light("bad"), lw=0.9, ls=(0, (4, 3)))
        late = delay_ms > 1e3 * period_s
        axes.plot(time_s[late], delay_ms[late], "o", color=_light("bad"), ms=4)
        axes.set_ylim(bottom=0.0)

    lost = int(np.isnan(tip_um).sum())
    guard = "; ".join(f"{what} at {at_s:.2f} s" for at_s, what in events) or "its journal is empty"
    return (
        _section(
            "Tip and set-point", [("aim", "set-point"), ("tip", "tip"), ("bad", f"frames without a tip: {lost}")], tip
        )
        + _section("Voltage", [("told", "command"), ("read", "measured"), ("bad", f"guard: {guard}")], volts)
        + _section("From frame to command", [("told", "delay"), ("bad", "one period: later ticks are late")], delay)
    )


def _section(title: str, key: list[tuple[str, str]], draw: Draw) -> str:
    marks = "".join(f'<span><i style="background:var(--{name})"></i>{escape(words)}</span>' for name, words in key)
    drawings = _svg(title, draw, WIDE_PX, "wide") + _svg(title, draw, NARROW_PX, "narrow")
    return f'<h2>{escape(title)}</h2>\n<p class="key muted">{marks}</p>\n{drawings}\n'


def _svg(title: str, draw: Draw, size_px: tuple[int, int], kind: str) -> str:
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    quiet: dict[Any, Any] = {
        "svg.fonttype": "none", "svg.hashsalt": f"{title}-{kind}", "font.size": _FONT_PX,
        "text.color": _light("muted"), "axes.edgecolor": _light("rule"), "axes.labelcolor": _light("muted"),
        "xtick.color": _light("muted"), "ytick.color": _light("muted"), "grid.color": _light("rule"),
    }  # fmt: skip
    with rc_context(quiet):
        inches = (size_px[0] / _PIXELS_PER_INCH, size_px[1] / _PIXELS_PER_INCH)
        figure = Figure(figsize=inches, dpi=_PIXELS_PER_INCH, layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return _inline(buffer.getvalue(), title, kind)


def _inline(svg: str, title: str, kind: str) -> str:
    """The SVG as it stands in a page: no header, the page's colours and its font."""
    svg = re.sub(r"<(metadata|style)\b.*?</\1>|<!--.*?-->", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    head, body = svg.split(">", 1)
    view = re.search(r'viewBox="[^"]+"', head)
    for name, (colour, _) in COLOURS.items():
        body = body.replace(colour, f"var(--{name})")
    body = re.sub(r"font: ([\d.]+)px [^;\"]+", r"font-size: \1px", body)
    # two drawings of one page may not share the names of their parts
    body = re.sub(r'(id="|url\(#|href="#)', rf"\1{kind}-{re.sub('[^a-z]', '', title.lower())}-", body)
    return f'<svg class="{kind}" role="img" aria-label="{escape(title)}" {view.group(0) if view else ""}>{body.strip()}'


def _axes(figure: "Figure", unit: str, shown_s: tuple[float, float]) -> "Axes":
    axes = figure.subplots()
    axes.set_xlim(*shown_s)
    axes.set_ylabel(unit)
    axes.set_xlabel("s")
    axes.grid(True, lw=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(length=0)
    return axes


def _column(entries: Sequence[dict[str, Any]], name: str) -> Array:
    """One value of each entry; NaN where it is missing."""
    return np.array([np.nan if entry.get(name) is None else entry[name] for entry in entries], dtype=float)


def _thin(x: Array, y: Array) -> tuple[Array, Array]:
    """The same signal in few points: the smallest and the largest of each of many pieces."""
    if y.size <= MOST_POINTS:
        return x, y
    rows: list[int] = []
    for piece in np.array_split(np.arange(y.size), MOST_POINTS // 2):
        values = y[piece]
        if np.isnan(values).all():
            rows.append(int(piece[0]))
        else:
            rows += sorted({int(piece[np.nanargmin(values)]), int(piece[np.nanargmax(values)])})
    return x[rows], y[rows]


def _light(name: str) -> str:
    return COLOURS[name][0]
