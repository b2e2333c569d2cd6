"""What a person should know beside the verdict: unusual values, readings set aside, what the records cannot show."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_discrepancy.conclusion.contenders import alternatives
from bender_discrepancy.conclusion.findings import SIGNIFICANT, Findings, ReportedEffect
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.conclusion.sentences import number_title, residual, share_of_stroke, title_of
from bender_effects.catalogue import EFFECTS, READ_OFF
from bender_inference.fitting.own_numbers import DELAY, first_mode_Hz
from bender_inference.records.excitation import changes_V, describe
from bender_inference.records.spectrum import are_even
from bender_inference.search.judgement.rules import RULES
from bender_inference.search.moves import aliases_Hz
from bender_inference.search.result import SearchResult
from bender_loop.records.end_of_range import ends_of_range
from bender_loop.records.record import Record
from bender_report.number import Number
from bender_report.wording import WHOSE_DELAY, fields, figure, input_word, listed, percent, quantity, with_interval

ALIASES_TOLD = 3
UNWRITTEN = "no corrected model was written"
FOLLOWING = ("supply", "material", "structure")
"""Stages of effects that move with the voltage: where one is named, the readings follow it, whatever the gain."""
# times the residual of the rows that were searched
ELSEWHERE = 1.2
# of rows set aside that are listed one by one
MOST_LISTED = 50
# so few changes of the voltage are said
FEW_CHANGES = 2
# of the file in which row 0 stands
FIRST_LINE = 2


@dataclass(frozen=True, slots=True)
class SetAside:
    """Readings of one record that did not count: rows are those of the record, the first is 0."""

    rows: int
    lost: int
    outlying: tuple[int, ...]


def row_of_file(record: Record, row: int) -> int:
    """Return a row of a record as its file counts it: rows that the file lacks have been put in."""
    return row if record.made_up is None else max(row - int(np.count_nonzero(record.made_up[: row + 1])), 0)


def set_aside(search: SearchResult) -> list[SetAside]:
    """Return for every record which readings did not count."""
    found = []
    guesses = [x.after_a_guess for x in search.excerpts] or [0] * len(search.whole)
    for record, x, first in zip(search.records, search.whole, guesses, strict=True):
        made_up = np.zeros(len(record), dtype=np.bool_) if record.made_up is None else record.made_up
        lost = int(np.count_nonzero(~np.isfinite(record.displacement_um[~made_up])))
        lost -= record.repeats + record.behind_pauses
        seen = np.isfinite(x.measured_um)
        outlying = first + np.flatnonzero((seen & ~x.usable)[first:])
        rows = tuple(row_of_file(record, int(row)) for row in outlying)
        found.append(SetAside(len(record) - int(made_up.sum()), lost, rows))
    return found


def warnings(findings: Findings) -> list[str]:
    """Return the warnings, the weightiest first."""
    found = _another_device(findings)
    found += _alternatives(findings)
    found += _at_the_end(findings)
    found += [x for effect in findings.effects for x in _unusual(effect)]
    found += [x for effect in findings.added for x in _undetermined(effect)]
    found += _delayed(findings)
    found += _aliased(findings)
    found += _numbered(findings.search)
    found += _of_one_record(findings)
    found += _not_following(findings)
    found += _missing(findings.search)
    found += _left_out_beforehand(findings.search)
    found += _zero_moved(findings.search)
    found += _zeros_apart(findings)
    found += _at_the_end_of_the_range(findings.search)
    found += _hardly_excited(findings.search)
    found += _left_out(findings)
    found += findings.search.witnesses
    found += _untried(findings.search)
    found += _immaterial(findings.search)
    found += _stopped(findings.search)
    found += _searched_in_part(findings.search)
    found += _between_rows(findings.search)
    found += _begun(findings.search)
    found += _beyond_its_range(findings.search)
    found += _counted(findings.search)
    return found


def _beyond_its_range(search: SearchResult) -> list[str]:
    valid = search.base.valid
    if valid is None:
        return []
    said = valid.left_by(
        np.concatenate([x.voltage_V for x in search.records]).tolist(), search.records[0].quantities[0]
    )
    return [said] if said else []


def _numbered(search: SearchResult) -> list[str]:
    """Say of records whose times are the numbers of their rows that these may be no seconds."""
    if search.settings.untimed:
        return []
    return [
        f"{_name(search, k)}the times are the numbers of the rows; if they only give the order, use --untimed "
        "(untimed=True in Python): delays, lags and creep are then not looked for"
        for k, x in enumerate(search.records)
        if len(x) > 1 and np.array_equal(x.time_s - x.time_s[0], np.arange(len(x)))
    ]


def _at_the_end(findings: Findings) -> list[str]:
    """Say which of the model's own numbers came to the end of what they may be."""
    return [
        f"{number_title(x.name)} is at the end of its range, {quantity(x.after, x.unit)}: what fits best may lie "
        "beyond; the model may be of another device, or lack what this number stands in for"
        for x in findings.changed
        if x.at_end
    ]


