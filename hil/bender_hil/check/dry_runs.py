"""The two runs of a check, and what they tell. Both go through the guard, as every run does."""

import math
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bender_hil.bench_file import BenchFile
from bender_hil.check.connected import connected
from bender_hil.check.findings import FAILED, FINE, REMARK, Finding
from bender_hil.guard.guard import FAULT, Status
from bender_hil.guard.start import GuardFaultError, SourceFailedError, SourceRefusedError
from bender_hil.log.ending import EndOfRun
from bender_hil.log.read_run import RunLog
from bender_hil.log.results import write_results
from bender_hil.runner.program import OpenLoop
from bender_hil.runner.run import RunResult, run
from bender_hil.runner.steadiness import NoReadingsError, UnsteadyError
from bender_hil.runner.voltages import Voltages
from bender_hil.sensors.sensor_eyes import NoSensorError
from bender_hil.sources.kinds import where_to_mend
from bender_loop.errors import InputError, RunError
from bender_loop.shell.run import doing

REST_S, STEP_S, AFTER_S = 2.0, 1.5, 1.0
FIRST_SHARE, LARGEST_SHARE = 0.02, 0.2
"""Of the highest voltage: the first step, and the largest that a check makes."""
SEEN = 5.0
"""A step is seen when it is so many times the noise of the mean."""
_TOO_SLOW = "close what else runs on this machine; a sensor that is slow needs a larger guard.frame_age_s"
_ADVICE = {
    "frame_age": _TOO_SLOW,
    "camera_stalled": _TOO_SLOW,
    "heartbeat": _TOO_SLOW,
    "noise": "look for a broken cable, a missing earth, an amplifier at its end",
    "frozen": "is the sensor live? One without any noise needs repeats_count = true",
    "travel": "the sensor reads far off at rest: its scale, its range, or guard.travel_um",
    "band": "the source does not give what it is told: its load, its current limit, or guard.settle_s",
}
_RATE_PART, _SLOW_PART = 0.1, 0.5

Fmu = Callable[[str], Path]


def check_at_rest(bench: BenchFile, out: Path, fmu: Fmu) -> tuple[list[Finding], RunLog | None]:
    """Run at 0 V; returns what was found, and the log where there was a run."""
    doing("dry run at 0 V")
    try:
        result = _run(bench, Voltages((0.0,), (0.0,), REST_S), out, fmu)
    except (NoSensorError, NoReadingsError) as error:
        return [Finding("sensor", FAILED, str(error), f"look at its cable, and at [sensor]; {_found_here()}")], None
    except SourceRefusedError as error:
        return [Finding("source", FAILED, str(error), f"correct the bench file; {_found_here()}")], None
    except InputError as error:
        advice = _TOO_SLOW if isinstance(error, UnsteadyError) else "correct the bench file"
        return [Finding("dry run at 0 V", FAILED, str(error), advice)], None
    except GuardFaultError as error:
        return [Finding("source", FAILED, error.sentence, error.advice)], None
    except SourceFailedError as error:
        return [Finding("source", FAILED, str(error), f"look at its cable and its address; {_found_here()}")], None
    except RunError as error:
        return [Finding("dry run at 0 V", FAILED, str(error), f"look at cables and addresses; {_found_here()}")], None
    found = [*_source(result.log), *_sensor(bench, result.log), _end("dry run at 0 V", bench, result)]
    return found, result.log


def _found_here() -> str:
    """What a search of this machine finds, for a wrong address; instruments of the network are not found so."""
    there = connected()
    return f"connected here: {'; '.join(there)}" if there else "a search of USB and serial ports finds nothing"


