"""The page: picture, charts, state, decisions and STOP, live or replayed.

NiceGUI draws it and keeps it up to date; the picture and the STOP button are plain JavaScript of `page.js`, which talks
to the picture's address and to the button's own process. Nothing that happens on the page reaches the run, but STOP.
"""

import asyncio
import copy
import html
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bender_hil.live.frame_board import ShownFrame, frame_number, read_frame
from bender_hil.live.run_view import RunView, decisions, newest_run, whole_run
from bender_hil.live.watch_view import WatchView
from bender_loop.shell.opencv import import_cv2
from bender_report.palette import light

SHOWN_S = 20.0
"""Of time on the charts."""
REDRAWN_S = 0.5
MOST_POINTS = 400
_WAIT_S, _LOOK_S = 0.5, 0.008
_CROSS_PX, _JPEG_QUALITY = 14, 80
_HERE = Path(__file__).parent
CLOSED = "the run is over: this page stays as it is; bender live shows the run again"
Point = tuple[float, float | None]


@dataclass(slots=True)
class Shown:
    """What the page shows.

    Attributes:
        folder: of the run, or of the investigation.
        board: of the newest frame; None for a replay.
        stop_url: of the STOP button; "" for a replay.
        is_replay: whether the run is over and shown again.
        cursor_s: until when a replay is shown.
        is_playing: whether the cursor moves by itself.
        view: of the run.
        clock: of the journals.
        is_closing: the run is over, and this process ends once every browser has seen its end.
        redrawn: how often the page was drawn since then.
    """

    folder: Path
    board: Path | None
    stop_url: str
    is_replay: bool = False
    cursor_s: float = 0.0
    is_playing: bool = True
    view: RunView | None = None
    jpeg: tuple[int, bytes] = (-1, b"")
    decisions: list[str] = field(default_factory=list)
    clock: Callable[[], float] = time.perf_counter
    is_closing: bool = False
    redrawn: int = 0

    def look(self, passed_s: float) -> None:
        """Read what is new, or move the cursor of a replay."""
        folder = newest_run(self.folder)
        if folder is None:
            self.decisions = decisions(self.folder)
            return
        if self.is_replay:
            self.view = self.view or whole_run(folder)
            if self.is_playing:
                self.cursor_s = min(self.cursor_s + passed_s, self.view.duration_s)
        else:
            if self.view is None or self.view.folder != folder:
                self.view = RunView(folder)
            self.view.update()
            self.cursor_s = self.view.now_s(self.clock())
        self.decisions = decisions(self.folder)

    @property
    def is_settled(self) -> bool:
        """Whether nothing more is to be shown: there is no run, nothing was armed, or its last word has been said."""
        return self.view is None or not self.view.output.is_armed or self.view.output.is_over

    @property
    def end(self) -> str:
        """What is to be said of the output once the run is over; "" before."""
        if self.view is None or self.is_replay or not self.view.output.is_over:
            return ""
        return self.view.output.at(math.inf).state

    def newest(self) -> int:
        """Return the number of the newest picture, -1 where there is none; a replay has to read it."""
        if self.is_replay:
            return self.picture()[0]
        return -1 if self.board is None else frame_number(self.board)

    def picture(self) -> tuple[int, bytes]:
        """Return the number of the newest picture and the picture as JPEG; -1 and nothing where there is none."""
        if self.is_replay:
            return self._kept()
        number = -1 if self.board is None else frame_number(self.board)
        if number < 0 or self.board is None:
            return -1, b""
        if number != self.jpeg[0] and (frame := read_frame(self.board)) is not None:
            self.jpeg = frame.number, drawn(frame)
        return self.jpeg

    def _kept(self) -> tuple[int, bytes]:
        """Return the picture of a past run that was kept for the time of the cursor, those around a trip."""
        if self.view is None:
            return -1, b""
        rows = self.view.up_to(self.cursor_s)
        if not rows:
            return -1, b""
        path = self.view.folder / "frames" / f"frame-{rows[-1].frame:06d}.png"
        try:
            return rows[-1].frame, path.read_bytes()
        except OSError:
            return -1, b""


def drawn(frame: ShownFrame) -> bytes:
    """Return a frame with the found tip in it, as JPEG."""
    cv2 = import_cv2()
    image = cv2.cvtColor(frame.image, cv2.COLOR_GRAY2BGR)
    x, y = frame.tip_px
    if math.isfinite(x) and math.isfinite(y):
        place = round(x), round(y)
        cv2.drawMarker(image, place, (40, 28, 192), cv2.MARKER_CROSS, 2 * _CROSS_PX, 1)
        cv2.circle(image, place, _CROSS_PX, (40, 28, 192), 1, cv2.LINE_AA)
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes() if done else b""