def _zeros_apart(findings: Findings) -> list[str]:
    """Say that records have offsets of their own, in which an effect of their amplitudes may hide."""
    offsets = findings.calibration.offsets_um
    apart_um = max(offsets) - min(offsets)
    if findings.search.settings.same_zero or apart_um <= findings.search.archive.noise_um:
        return []
    unit = findings.search.records[0].quantities.reading
    return [
        f"the records have offsets of their own, up to {quantity(apart_um, unit)} apart; if the sensor was not zeroed "
        "between them, use --same-zero (same_zero=True in Python): a missing effect may hide in them"
    ]


def _at_the_end_of_the_range(search: SearchResult) -> list[str]:
    """Say of readings that stand at one value, without their noise, that they tell nothing of what lies beyond it."""
    return [
        f"{_name(search, k)}{end.rows} readings stand at {quantity(end.value, x.quantities.reading)}, the "
        f"{'highest' if end.side == 'above' else 'lowest'} of all, without the noise of the others: the sensor, or "
        "what it reads, is at the end of its range there, and tells nothing of what lies beyond"
        for k, x in enumerate(search.records)
        for end in ends_of_range(x)
    ]


def _alternatives(findings: Findings) -> list[str]:
    known = alternatives(findings.search, findings.verdict)
    if not known:
        return []
    told = [f"{listed([title_of(y) for y in x.effects])} ({percent(x.closes)})" for x in known]
    closing = "with the part of the gap that each closes in the readings that chose it"
    if findings.verdict == "recalibrated":
        return [f"these effects, with the given parameters unchanged, fit as well, {closing}: {'; '.join(told)}"]
    return [f"the best attempts, none of them certain, {closing}: {'; '.join(told)}"]


def _unusual(effect: ReportedEffect) -> list[str]:
    about = EFFECTS[effect.id]
    known = fields(effect.numbers)
    strange = {field: [x for x in numbers if x.unusual] for field, numbers in known.items()}
    found = [
        f"{title_of(effect.id)}: {_values(field, some, len(known[field]))} unusual, {_typical(some[0])}"
        for field, some in strange.items()
        if some
    ]
    if found and about.unusual:
        found[0] += f"; {about.unusual}"
    return found


def _values(field: str, unusual: list[Number], count: int) -> str:
    if len(unusual) == 1:
        return f"{unusual[0].name} = {quantity(unusual[0].value, unusual[0].unit)} is"
    ends = sorted(x.value for x in unusual)
    span = f"{figure(ends[0])} to {quantity(ends[-1], unusual[0].unit)}"
    return f"{field}: {len(unusual)} of {count} values, {span}, are"


def _typical(number: Number) -> str:
    low, high = number.typical or (0.0, 0.0)
    ends = f"{figure(low)} to {quantity(high, number.unit)}"
    return f"typical sizes are {ends} ({number.why})" if number.why else f"typical sizes are {ends}"


def _undetermined(effect: ReportedEffect) -> list[str]:
    names = [field for field, known in fields(effect.numbers).items() if all(x.is_open for x in known)]
    if not names:
        return []
    open_ = ", ".join(names)
    return [
        f"{title_of(effect.id)}: these records determine the response, not each of these numbers: {open_}. A "
        "model with it is good for commands like the recorded ones, and a guess for levels, rates or holds that the "
        "records do not have"
    ]