def check_answer(bench: BenchFile, out: Path, fmu: Fmu, noise_um: float) -> list[Finding]:
    """Run at the smallest voltage that shows, doubling it until it does or is as large as a check may be."""
    highest_V = bench.guard.maximum_V
    step_V, number = FIRST_SHARE * highest_V, 1
    while True:
        doing(f"dry run at {step_V:.3g} V")
        levels = Voltages((0.0, AFTER_S, AFTER_S + STEP_S), (0.0, step_V, 0.0), 2.0 * AFTER_S + STEP_S)
        try:
            result = _run(bench, levels, out / f"step-{number}", fmu)
        except (InputError, RunError) as error:
            return [Finding(f"dry run at {step_V:.3g} V", FAILED, str(error))]
        end = _end(f"dry run at {step_V:.3g} V", bench, result)
        if end.state == FAILED:
            return [end]
        answer = _answer(result.log)
        if answer is not None and abs(answer[0]) > SEEN * max(answer[1], noise_um / 10.0):
            return [end, *_response(bench, answer, step_V), *_read_back(bench, result.log, step_V)]
        if 2.0 * step_V > LARGEST_SHARE * highest_V:
            advice = "check the wires to the actuator, that the sensor looks at the moving part, and its scale"
            sentence = f"the reading does not answer {step_V:.3g} V: nothing beyond its noise of {noise_um:.3g} µm"
            return [end, Finding("answer to the command", FAILED, sentence, advice)]
        step_V, number = 2.0 * step_V, number + 1


def _run(bench: BenchFile, voltages: Voltages, out: Path, fmu: Fmu) -> RunResult:
    """Make a run, and what a run leaves."""
    result = run(bench, OpenLoop(voltages), out, fmu=fmu)
    ended = result.ended
    write_results(out, result.log, result.record, EndOfRun(ended.code, ended.sentence, ended.alarm, result.signal))
    if result.interrupted:
        raise KeyboardInterrupt
    return result


def _source(log: RunLog) -> list[Finding]:
    opened, armed = log.guard_entry("opened") or {}, log.guard_entry("armed") or {}
    name = " ".join(str(opened.get(part) or "") for part in ("manufacturer", "model", "serial", "firmware"))
    is_emulated = ", emulated" if opened.get("emulated") else ""
    turn_ms = 1e3 * float(opened.get("turn_s") or math.nan)
    answers = f"{' '.join(name.split())}{is_emulated}; a command and a look take {turn_ms:.1f} ms"
    found = [Finding("source", FINE, answers)]
    found += [Finding("source: what it cannot do", REMARK, str(remark)) for remark in armed.get("remarks", ())]
    return found


def _sensor(bench: BenchFile, log: RunLog) -> list[Finding]:
    told = log.start.get("sensor")
    identity = {} if told is None else told.get("identity") or {}
    name = "camera" if told is None else f"{told['kind']}: {' '.join(str(part) for part in identity.values() if part)}"
    if len(log.ticks) < 3:
        return [Finding("sensor", FAILED, f"{name}; {len(log.ticks)} readings in {REST_S:g} s")]
    rate_Hz = 1.0 / statistics.median(float(tick["dt_s"]) for tick in log.ticks[1:])
    is_right = abs(rate_Hz / bench.rate_Hz - 1.0) <= _RATE_PART
    tips = [float(tick["measured_um"]) for tick in log.ticks if tick["measured_um"] is not None]
    lost, skipped = len(log.ticks) - len(tips), sum(int(tick["skipped"]) for tick in log.ticks[1:])
    found = [
        Finding(
            "sensor",
            FINE if is_right else REMARK,
            f"{name}; {rate_Hz:.4g} readings per second",
            "" if is_right else f"the bench file says {bench.rate_Hz:g}; correct it, or find out what slows it down",
        ),
        Finding(
            "sensor: noise at rest",
            FINE if not lost else REMARK,
            f"{noise_of(log):.3g} µm; drift {tips[-1] - tips[0]:+.3g} µm; {lost} lost, {skipped} passed over",
            "" if not lost else "look at why readings are lost before you raise the voltage",
        ),
    ]
    if bench.delay_s is None and bench.emulator is None:
        advice = "measure the delay of the camera and enter it, or records show it as a delay of the actuator"
        found.append(Finding("sensor: delay", REMARK, "camera.delay_s is not given", advice))
    for remark in () if told is None else told.get("cannot", ()):
        found.append(Finding("sensor: what it cannot do", REMARK, str(remark)))
    return found


def noise_of(log: RunLog) -> float:
    """Return the standard deviation of the readings at rest, µm."""
    tips = [float(tick["measured_um"]) for tick in log.ticks if tick["measured_um"] is not None]
    return float(np.std(np.diff(tips)) / math.sqrt(2.0)) if len(tips) > 2 else math.nan