def facts(shown: Shown) -> list[tuple[str, str]]:
    """Return what is said beside the picture."""
    view = shown.view
    if view is None:
        return [("run", "none yet")]
    rows = view.up_to(shown.cursor_s) if shown.is_replay else list(view.rows)
    at_s, output = view.clock_s(shown.cursor_s), view.output
    latest = rows[-1] if rows else None
    latency = sorted(x.latency_ms for x in rows[-300:] if x.latency_ms is not None)
    told = output.command(at_s)
    before = "" if told is None else ", before the way down"
    return [
        ("bench", "emulated" if view.emulated else "real" if view.emulated is False else "not known yet"),
        ("run", view.folder.name),
        ("guard", output.state(at_s, None if shown.is_replay else shown.clock())),
        ("time", f"{shown.cursor_s:.1f} s" if latest else "-"),
        ("tip", _value(latest.tip_um if latest else None, "µm", "not found") + before),
        ("set-point", "none" if before else _value(latest.setpoint_um if latest else None, "µm", "none")),
        ("command", told or _value(latest.command_V if latest else None, "V", "-")),
        ("measured", output.voltage(at_s)),
        (
            "reading to command",
            f"median {latency[len(latency) // 2]:.1f} ms, most {latency[-1]:.1f} ms" if latency else "-",
        ),
        ("ticks, late, lost", f"{view.ticks}, {view.late}, {view.lost}"),
        *([("watch", watched)] if (watched := view.watch.told(shown.cursor_s)) else []),
        *([("page", CLOSED)] if shown.is_closing else []),
    ]


def charts(shown: Shown) -> dict[str, list[list[Point]]]:
    """Return the lines of every chart, the newest seconds of them."""
    view = shown.view
    if view is None:
        return {"tip": [[], []], "voltage": [[], [], []], "latency": [[], []], "residual": [[]], "statistic": [[], []]}
    begin_s = shown.cursor_s - SHOWN_S
    rows = _few([x for x in view.up_to(shown.cursor_s) if x.time_s >= begin_s])
    measured = view.measured(max(begin_s, 0.0), shown.cursor_s)
    volts: list[Point] = _few([x for x in measured if x[0] < view.falls_s])
    after: list[Point] = _few([x for x in measured if x[0] >= view.falls_s])
    descent: list[Point] = [*view.descent(begin_s, shown.cursor_s)]
    return {
        "tip": [[(x.time_s, x.setpoint_um) for x in rows], [(x.time_s, x.tip_um) for x in rows]],
        "voltage": [[(x.time_s, x.command_V) for x in rows] + descent, volts, after],
        "latency": [
            [(x.time_s, x.latency_ms) for x in rows if not x.is_late],
            [(x.time_s, x.latency_ms) for x in rows if x.is_late],
        ],
    } | _watched(view.watch, shown.cursor_s)


def _watched(watch: WatchView, until_s: float) -> dict[str, list[list[Point]]]:
    """Return the lines of a watch: the newest seconds that it has looked at."""
    end_s = min(until_s, watch.stretches[-1][0]) if watch.stretches else until_s
    residual: list[Point] = [*watch.residual(end_s - SHOWN_S, end_s)]
    statistic: list[Point] = [*watch.statistic(end_s - SHOWN_S, end_s)]
    threshold: list[Point] = [(statistic[k][0], 1.0) for k in (0, -1)] if statistic else []
    return {"residual": [residual], "statistic": [statistic, threshold]}


def _few(rows: Sequence[Any]) -> list[Any]:
    """Return not too many of the rows, the newest always: a voltage that has come down is not to stay up on a chart."""
    stride = max(1, math.ceil(len(rows) / MOST_POINTS))
    return list(rows[::-stride][::-1])


def _value(value: float | None, unit: str, none: str) -> str:
    return none if value is None else f"{value:.2f} {unit}"


def _options(
    unit: str, names: Sequence[str], colours: Sequence[str], *, dots: Sequence[str] = (), size_px: int = 4
) -> dict[str, Any]:
    """Return the options of a chart; `dots` are the names that are drawn as dots of that size."""
    line = {"type": "line", "showSymbol": False, "step": "end", "lineStyle": {"width": 1.6}}
    dot = {"type": "scatter", "symbolSize": size_px}
    return {
        "animation": False,
        "grid": {"left": 52, "right": 14, "top": 34, "bottom": 34},
        "legend": {"top": 2, "right": 10, "textStyle": {"fontSize": 13}},
        "xAxis": {
            "type": "value",
            "name": "s",
            "min": "dataMin",
            "max": "dataMax",
            "axisLabel": {"showMinLabel": False, "showMaxLabel": False},
        },
        "yAxis": {"type": "value", "name": unit, "scale": len(dots) < len(names)},
        "series": [
            {"name": name, "data": [], "color": light(colour), **(dot if name in dots else line)}
            for name, colour in zip(names, colours, strict=True)
        ],
    }


