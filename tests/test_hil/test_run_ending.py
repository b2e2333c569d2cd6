"""The last line of a run is honest, and its page shows what happened."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from bender_hil.log.ending import EndOfRun, conduct, count_swings, last_line
from bender_hil.log.page import page
from bender_hil.log.read_run import RunLog
from bender_hil.log.results import slew_rows
from bender_hil.log.summary import Summary
from bender_loop.control.metrics import StepMetrics

WELL = Summary(900, 0, 0, 0, 0, 0, (5.0, 9.0, 12.0), True, 30.0, 40.0)
PLANNED = EndOfRun(None, None, "", None)
STEP = StepMetrics(1.0, 1.0, 8.0, 0.2, 0.5, 0.0, 40.0, 40.0)


@pytest.mark.parametrize(
    ("change", "swings", "overshoot", "words"),
    [
        ({"late": 16, "ticks": 90}, 0, 8.0, "16 of 90 ticks late"),
        ({"lost": 20}, 0, 8.0, "20 of 900 readings without a tip"),
        ({"skipped": 62}, 0, 8.0, "62 readings skipped"),
        ({}, 5, 8.0, "it oscillated"),
        ({}, 0, 39.0, "wide overshoot (39 %)"),
        ({"ticks": 0}, 0, 8.0, "not one reading"),
    ],
)
def test_the_last_line_never_says_as_planned_over_what_a_person_has_to_know(
    change: dict[str, int], swings: int, overshoot: float, words: str
):
    said = conduct(replace(WELL, **change), swings, replace(STEP, overshoot_percent=overshoot))
    line = last_line(said, PLANNED)
    assert line.startswith("not as planned")
    assert words in line
    assert line.endswith("output off")


def test_the_last_line_of_a_good_run_counts_what_there_was():
    assert last_line(conduct(WELL, 0, STEP), PLANNED) == "as planned; output off"
    line = last_line(conduct(replace(WELL, late=1, lost=2), 4, None), PLANNED)
    assert line == "as planned; 1 of 900 ticks late, 2 of 900 readings without a tip; output off"
    line = last_line(conduct(replace(WELL, late=90), 0, None), EndOfRun("interrupted", "x", "", "SIGTERM"))
    assert line == "interrupted by SIGTERM; 90 of 900 ticks late; output off"
    line = last_line(conduct(WELL, 0, None), EndOfRun("band", "3 V are measured", "", None))
    assert line == "ended by a rule (band): 3 V are measured; output off"


def test_the_alarm_is_never_followed_by_output_off():
    line = last_line(conduct(replace(WELL, late=90), 7, STEP), EndOfRun("supply", "gone", "OUTPUT STATE UNKNOWN", None))
    assert line.startswith("OUTPUT STATE UNKNOWN")
    assert "output off" not in line


def _log(folder: Path, ticks: int, **start: object) -> RunLog:
    rows = [
        {
            "kind": "tick", "sequence": k, "grabbed_s": 100.0 + k / 30.0, "measured_um": None if k == 5 else 0.1 * k,
            "setpoint_um": 8.0, "command_V": 0.2 * k, "late": False, "skipped": 0,
        }
        for k in range(ticks)
    ]  # fmt: skip
    guard = [{"kind": "armed", "t": 99.0}]
    for row in rows:
        at_s = row["grabbed_s"] + (0.05 if row["sequence"] == 7 else 0.005)
        guard.append({"kind": "applied", "sequence": row["sequence"], "command_time_s": at_s, "whole": True, "t": at_s})
        guard.append({"kind": "measured", "t": at_s + 0.001, "supply_voltage_V": row["command_V"]})
    guard.append({"kind": "output_off", "t": 100.1 + ticks / 30.0})
    facts = {"emulated": True, "period_s": 1.0 / 30.0, "date": "2026-05-04T10:11:12+00:00", **start}
    return RunLog(folder, facts, tuple(rows), (), tuple(guard))


def test_the_slew_of_the_controller_stands_beside_that_of_the_guard(tmp_path: Path):
    loop = {"mode": "closed_loop", "slew_V_per_s": 225.0}
    log = RunLog(tmp_path, {"program": loop, "bench": {"guard": {"slew_V_per_s": 250.0}}}, (), (), ())
    ((what, told),) = slew_rows(log)
    assert what == "fastest command allowed, V/s"
    assert told == "225 by the controller (90 % of the guard's), 250 by the guard"
    assert slew_rows(RunLog(tmp_path, {"program": {"mode": "open_loop"}}, (), (), ())) == []


def test_swings_are_counted_in_closed_loops_whose_limits_are_known(tmp_path: Path):
    limits = {"travel_um": [-10.0, 45.0], "maximum_V": 50.0, "minimum_V": 0.0}
    ticks = tuple({"setpoint_um": 8.0, "measured_um": 20.0 * (k % 2), "command_V": 10.0} for k in range(9))
    start = {"program": {"mode": "closed_loop"}, "bench": {"guard": limits}}
    assert count_swings(RunLog(tmp_path, start, ticks, (), ())) > 0
    for other in ({**start, "program": {"mode": "open_loop"}}, {"program": start["program"]}):
        assert count_swings(RunLog(tmp_path, other, ticks, (), ())) == 0


class _Well(HTMLParser):
    """Collects tags and complains about one that is not closed in its order."""

    VOID = ("meta", "path", "use", "rect", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open.pop() == tag


def test_the_page_of_a_run_needs_nothing_else(tmp_path: Path):
    rows = [["ticks <&>", "12, 0"]]
    text = page(_log(tmp_path / "a<b", 12), rows, "not as planned; 1 & 2", conduct(WELL, 0, None), PLANNED)
    parser = _Well()
    parser.feed(text)
    assert parser.open == []
    drawings = [facts["class"] for tag, facts in parser.seen if tag == "figure"]
    assert drawings == ["wide", "narrow"] * 3
    assert "a&lt;b" in text
    assert "ticks &lt;&amp;&gt;" in text
    assert "readings without a tip: 1" in text
    assert not re.search(r"\b(frames?|wire)\b", text)
    # tick 7 came on the wire after 50 ms: the chart marks what the last line counts
    assert "late ticks: 1<" in text
    assert "output off at" in text
    names = [facts["id"] for _, facts in parser.seen if facts.get("id")]
    assert len(names) == len(set(names))
    # nothing is fetched from anywhere, and no colour is bound to a light page
    assert not re.search(r"(src|href)=\"(?!#)", text)
    assert "url(http" not in text
    assert not set(re.findall(r"stroke: (#[0-9a-f]{6})", text))


def test_the_page_of_a_run_without_ticks_says_so(tmp_path: Path):
    said = conduct(replace(WELL, ticks=0), 0, None)
    text = page(_log(tmp_path, 0), [], "not as planned", said, PLANNED)
    assert "nothing to draw" in text


@pytest.mark.slow
def test_a_long_run_is_drawn_in_few_points(tmp_path: Path):
    short = len(page(_log(tmp_path, 2000), [], "x", conduct(WELL, 0, None), PLANNED))
    long = len(page(_log(tmp_path, 20_000), [], "x", conduct(WELL, 0, None), PLANNED))
    assert long < 4 * short