def _delayed(findings: Findings) -> list[str]:
    """Say of a delay, missing or the model's own, that it may be that of the sensor."""
    base = findings.search.base
    learned = () if base.origin is None else tuple(x.id for x in base.blocks)
    own = tuple(x.name.partition(".")[0] for x in findings.recalibrated)
    if DELAY not in (*learned, *own, *(x.id for x in findings.effects)):
        return []
    return [f"{title_of(DELAY)}: {WHOSE_DELAY}"]


def _left_out(findings: Findings) -> list[str]:
    coarse = findings.lattice
    if coarse is None or coarse.is_named:
        return []
    return [
        f"the readings are multiples of {quantity(coarse.step_um, 'um')}; this rounding counts as noise and is not in "
        "the model, because most of the residual has another cause"
    ]


def _of_one_record(findings: Findings) -> list[str]:
    own = [x for x in findings.added if x.by_record]
    if not own:
        return []
    told = [
        f"{title_of(x.id)}, record {k + 1}: "
        + ", ".join(f"{n.name} {with_interval(n)}" for n in numbers if n.std > 0.0)
        for x in own
        for k, numbers in enumerate(x.by_record)
        if k != findings.of_record
    ]
    return [
        f"model.toml and model.fmu describe record {findings.of_record + 1}, with its surroundings and its offset; "
        f"the gap uses those of each record ({'; '.join(told)})"
    ]


def _another_device(findings: Findings) -> list[str]:
    if not findings.is_another_device:
        return []
    times = findings.gain_ratio
    found = (
        "the readings fall where the model rises: another device, swapped wires or a turned axis of the sensor; a "
        "controller tuned on this model would be unstable"
        if times < 0.0
        else f"the gain is {figure(times)} times that of the model: this looks like another device, or other units"
    )
    return [f"{found}; give its own model by --model, make one by `bender model fit`, or say --units; {UNWRITTEN}"]


def _not_following(findings: Findings) -> list[str]:
    gain = next((x for x in findings.recalibrated if x.name == "gain"), None)
    if gain is None or abs(gain.after) > SIGNIFICANT * gain.std:
        return []
    if any(EFFECTS[x.id].stage in FOLLOWING for x in findings.added):
        return []
    return [f"the readings do not follow the {input_word()}: they look like noise alone; is the device connected?"]


def _hardly_excited(search: SearchResult) -> list[str]:
    counts = [changes_V(record.voltage_V).size for record in search.records]
    if max(counts) > FEW_CHANGES:
        return []
    times = {1: "once", 2: "twice"}.get(max(counts), "hardly")
    return [
        f"the {input_word()} changes only {times} (with the jump from 0 V before the first row). That cannot show "
        "hysteresis, saturation, a dead zone, a limit of the rate or a curve of the reading; record a staircase up and "
        "down with holds of several lengths"
    ]


def _missing(search: SearchResult) -> list[str]:
    counts = [(k, 0 if x.made_up is None else int(x.made_up.sum())) for k, x in enumerate(search.records)]
    return [
        f"{_name(search, k)}{count} row{'s are' if count > 1 else ' is'} missing; the {input_word()} there is taken "
        "from those around"
        for k, count in counts
        if count
    ]


def _left_out_beforehand(search: SearchResult) -> list[str]:
    repeated = ": repeats of the one before to the last digit: the sensor is slower than the rows; left out"
    blind = f" behind a pause, left out: nobody knows which {input_word()} there was in it"
    counts = [
        (k, n, told)
        for k, x in enumerate(search.records)
        for n, told in ((x.repeats, repeated), (x.behind_pauses, blind))
    ]
    return [f"{_name(search, k)}{n} {'reading' if n == 1 else 'readings'}{told}" for k, n, told in counts if n]


def _zero_moved(search: SearchResult) -> list[str]:
    moved = [(k, x.zero_move) for k, x in enumerate(search.records) if x.zero_move is not None]
    return [
        f"{_name(search, k)}from line {x.row + FIRST_LINE} on the sensor reads {quantity(x.height_um, 'um')} more, "
        "at every command: its zero has moved; the readings from there on are corrected by it"
        for k, x in moved
    ]


def _immaterial(search: SearchResult) -> list[str]:
    if not search.immaterial:
        return []
    names = " and ".join(title_of(x) for x in search.immaterial)
    return [f"left out: {names}; it changes the readings by less than {share_of_stroke(search.settings)}"]