def _end(what: str, bench: BenchFile, result: RunResult) -> Finding:
    ended, summary = result.ended, result.summary
    if ended.status is Status.UNCONFIRMED:
        return Finding(what, FAILED, ended.alarm, "switch the source off by hand")
    if ended.code is not None:
        advice = where_to_mend(bench.source) if ended.code == FAULT else _ADVICE.get(ended.code, "")
        return Finding(what, FAILED, f"ended by a rule ({ended.code}): {ended.sentence}", advice)
    median_ms, high_ms, _ = summary.frame_to_command_ms
    off = "-" if summary.off_after_ms is None else f"{summary.off_after_ms:.0f} ms"
    words = (
        f"{summary.ticks} ticks, {summary.late} late; reading to command {median_ms:.1f} ms, p99 {high_ms:.1f} ms; "
        f"output off {off} after the end"
    )
    is_late = summary.late > 0.02 * summary.ticks
    return Finding(what, REMARK if is_late else FINE, words, "close what else runs here" if is_late else "")


def _answer(log: RunLog) -> tuple[float, float] | None:
    """How far the step moved the reading, in µm, and the standard error of that; None for too few readings."""
    before, during = [], []
    for tick in log.ticks:
        if tick["measured_um"] is None:
            continue
        time_s = float(tick["time_s"])
        if time_s < AFTER_S:
            before.append(float(tick["measured_um"]))
        elif AFTER_S + _SLOW_PART * STEP_S < time_s < AFTER_S + STEP_S:
            during.append(float(tick["measured_um"]))
    if min(len(before), len(during)) < 3:
        return None
    error_um = math.hypot(*(float(np.std(part)) / math.sqrt(len(part)) for part in (before, during)))
    return statistics.fmean(during) - statistics.fmean(before), error_um


def _response(bench: BenchFile, answer: tuple[float, float], step_V: float) -> list[Finding]:
    moved_um, error_um = answer
    slope = moved_um / step_V
    words = f"{moved_um:+.3g} ± {error_um:.2g} µm for {step_V:.3g} V, {slope:+.3g} µm/V"
    if slope < 0.0:
        advice = "turn the sign: vision.positive, the sensor's calibration, or amplifier.polarity"
        return [Finding("answer to the command", REMARK, f"{words}: the reading falls as the voltage rises", advice)]
    found = [Finding("answer to the command", FINE, words)]
    expected = bench.controller.response_um_per_V
    if expected > slope:
        advice = f"set it to about {0.5 * slope:.2g}, or runs end as unanswered"
        found.append(Finding("controller.response_um_per_V", REMARK, f"{expected:g}, more than the bench does", advice))
    reach_um = slope * bench.guard.maximum_V
    if reach_um > bench.guard.travel_um[1]:
        low_um, high_um = bench.guard.travel_um
        words = (
            f"{low_um:g} ... {high_um:g} µm; in proportion to this small step, {bench.guard.maximum_V:g} V would move "
            f"it by {reach_um:.2g} µm"
        )
        advice = "raise the voltage from run to run: few actuators move in proportion"
        found.append(Finding("guard.travel_um", REMARK, words, advice))
    return found


def _read_back(bench: BenchFile, log: RunLog, step_V: float) -> list[Finding]:
    measured = [entry for entry in log.guard if entry["kind"] == "measured" and entry["supply_voltage_V"] is not None]
    if not measured:
        advice = "the sensor's answer is the only sign that the voltage arrives"
        return [Finding("voltage read back", REMARK, "the source measures nothing", advice)]
    highest_V = max(float(entry["supply_voltage_V"]) for entry in measured)
    is_near = abs(highest_V - step_V) <= bench.guard.band_V
    return [Finding("voltage read back", FINE if is_near else REMARK, f"{highest_V:.4g} V at {step_V:.4g} V")]


def facts_of(findings: list[Finding]) -> list[dict[str, Any]]:
    """Return the findings as tables, for JSON."""
    return [{"what": x.what, "state": x.state, "found": x.found, "advice": x.advice} for x in findings]
