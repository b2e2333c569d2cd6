"""What a run leaves beside its journals: the record, `summary.json`, `summary.html`, and the lines that are printed.

`recover` makes the same from the journals of a run whose controller was killed.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bender_hil.log.ending import Conduct, EndOfRun, conduct, count_swings, last_line
from bender_hil.log.expectation import unexpected_behaviour
from bender_hil.log.figures import (
    PAPER_R2_DOWN,
    PAPER_R2_UP,
    PAPER_SENSITIVITY_UM_PER_V,
    Staircase,
    staircase_figures,
    step_figures,
)
from bender_hil.log.page import page
from bender_hil.log.read_run import GUARD, RUN, RunLog, malformed_is_bad_input, read_run
from bender_hil.log.summary import Summary, summarise
from bender_hil.log.to_record import to_record
from bender_loop.control.metrics import StepMetrics
from bender_loop.errors import InputError
from bender_loop.records.record import read_record, write_record
from bender_loop.shell.files import finite, write_atomically, write_result

RECORD, FIGURES, PAGE = "record.csv", "summary.json", "summary.html"
Row = Sequence[str | float | int | None]


@dataclass(frozen=True, slots=True)
class Results:
    """What came of a run.

    Attributes:
        directory: of the run.
        title: of the table.
        rows: of the table, what and found.
        line: how the run ended, the last line.
        written: names of the files that are there.
        unwritten: what could not be written, a sentence each.
    """

    directory: Path
    title: str
    rows: list[Row]
    line: str
    written: list[str]
    unwritten: list[str]


def write_results(directory: Path, log: RunLog, record: Path | None, end: EndOfRun) -> Results:
    """Write `summary.json` and `summary.html`, and say what is there; never raises for a disk that is full.

    Args:
        directory: of the run.
        log: its journals, empty where they could not be read.
        record: path of its record, None where there is none.
        end: how it ended.
    """
    summary, swings = summarise(log), count_swings(log)
    step = stairs = None
    unwritten: list[str] = []
    try:
        if record is not None:
            found = read_record(record)
            step, stairs = step_figures(found), staircase_figures(found)
    except InputError as error:
        unwritten.append(str(error))
    said = conduct(summary, swings, step, unexpected_behaviour(log))
    line = last_line(said, end)
    rows = [*_rows(summary, swings, step, stairs), *slew_rows(log)]
    facts = _facts(summary, swings, step, stairs, said, end, line) | {"at_rest": log.start.get("at_rest")}
    try:
        write_result(directory / FIGURES, finite(facts))
        with malformed_is_bad_input(directory):
            text = page(log, rows, line, said, end)
        write_atomically(directory / PAGE, text)
    except InputError as error:
        unwritten.append(str(error))
    title = f"run on the {'emulated ' if summary.emulated else ''}bench"
    names = [name for name in (RUN, GUARD, RECORD, FIGURES, PAGE) if (directory / name).is_file()]
    return Results(directory, title, rows, line, names, unwritten)


def recover(directory: Path) -> Results:
    """Make the record and the summary of a run that ended before it could do so itself.

    Raises:
        InputError: there is no run in the directory, its journals are damaged, or its record is there already.
    """
    if (directory / RECORD).exists():
        raise InputError(f"{directory / RECORD}: is there already; there is nothing to recover")
    log = read_run(directory)
    with malformed_is_bad_input(directory):
        record, end = to_record(log), _end_in(log)
        # what the page and the table need of the logs is asked before anything is written
        summarise(log)
        count_swings(log)
        unexpected_behaviour(log)
    if record is None:
        raise InputError(f"{directory}: fewer than two ticks reached the supply, which makes no record")
    write_record(directory / RECORD, record)
    return write_results(directory, log, directory / RECORD, end)


def _end_in(log: RunLog) -> EndOfRun:
    """How a run ended by its journals alone."""
    end = log.guard_entry("end")
    if end is None:
        return EndOfRun(None, None, "the guard's journal has no end: make sure that the output is off", None)
    told = next((entry for entry in log.events if entry["kind"] == "ended_by_controller"), {})
    signal = str(told["sentence"]).split()[0] if told.get("code") == "interrupted" else None
    return EndOfRun(end.get("code"), end.get("sentence"), end.get("alarm") or "", signal)


def _facts(
    summary: Summary,
    swings: int,
    step: StepMetrics | None,
    stairs: Staircase | None,
    said: Conduct,
    end: EndOfRun,
    line: str,
) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "ended": line,
        "code": end.code,
        "as_planned": not (end.code or end.alarm or said.remarks),
        "remarks": [*said.remarks, *said.counts],
        "unexplained_swings": swings,
        **asdict(summary),
    }
    if step is not None:
        facts["step"] = asdict(step)
    if stairs is not None:
        facts["staircase"] = asdict(stairs)
    return facts


def _rows(summary: Summary, swings: int, step: StepMetrics | None, stairs: Staircase | None) -> list[Row]:
    median, high, most = summary.frame_to_command_ms
    rows: list[Row] = [
        [
            "ticks, skipped, missing, late, lost",
            f"{summary.ticks}, {summary.skipped}, {summary.missing}, {summary.late}, {summary.lost}",
        ],
        ["reading to command, ms: median, p99, max", f"{median:.2f}, {high:.2f}, {most:.2f}"],
        ["commands clamped, slowed by the guard", f"{summary.clamped}, {summary.slowed}"],
        ["swings that the set-point does not explain", swings],
        ["output off, harmless, ms after the end", f"{_ms(summary.off_after_ms)}, {_ms(summary.harmless_after_ms)}"],
    ]
    if step is not None:
        settled = "never" if math.isnan(step.settling_time_s) else f"{step.settling_time_s:.3f}"
        figures = f"{step.overshoot_percent:.2f}, {settled}, {step.steady_state_error_um:+.3f}"
        rows.append(["overshoot %, settling s (2 %), error µm", figures])
    if stairs is not None:
        up, down = stairs.up, stairs.down
        rows += [
            [
                f"sensitivity up, down, µm/V (paper: {PAPER_SENSITIVITY_UM_PER_V})",
                f"{up.sensitivity_um_per_V:.3f}, {down.sensitivity_um_per_V:.3f}",
            ],
            [f"R2 up, down (paper: {PAPER_R2_UP}, {PAPER_R2_DOWN})", f"{up.r_squared:.4f}, {down.r_squared:.4f}"],
            ["widest loop, µm", f"{stairs.loop_width_um:.2f}"],
        ]
    return rows


def slew_rows(log: RunLog) -> list[Row]:
    """Return how fast a command may change: a controller keeps to a part of what the guard lets through."""
    of_controller = log.start.get("program", {}).get("slew_V_per_s")
    of_guard = log.start.get("bench", {}).get("guard", {}).get("slew_V_per_s")
    if of_controller is None or of_guard is None:
        return []
    share = 100.0 * of_controller / of_guard
    told = f"{of_controller:g} by the controller ({share:.0f} % of the guard's), {of_guard:g} by the guard"
    return [["fastest command allowed, V/s", told]]


def _ms(value: float | None) -> str:
    return "not measured" if value is None else f"{value:.0f}"