AFTER = "measured, off"
CHARTS = (
    ("tip", "Tip and set-point", _options("µm", ("set-point", "tip"), ("caution", "with"))),
    (
        "voltage",
        "Command and measured voltage",
        _options("V", ("command", "measured", AFTER), ("rising", "good", "good"), dots=(AFTER,), size_px=7),
    ),
    (
        "latency",
        "From reading to command",
        _options("ms", ("in time", "late"), ("rising", "without"), dots=("in time", "late")),
    ),
    ("residual", "Watch: measured beside the model", _options("σ", ("residual",), ("with",))),
    (
        "statistic",
        "Watch: largest statistic over its threshold",
        _options("", ("statistic", "threshold"), ("rising", "without")),
    ),
)
OF_WATCH = ("residual", "statistic")
"""Charts that are shown where a watch looks at the run."""


def build(shown: Shown) -> None:
    """Declare the page and the address of its picture."""
    from fastapi import Response
    from nicegui import app, ui

    drawing = asyncio.Lock()

    @app.get("/picture.jpg")
    async def picture(after: int = -1) -> Response:
        """Return the newest picture as soon as there is another one than `after`."""
        loop = asyncio.get_running_loop()
        end_s = loop.time() + _WAIT_S
        while True:
            if shown.newest() not in (-1, after):
                async with drawing:  # whoever waits finds it drawn
                    number, data = await loop.run_in_executor(None, shown.picture)
                if number not in (-1, after):
                    kind = "image/png" if shown.is_replay else "image/jpeg"
                    told = {"X-Frame": str(number), "Cache-Control": "no-store"}
                    return Response(data, media_type=kind, headers=told)
            if loop.time() > end_s:
                return Response(status_code=204)
            await asyncio.sleep(_LOOK_S)

    @ui.page("/", title="piezo-bender live", response_timeout=20.0)
    def live() -> None:
        """Lay out the page for one browser."""
        _layout(shown, ui)

    app.timer(0.1, lambda: shown.look(0.1))


def _layout(shown: Shown, ui: Any) -> None:
    script = json.dumps({"stopUrl": shown.stop_url})
    ui.add_head_html(f"<style>{(_HERE / 'page.css').read_text(encoding='utf-8')}</style>")
    ui.add_body_html(f"<script>window.benderLive = {script};</script>")
    ui.add_body_html(f"<script>{(_HERE / 'page.js').read_text(encoding='utf-8')}</script>")
    with ui.element("header").classes("top"):
        title = "replay" if shown.is_replay else "live"
        ui.html(f"<h1>piezo-bender · {title} · {html.escape(shown.folder.name)}</h1>", sanitize=False)
        if not shown.is_replay:
            button = '<button id="stop" type="button" title="also: the space bar">STOP</button>'
            ui.html(button, sanitize=False).classes("stop")
            ui.html('<p id="stop-said" role="alert"></p>', sanitize=False)
    with ui.element("main").classes("live"):
        with ui.element("section").classes("panel"):
            ui.html("<h2>Camera, and the tip found in it</h2>", sanitize=False)
            ui.html('<img id="picture" alt="newest frame of the camera">', sanitize=False)
            if shown.is_replay:
                _replay_controls(shown, ui)
        with ui.element("section").classes("panel"):
            ui.html("<h2>State</h2>", sanitize=False)
            told = ui.html("", sanitize=False)
            ui.html("<h2>What is being done, and why</h2>", sanitize=False)
            why = ui.html("", sanitize=False)
        panels = {name: _chart(ui, name, heading, options) for name, heading, options in CHARTS}

    def redraw() -> None:
        """Show what there is now."""
        pairs = "".join(f"<dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd>" for k, v in facts(shown))
        end = f' data-end="{html.escape(shown.end)}"' if shown.end else ""
        closed = " data-closed" if shown.is_closing else ""
        told.set_content(f'<dl class="facts"{end}{closed}>{pairs}</dl>')
        shown.redrawn += shown.is_closing
        lines = "".join(f"<li>{html.escape(x)}</li>" for x in shown.decisions)
        why.set_content(f'<ol class="decisions">{lines}</ol>' if lines else "<p>a single run</p>")
        for name, lines_of in charts(shown).items():
            panel, chart = panels[name]
            if name in OF_WATCH:
                panel.set_visibility(bool(lines_of[0]))
            for series, points in zip(chart.options["series"], lines_of, strict=True):
                series["data"] = [(round(t, 3), None if y is None else round(y, 4)) for t, y in points]
            chart.update()

    ui.timer(REDRAWN_S, redraw)
    redraw()


def _chart(ui: Any, name: str, heading: str, options: dict[str, Any]) -> tuple[Any, Any]:
    """Return the panel and the chart in it."""
    with ui.element("section").classes("panel").props(f'data-chart="{name}"') as panel:
        ui.html(f"<h2>{heading}</h2>", sanitize=False)
        return panel, ui.echart(copy.deepcopy(options)).classes("chart")


def _replay_controls(shown: Shown, ui: Any) -> None:
    shown.look(0.0)
    longest_s = max(0.1, 0.0 if shown.view is None else shown.view.duration_s)
    with ui.row():
        ui.switch("play").bind_value(shown, "is_playing")
        ui.slider(min=0.0, max=longest_s, step=0.1).bind_value(shown, "cursor_s").style("min-width: 14rem")
