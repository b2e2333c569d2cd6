"""The page about a watch: the whitened residual, the tests against their thresholds, every alarm and trend."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bender_loop.shell.files import write_atomically
from bender_report.chart import Chart, chart
from bender_report.page import Card, Page, Picture, Section, Table, render
from bender_report.palette import light
from bender_report.wording import chance, percent
from bender_watch.words import forecast, sentence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bender_watch.session import Session
    from bender_watch.watcher import Watcher


def write_report(path: Path, session: "Session", watcher: "Watcher", facts: dict[str, Any]) -> None:
    """Write the page."""
    write_atomically(path, report_page(session.events, watcher, facts))


def report_page(events: list[dict[str, Any]], watcher: "Watcher", facts: dict[str, Any]) -> str:
    """Return the page.

    Args:
        events: of the watch.
        watcher: as it stands at the end.
        facts: of `watch.json`.
    """
    count = facts["alarms"]
    lead = "No alarm." if not count else f"{count} alarm{'s' if count > 1 else ''}."
    cards = [
        Card(str(facts["judged"]), "rows judged", f"of {facts['rows']}"),
        Card(str(count), "alarms", f"a false one in {facts['rows_between_false_alarms']:.3g} rows"),
        Card(str(facts["outside_training_range"]), "rows outside the training range", "not judged"),
    ]
    sections = [Section("What was seen", picture=_picture(watcher, events))]
    for event in events:
        if event["event"] == "alarm":
            sections.append(Section(f"Alarm {event['number']}", [sentence(event)]))
        elif event["event"] == "explained":
            sections.append(_explained(event))
    if facts["trends"]:
        sections.append(_trends(facts["trends"]))
    sections.append(_baseline(facts["baseline"], facts.get("units", ("V", "µm"))[1]))
    return render(Page("Watch", lead, cards, sections))


def _explained(event: dict[str, Any]) -> Section:
    rows = [
        [
            x["id"],
            x["grade"],
            _chance(x),
            "–" if x.get("share_of_gap") is None else percent(x["share_of_gap"]),
            x["evidence"],
        ]
        for x in event.get("effects", ())
    ]
    table = Table(("effect", "grade", "probability", "part of the gap closed", "evidence"), rows) if rows else None
    return Section(f"What alarm {event['alarm']} was", [sentence(event)], table, bullets=list(event.get("advice", ())))


def _chance(effect: dict[str, Any]) -> str:
    return "–" if effect.get("probability") is None else chance(effect["probability"])


def _trends(trends: list[dict[str, Any]]) -> Section:
    rows = [
        [x["name"], x["now"], x["per_s"], x["per_s_std"], _forecast(x)] for x in trends
    ]  # fmt: skip
    return Section("Trends", table=Table(("of", "now", "a second", "±", "forecast"), rows))


def _forecast(trend: dict[str, Any]) -> str:
    if not trend["significant"]:
        return "not moving"
    return forecast(trend)


def _baseline(facts: dict[str, Any], unit: str) -> Section:
    rows = [[name, ", ".join(effects) or "–"] for name, effects in facts["tests"].items()]
    raised = facts["raised_by_training"]
    told = [
        f"{facts['rows']} rows; noise {facts['noise_um']:.3g} {unit} rms, of order {facts['order']}; "
        f"gain × {facts['gain']:.4g}, offset {facts['offset_um']:+.3g} {unit} beside the model."
    ]
    if raised:
        told.append(f"The training record itself goes beyond the thresholds of {', '.join(raised)}: these are raised.")
    return Section("What is normal", told, Table(("signature", "effects that it stands for"), rows))


def _picture(watcher: "Watcher", events: list[dict[str, Any]]) -> Picture:
    alt = "The whitened residual over time, and the largest test statistic over its threshold."
    return Picture(_lanes(watcher, events, alt), alt)


def _lanes(watcher: "Watcher", events: list[dict[str, Any]], alt: str) -> Chart:
    rows = watcher.lane.table
    raised = [x["time_s"] for x in events if x["event"] == "alarm"]

    def draw(figure: "Figure", narrow: bool) -> None:
        del narrow
        upper, lower = figure.subplots(2, 1, sharex=True)
        if len(rows):
            low, high = np.clip(rows[:, 1], -8.0, 8.0), np.clip(rows[:, 2], -8.0, 8.0)
            upper.fill_between(rows[:, 0], low, high, color=light("measured"), lw=0.0, alpha=0.8)
            lower.plot(rows[:, 0], rows[:, 3], color=light("given"), lw=0.9)
        lower.axhline(1.0, color=light("ink"), lw=0.8, ls="--")
        for time_s in raised:
            for axes in (upper, lower):
                axes.axvline(time_s, color=light("without"), lw=1.0)
        upper.set(ylabel="whitened residual", title="residual in deviations of its noise")
        lower.set(xlabel="time (s)", ylabel="statistic", title="largest statistic over its threshold", ylim=(0.0, 1.6))

    return chart("watch", alt, draw, 920, 420, 360)