def _untried(search: SearchResult) -> list[str]:
    if not search.untried:
        return []
    names = ", ".join(title_of(x) for x in search.untried)
    return [f"not tried, because this record is too long: {names}; diagnose a shorter part of it"]


def _stopped(search: SearchResult) -> list[str]:
    if not search.found.stopped:
        return []
    return [
        "the search stopped early, because one more effect would take too long; diagnose a shorter part of the "
        "records, or diagnose again with the corrected model (model.toml of this result)"
    ]


def beginning(start: str, rest_before_V: float | None) -> str:
    """Return how a record is taken to begin, from `start` and `start_input` of `diagnosis.json`."""
    if rest_before_V is not None:
        return f"begins after resting at {quantity(rest_before_V, 'V')}"
    return f"begins {'in motion' if start == 'motion' else 'at rest'}"


def _aliased(findings: Findings) -> list[str]:
    """Return which other frequencies look like that of a disturbance, where all rows are even at one rate."""
    observations = findings.search.problem.observations
    rates_Hz = {round(1.0 / float(np.median(np.diff(x.time_s))), 6) for x in observations}
    if findings.search.settings.untimed or len(rates_Hz) > 1 or not all(are_even(x.time_s) for x in observations):
        return []
    (rate_Hz,) = rates_Hz
    found = _mode_aliased(findings, rate_Hz)
    heard = [x for x in findings.added if EFFECTS[x.id].of_the_record]
    for effect, own_Hz in ((x, y.value) for x in heard for y in x.numbers if y.name == "frequency_Hz"):
        others = aliases_Hz(own_Hz, rate_Hz, own_Hz + ALIASES_TOLD * rate_Hz)
        told = f"{_nearest(others, own_Hz)}, …"
        found.append(_looks_like(title_of(effect.id), rate_Hz, own_Hz, told))
    return found


def _mode_aliased(findings: Findings, rate_Hz: float) -> list[str]:
    """Return which other frequencies, as far as the model's own may move, look like the recalibrated first mode."""
    own, base = findings.search.best.hypothesis.own, findings.search.problem.base
    first_Hz = first_mode_Hz(base)
    if own is None or first_Hz is None:
        return []
    told = {x.name for x in findings.recalibrated}
    found = []
    for free, value in zip(own.form.free, own.values, strict=True):
        if free.rings != "factor" or free.name not in told:
            continue
        unit_Hz = first_Hz / free.starts[0]
        others = [x for x in aliases_Hz(unit_Hz * value, rate_Hz, unit_Hz * free.high) if x > unit_Hz * free.low]
        if others:
            found.append(_looks_like(free.name, rate_Hz, unit_Hz * value, _nearest(others, unit_Hz * value)))
    return found


def _nearest(others_Hz: Sequence[float], own_Hz: float) -> str:
    nearest = sorted(others_Hz, key=lambda x: abs(x - own_Hz))[:ALIASES_TOLD]
    return ", ".join(figure(x, 5) for x in sorted(nearest))


def _looks_like(name: str, rate_Hz: float, own_Hz: float, others: str) -> str:
    return (
        f"{number_title(name)}: at {figure(rate_Hz, 4)} rows a second, {figure(own_Hz, 5)} Hz looks like {others} Hz; "
        "a record of another rate distinguishes them"
    )


def _between_rows(search: SearchResult) -> list[str]:
    """Return which course between the rows was taken, where nobody said it and it is not held."""
    if not search.settings.decide_hold or search.settings.input_hold == "hold":
        return []
    course = {"linear": "running straight from row to row", "smooth": "band-limited between the rows"}
    taken = course[search.settings.input_hold]
    return [f"the command is treated as {taken}, which fits far better than a held one (--input-hold sets this)"]


