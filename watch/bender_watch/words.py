"""Events in words, for a terminal and a page."""

import math
from typing import Any

from bender_report.wording import chance

Event = dict[str, Any]

WEEK_S, DAY_S, HOUR_S, MINUTE_S = 604800.0, 86400.0, 3600.0, 60.0


KNOWN = 0.5
"""Deviation of a size, as a part of it, from which on the size is not told."""


def duration(seconds: float | None) -> str:
    """Return a time in the unit that suits it."""
    if seconds is None or not math.isfinite(seconds):
        return "never"
    for unit, name in ((WEEK_S, "weeks"), (DAY_S, "days"), (HOUR_S, "h"), (MINUTE_S, "min")):
        if seconds >= 2.0 * unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.3g} s"


def _command(event: Event) -> str:
    return event.get("units", ("V", "µm"))[0]


def _reading(event: Event) -> str:
    return event.get("units", ("V", "µm"))[1]


def sentence(event: Event) -> str:
    """Return an event as one line."""
    return _WORDS.get(event["event"], lambda x: str(x["event"]))(event)


def _baseline(event: Event) -> str:
    raised = event["raised_by_training"]
    more = f"; raised by the training record itself: {', '.join(raised)}" if raised else ""
    return (
        f"learned from {event['rows']} rows of {event['from']}: noise {event['noise_um']:.3g} {_reading(event)} rms, "
        f"{len(event['tests']) + 4} tests, one false alarm in {event['rows_between_false_alarms']:.3g} rows{more}"
    )


def _record(event: Event) -> str:
    return f"record {event['record']}, from {event['time_s']:.6g} s"


def _passed_over(event: Event) -> str:
    return f"passed over: {event['reason']}"


def _outside(event: Event) -> str:
    low, high = event["range_V"]
    return (
        f"{event['time_s']:.6g} s: outside the training range ({event['voltage_V']:.4g} {_command(event)}, trained "
        f"{low:.4g} to {high:.4g} {_command(event)}); not judged"
    )


def _inside(event: Event) -> str:
    return f"{event['time_s']:.6g} s: inside the training range again"


def _since(event: Event) -> str:
    since = event["since"]
    return f"since {since['time_s']:.6g} s ({since['time_low_s']:.6g} to {since['time_high_s']:.6g} s)"


def _size(event: Event) -> str:
    size = event["size"]
    if "noise_ratio" in size:
        text = f"noise {size['noise_ratio']:.3g} times as large"
    elif "lost_rows" in size:
        text = f"{size['lost_rows']} rows without a reading"
    elif "correlation" in size:
        text = f"noise that repeats itself ({size['correlation']:.2g})"
    elif size.get("std_um") is None or not size["std_um"] < KNOWN * size["rms_um"]:
        text = "size not known yet"
    else:
        text = f"{size['rms_um']:.3g} ± {size['std_um']:.2g} {_reading(event)}"
    return f"{text}{', growing' if size['grows'] else ''}"


def _suspects(event: Event) -> str:
    found = [f"{' or '.join(x['effects'])} ({100.0 * x['weight']:.0f} %)" for x in event["suspects"]]
    return f"; suspected: {', '.join(found)}" if found else ""


def _alarm(event: Event) -> str:
    told = f"{_size(event)}{_suspects(event)}{_advice(event)}"
    return f"ALARM {event['number']} at {event['time_s']:.6g} s, {_since(event)}: {told}"


def _advice(event: Event) -> str:
    return "".join(f"; {x}" for x in event.get("advice", ()))


def _moves_again(event: Event) -> str:
    return f"{event['time_s']:.6g} s: the reading moves again; the watch goes on as before"


def _explained(event: Event) -> str:
    parts = [f"alarm {event['alarm']}, {_since(event)}: {_size(event)}"]
    if "verdict" in event:
        names = [
            f"{x['id']} ({x['grade']}, probability {chance(x.get('probability') or 0.0)})" for x in event["effects"][:3]
        ]
        parts.append(f"{event['verdict']}{': ' + ', '.join(names) if names else ''}; {event['sentence'].rstrip('.')}")
        loop = event["loop"]
        if loop:
            parts.append(f"loop: {_loop(loop['before'])}, now {_loop(loop['after'])}")
        parts.append("; ".join(event["advice"]))
    else:
        parts.append(_suspects(event).removeprefix("; "))
    parts.append(f"the watch goes on {event['goes_on']}")
    return ". ".join(x for x in parts if x)


def _loop(figures: Event) -> str:
    peak = figures["sensitivity_peak"]
    return "unstable" if peak is None else f"Ms {peak:.3g}, settles in {duration(figures['settling_s'])}"


def _trend(event: Event) -> str:
    unit = " %" if event["of"] == "gain" else f" {_reading(event)}"
    scale = 100.0 if event["of"] == "gain" else 1.0
    now = f"{event['of']} {scale * event['now']:+.3g}{unit}"
    if not event["significant"]:
        return f"trend: {now}, not moving"
    return f"trend: {now}, {scale * DAY_S * event['per_s']:+.3g}{unit} a day; {forecast(event)}"


def forecast(trend: Event) -> str:
    """Return when a trend that is one leaves what is allowed."""
    likely, low, high = (trend[f"leaves_{x}_s"] for x in ("in", "low", "high"))
    if low is None:
        return "stays within what is allowed"
    if likely is None:
        return f"likely stays within what is allowed; leaves it in {duration(low)} at the earliest"
    return f"leaves what is allowed in {duration(likely)} ({duration(low)} to {duration(high)})"


_WORDS = {
    "baseline": _baseline,
    "record": _record,
    "passed_over": _passed_over,
    "outside_training_range": _outside,
    "inside_again": _inside,
    "alarm": _alarm,
    "explained": _explained,
    "moves_again": _moves_again,
    "trend": _trend,
}
