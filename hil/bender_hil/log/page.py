"""`summary.html`: a run on one page that needs nothing else, with charts as inline SVG, for a desk and for a phone."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bender_hil.log.ending import Conduct, EndOfRun
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import applied_times, deadline_s, late_ticks
from bender_report.chart import FONT_PX, WIDE_PX, Chart, Draw, chart, thinned
from bender_report.page import render_template
from bender_report.palette import light

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
HEIGHT_PX, NARROW_HEIGHT_PX = 300, 260
FEW = 200
SET_POINT, TIP, COMMAND, MEASURED, BAD = "caution", "with", "rising", "good", "without"
"""The colours of the palette that the lines of a run have."""
EVENTS = {"armed": "armed", "trip": "trip", "output_off": "output off"}
STYLE = """
.ended { border-left: 4px solid var(--good); padding: .5rem .75rem; margin: 1rem 0; font-weight: 600; }
.ended.remarked { border-color: var(--caution); } .ended.tripped { border-color: var(--without); }
td { overflow-wrap: anywhere; } td:first-child, .key { color: var(--muted); }
.key span { display: inline-block; margin-right: 1rem; }
.key i { display: inline-block; width: 1.2em; height: 3px; vertical-align: middle; margin-right: .35em; }
svg { display: block; width: 100%; height: auto; font-family: inherit; } figure.narrow { display: none; }
@media (max-width: 640px) { figure.wide { display: none; } figure.narrow { display: block; } }
"""


@dataclass(frozen=True, slots=True)
class Section:
    """One chart: its title, the meaning of its colours, and its drawings."""

    title: str
    key: Sequence[tuple[str, str]]
    chart: Chart


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
    version = log.start.get("versions", {}).get("piezo-bender", "unknown")
    date = str(log.start.get("date", ""))[:16].replace("T", " ")
    return render_template(
        "run.html.j2",
        Path(__file__).parent,
        STYLE,
        title=f"{log.directory.name}: run on the {where}",
        where=where,
        origin=" · ".join(filter(None, [log.directory.name, date, f"piezo-bender {version}"])),
        state="tripped" if end.code or end.alarm or end.signal else "remarked" if said.remarks else "",
        line=line,
        rows=rows,
        sections=_sections(log),
    )


def _sections(log: RunLog) -> list[Section]:
    if not log.ticks:
        return []
    origin_s = float(log.ticks[0]["grabbed_s"])
    time_s = _column(log.ticks, "grabbed_s") - origin_s
    tip_um, aim_um = _column(log.ticks, "measured_um"), _column(log.ticks, "setpoint_um")
    events = [(float(entry["t"]) - origin_s, EVENTS[entry["kind"]]) for entry in log.guard if entry["kind"] in EVENTS]

    times_s = [*time_s, *(at_s for at_s, _ in events)]
    room_s = 0.02 * (max(times_s) - min(times_s)) or 1.0
    shown_s = (min(times_s) - room_s, max(times_s) + room_s)
    dot = 5 if time_s.size < FEW else 3

    def tip(figure: "Figure", _: bool) -> None:
        axes = _axes(figure, "µm", shown_s)
        axes.step(*_few(time_s, aim_um), where="post", color=light(SET_POINT), lw=1.4)
        axes.plot(*_few(time_s, tip_um), color=light(TIP), lw=1.4)
        axes.plot(time_s[np.isnan(tip_um)], np.zeros(int(np.isnan(tip_um).sum())), "|", color=light(BAD), ms=9)

    def volts(figure: "Figure", narrow: bool) -> None:
        axes = _axes(figure, "V", shown_s)
        axes.step(*_few(time_s, _column(log.ticks, "command_V")), where="post", color=light(COMMAND), lw=1.4)
        measured = [entry for entry in log.guard if entry["kind"] == "measured"]
        read_s, read_V = _column(measured, "t") - origin_s, _column(measured, "supply_voltage_V")
        axes.plot(*_few(read_s, read_V), ".", color=light(MEASURED), ms=dot)
        for at_s, what in events:
            axes.axvline(at_s, color=light(BAD), lw=0.9, ls=(0, (4, 3)))
            if narrow:
                continue
            where = {"x": at_s, "y": 1.0, "s": what, "transform": axes.get_xaxis_transform()}
            axes.text(**where, color=light(BAD), rotation=90, ha="right", va="top", size=FONT_PX - 2)

    def delay(figure: "Figure", _: bool) -> None:
        axes = _axes(figure, "ms", shown_s)
        applied, allowed_ms = applied_times(log), 1e3 * deadline_s(log)
        delay_ms = np.array(
            [1e3 * (applied.get(tick["sequence"], np.nan) - tick["grabbed_s"]) for tick in log.ticks], dtype=float
        )
        axes.plot(*_few(time_s, delay_ms), ".", color=light(COMMAND), ms=dot)
        axes.axhline(allowed_ms, color=light(BAD), lw=0.9, ls=(0, (4, 3)))
        # a command that the next one overtook was never on the wire
        axes.plot(time_s[is_late], np.fmax(delay_ms, allowed_ms)[is_late], "o", color=light(BAD), ms=4)
        axes.set_ylim(bottom=0.0)

    lost = int(np.isnan(tip_um).sum())
    late = set(late_ticks(log))
    is_late = np.array([tick["sequence"] in late for tick in log.ticks], dtype=np.bool_)
    guard = "; ".join(f"{what} at {at_s:.2f} s" for at_s, what in events) or "its journal is empty"
    return [
        _section(
            "Tip and set-point", [(SET_POINT, "set-point"), (TIP, "tip"), (BAD, f"readings without a tip: {lost}")], tip
        ),
        _section("Voltage", [(COMMAND, "command"), (MEASURED, "measured"), (BAD, f"guard: {guard}")], volts),
        _section(
            "From reading to command", [(COMMAND, "delay"), (BAD, f"the deadline; late ticks: {len(late)}")], delay
        ),
    ]


def _section(title: str, key: Sequence[tuple[str, str]], draw: Draw) -> Section:
    name = title.lower().replace(" ", "-")
    return Section(title, key, chart(name, title, draw, WIDE_PX, HEIGHT_PX, NARROW_HEIGHT_PX))


def _axes(figure: "Figure", unit: str, shown_s: tuple[float, float]) -> "Axes":
    axes = figure.subplots()
    axes.set_xlim(*shown_s)
    axes.set_ylabel(unit)
    axes.set_xlabel("s")
    return axes


def _column(entries: Sequence[dict[str, Any]], name: str) -> Array:
    """Return one value of each entry; NaN where it is missing."""
    return np.array([np.nan if entry.get(name) is None else entry[name] for entry in entries], dtype=float)


def _few(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the same signal in few points."""
    rows = thinned(y)
    return x[rows], y[rows]