def _begun(search: SearchResult) -> list[str]:
    """Return how the records that do not begin at rest are taken to have begun."""
    found = []
    for k, (record, x) in enumerate(zip(search.records, search.whole, strict=True)):
        if x.start == "rest":
            continue
        told = "the command before its first row is unknown and was assumed"
        if x.rest_before_V is not None:
            told = f"the plant is assumed to have rested at {quantity(x.rest_before_V, 'V')} before its first row"
        heard = np.flatnonzero(np.isfinite(x.measured_um))
        first = int(np.argmax(np.isfinite(record.displacement_um)))
        if heard.size and heard[0] > first:
            rings_s = float(x.time_s[heard[0]] - x.time_s[0])
            told += f"; the first {quantity(rings_s, 's')} are left out, because an earlier motion may still ring there"
        found.append(f"{_name(search, k)}the record begins in motion: {told}")
    return found


def _searched_in_part(search: SearchResult) -> list[str]:
    return [
        f"{_name(search, k)}the search used {x.rows.size} of {x.whole.measured_um.size} rows, spread over lines "
        f"{row_of_file(record, x.rows[0]) + FIRST_LINE} to {row_of_file(record, x.rows[-1]) + FIRST_LINE}; "
        "the gap is measured over all rows" + _but_for(x.after_a_guess)
        for k, (x, record) in enumerate(zip(search.excerpts, search.records, strict=False))
        if not x.is_all
    ]


def _but_for(rows: int) -> str:
    return f" except the first {rows}, because the command before the record is unknown" if rows else ""


def elsewhere(search: SearchResult, measured: Measured) -> list[str]:
    """Return a warning where the corrected model does worse over whole records than in the rows that were searched."""
    if not search.excerpts:
        return []
    rows = zip(search.problem.observations, measured.after_um, strict=True)
    left = np.concatenate([(x.measured_um - y)[x.reporting] for x, y in rows])
    there = float(np.sqrt(np.mean(left**2)))
    if measured.after.rms_um < ELSEWHERE * max(there, measured.floor_um):
        return []
    return [
        f"the residual is {quantity(measured.after.rms_um, 'um')} over the whole record, but "
        f"{quantity(there, 'um')} in the rows of the search: the model still lacks something slow, or "
        "something that happens in other rows; diagnose a part of the record where the gap is large"
    ]


def not_written(findings: Findings, measured: Measured) -> list[str]:
    """Return a warning where the corrected model was not written: it is worse, or not shown to be better."""
    if measured.is_worse:
        others = [("calibration alone", measured.recalibrated.rms_um), ("the model as given", measured.before.rms_um)]
        better, left_um = min(others, key=lambda x: x[1])
        return [
            f"no model was written: on held-out readings it would leave {quantity(measured.after.rms_um, 'um')}, "
            f"{better} {quantity(left_um, 'um')}"
        ]
    if findings.is_corrected and measured.is_unproved:
        return [
            "no model was written: held-out readings do not show that it would be better; the interval of what it "
            "closes of the gap there holds 0"
        ]
    return []


def more_than_noise(findings: Findings, measured: Measured) -> list[str]:
    """Return a note where an effect is named and more than noise is left beside it."""
    left, floor = measured.after.rms_um, measured.floor_um
    only_steps = bool(findings.added) and all(x.id == READ_OFF for x in findings.added)
    if findings.verdict != "named" or only_steps or left**2 <= (1.0 + RULES.at_noise) * floor**2:
        return []
    beside = " beside what belongs to the record" if findings.explains_more else ""
    return [f"the corrected model is close, but not exact: it leaves {residual(measured)}{beside}"]


def _name(search: SearchResult, record: int) -> str:
    return f"record {record + 1}: " if len(search.records) > 1 else ""


def _counted(search: SearchResult) -> list[str]:
    found = []
    for k, x in enumerate(set_aside(search)):
        name = _name(search, k)
        if x.lost:
            found.append(f"{name}{x.lost} of {x.rows} frames are lost and left out")
        if x.outlying:
            listed = ", ".join(str(row + FIRST_LINE) for row in x.outlying[:8]) + (", …" if len(x.outlying) > 8 else "")
            what = (
                "outlying reading was set aside, line"
                if len(x.outlying) == 1
                else "outlying readings were set aside, lines"
            )
            found.append(f"{name}{len(x.outlying)} {what} {listed}")
    return found


def excitation_of(search: SearchResult) -> list[str]:
    """Return what every record was driven with, in words."""
    return [describe(x.time_s, x.command_V, untimed=search.settings.untimed) for x in search.whole]
