"""A first model as numbers for a program and as rows of tables."""

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from bender_identify.first_model.choice import FirstModel
from bender_identify.first_model.loop_rival import HYSTERESIS, LoopRival
from bender_identify.first_model.rivals import Rival
from bender_loop.tables.quantities import MICROMETRE, USUAL, Quantities
from bender_plant.model import Model
from bender_plant.origin import Origin
from bender_plant.valid_range import ValidRange
from bender_report.wording import WHOSE_DELAY, shown_in, unit_name, unit_text

FIRST_LINE = 2
"""Of the file in which row 0 stands."""
COURSES = {"linear": "straight", "smooth": "band-limited"}
SURE = 4.0
"""Standard deviations beyond which a correlation is no chance."""
HALF_WIDTH = 1.96
"""Standard deviations on either side of a 95 % interval."""
FOLLOWS = 0.5
"""Share of the variance of readings on held-out rows below which a structure does not follow a record."""
MOST_LISTED = 8


def columns(quantities: Quantities = USUAL) -> tuple[str, ...]:
    """Return the heads of the table of structures."""
    unit = unit_text(quantities.reading)
    return ("structure", "numbers", f"rms ({unit})", f"rms of unseen blocks ({unit})")


def numbers(found: FirstModel, quantities: Quantities = USUAL) -> list[dict[str, Any]]:
    """Return every number of the model: name, value, unit, and the 95 % interval (None where unknown)."""
    fit = found.chosen
    names, values = (*fit.structure.names, "gain"), (*fit.values, fit.gain)
    told = []
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        std = fit.std[k] if k < len(fit.std) else math.inf
        known = math.isfinite(std)
        interval = [value - HALF_WIDTH * std, value + HALF_WIDTH * std] if known else None
        unit = unit_of(name, quantities)
        told.append({"name": name, "value": value, "unit": unit, "std": std if known else None, "interval": interval})
    return told


def unit_of(name: str, quantities: Quantities = USUAL) -> str:
    """Return the unit of a number, "1" where it has none."""
    if name == "gain":
        with shown_in(quantities.command, quantities.reading):
            return unit_name("um/V")
    end = name.rpartition("_")[2]
    return end if end in ("s", "Hz") else "1"


def facts(found: FirstModel, quantities: Quantities = USUAL) -> dict[str, Any]:
    """Return the first model as JSON has it; what ends in `_um` is null where readings are no lengths."""
    loop = None if found.loop is None else found.loop_rms

    def both(name: str, value: Any) -> dict[str, Any]:
        return {name: value, f"{name}_um": value if quantities.reading == MICROMETRE else None}

    return {
        "structure": found.chosen.structure.name,
        "order": found.chosen.structure.order,
        "input_hold": input_hold(found),
        "unit": quantities.reading,
        "input_unit": quantities.command,
        "numbers": numbers(found, quantities),
        **both("offsets", list(found.chosen.offsets)),
        **both("rms", found.selected.rms),
        **both("held_out_rms", found.selected.held_out_rms),
        "explained_share": explained_share(found),
        **both("loop_held_out_rms", loop),
        "likelier_effect": likelier_effect(found),
        "tried": [
            {
                "structure": x.fit.structure.name,
                "order": x.fit.structure.order,
                **both("rms", x.rms),
                **both("held_out_rms", x.held_out_rms),
            }
            for x in found.scores
        ],
        "records": [
            {
                "name": x.name,
                "in_motion": x.in_motion,
                "zero_move": None if x.zero_move is None else asdict(x.zero_move),
                "set_aside_s": list(x.misread_s),
                "behind_pauses": x.behind_pauses,
            }
            for x in found.task.experiments
        ],
    }


def input_hold(found: FirstModel) -> str:
    """Return what the input does between the rows, as told or as the records say."""
    return found.task.experiments[0].input_hold


def learned_model(found: FirstModel, name: str, quantities: Quantities = USUAL) -> Model:
    """Return the model with the range of its records, their names and units, and its numbers with intervals."""
    records = found.task.experiments
    acting_V = np.concatenate([x.acting_V for x in records])
    longest_s = max(float(np.ptp(x.time_s)) for x in records)
    valid = ValidRange(float(acting_V.min()), float(acting_V.max()), longest_s)
    spoken = tuple(" ".join(x.split()) for x in sentences(found, quantities)[1:])
    origin = Origin(tuple(x.name for x in records), spoken, quantities.command, quantities.reading)
    return replace(found.model(name), valid=valid, origin=origin)


def likelier_effect(found: FirstModel) -> dict[str, Any] | None:
    """Return the nonlinear effect that is likelier than a further order, None where none is."""
    if found.loop is not None:
        return {"id": HYSTERESIS, "beside": found.loop.structure.name, "held_out_rms": found.loop_rms}
    if found.rival is None:
        return None
    rival = found.rival
    return {"id": rival.effect, "beside": rival.structure.name, "held_out_rms": found.rival_rms}


def table(found: FirstModel) -> list[list[Any]]:
    """Return a row for every structure that was tried; the chosen one has a star."""
    return [
        [
            x.fit.structure.name + (" *" if x is found.selected else ""),
            len(x.fit.structure.names) + 1,
            x.rms,
            x.held_out_rms,
        ]
        for x in found.scores
    ]


def rms_sentence(found: FirstModel) -> str:
    """Return of which rows the rms of the table and of the written model are."""
    told = "rms: of all rows, by a fit to a part of them; of unseen blocks: of the same rows, by fits without them"
    written = written_rms(found)
    if math.isnan(written):
        return told
    rows = sum(int(np.sum(x.fitted | x.held_out)) for x in found.task.experiments)
    every = sum(x.time_s.size for x in found.task.experiments)
    return f"{told}. What is written is fitted to {rows} of {every} rows and leaves {written:.4g} on them"


def written_rms(found: FirstModel) -> float:
    """Return what the written model leaves on the rows that it was fitted to; NaN where that was an excerpt."""
    rows = [x.fitted | x.held_out for x in found.task.experiments]
    if any(x.size != r.size for x, r in zip(rows, found.chosen.residuals, strict=True)):
        return math.nan
    return math.sqrt(found.chosen.square(rows) / max(sum(int(x.sum()) for x in rows), 1))


def choice_sentence(found: FirstModel) -> str:
    """Return why a structure is written that does not simulate unseen blocks best; nothing where it does."""
    if found.loop is not None:
        return _loop_sentence(found, found.loop)
    if found.rival is not None:
        return _rival_sentence(found, found.rival)
    best = found.best
    if best is found.selected:
        return ""
    return (
        f"{best.fit.structure.name} simulates unseen blocks better by no more than chance can bring, or hardly better: "
        f"the simpler {found.selected.fit.structure.name} is written"
    )


def _rival_sentence(found: FirstModel, rival: Rival) -> str:
    best = found.best
    return (
        f"a nonlinear effect is likelier than a further order: `{rival.effect}` beside {rival.structure.name} "
        f"simulates unseen blocks better, {found.rival_rms:.4g} against {best.held_out_rms:.4g} of "
        f"{best.fit.structure.name}. {found.selected.fit.structure.name} is written, for a diagnosis to name what "
        f"is missing{_beside_words(found)}"
    )


def _loop_sentence(found: FirstModel, loop: LoopRival) -> str:
    best = found.best
    written = (
        f"{loop.structure.name} is written with the times that remain beside it" if loop.structure.names
        else "the gain alone is written"
    )  # fmt: skip
    return (
        f"a loop that does not depend on time (plays) simulates unseen blocks better, {found.loop_rms:.4g} "
        f"against {best.held_out_rms:.4g} of {best.fit.structure.name}: {written}, for a diagnosis to name what "
        f"makes the loop{_beside_words(found)}"
    )


def quick_sentence(found: FirstModel) -> str:
    """Return what rings too fast for the rows to resolve, in the model or in what it leaves; "" where nothing does.

    A residual of which two rows in turn have opposite signs, on the whole, swings at more than a quarter of the rate of
    the rows.
    """
    rate_Hz = min(1.0 / float(np.median(np.diff(x.time_s))) for x in found.task.experiments)
    quarter_Hz = rate_Hz / 4.0
    modes_Hz = [x["value"] for x in numbers(found) if x["unit"] == "Hz" and x["value"] > quarter_Hz]
    if modes_Hz:
        alike = ", ".join(f"{x:.4g} Hz like one of {abs(rate_Hz - x):.4g} or {rate_Hz + x:.4g} Hz" for x in modes_Hz)
        return (
            f"rows at {rate_Hz:.4g} Hz hardly resolve a mode above {quarter_Hz:.3g} Hz: they show one of {alike}; a "
            "record with more rows a second tells them apart"
        )
    turn, rows = _from_row_to_row(found)
    if turn > -SURE / math.sqrt(max(rows, 1)):
        return ""
    return (
        f"what the model leaves alternates from row to row (correlation {turn:.2f}): something swings faster than "
        f"{quarter_Hz:.3g} Hz, which rows at {rate_Hz:.4g} Hz do not resolve; record more rows a second"
    )


def _from_row_to_row(found: FirstModel) -> tuple[float, int]:
    """Return how what the model leaves correlates from one row to the next, and of how many rows that is."""
    products, squares, rows = 0.0, 0.0, 0
    for r, x in zip(found.chosen.residuals, found.task.experiments, strict=True):
        counted = x.fitted | x.held_out
        if counted.size != r.size:
            return 0.0, 0
        both = counted[1:] & counted[:-1]
        products += float(r[1:][both] @ r[:-1][both])
        squares += float(np.sum(r[counted] ** 2))
        rows += int(both.sum())
    return (products / squares if squares > 0.0 else 0.0), rows


def _beside_words(found: FirstModel) -> str:
    """Return why a structure has the star that leaves more on unseen blocks than a simpler one; else nothing."""
    own = found.selected
    if not any(x.numbers < own.numbers and x.held_out_rms <= own.held_out_rms for x in found.scores):
        return ""
    return ". It was chosen by what it leaves beside that, not by the last column, where each stands alone"


def explained_share(found: FirstModel) -> float:
    """Return which share of the variance of the readings the model explains on held-out rows; negative for none."""
    readings = [x.measured_um[x.fitted | x.held_out] for x in found.task.experiments]
    variance = float(np.mean(np.concatenate([(y - y.mean()) ** 2 for y in readings])))
    return 1.0 - found.selected.held_out_rms**2 / variance if variance > 0.0 else 1.0


def doubt_sentence(found: FirstModel) -> str:
    """Return what to say where no structure follows the records; nothing where one does."""
    share = explained_share(found)
    if share >= FOLLOWS or found.loop is not None or found.rival is not None:
        return ""
    return (
        f"no linear structure fits these records: on held-out rows {found.chosen.structure.name} explains "
        f"{max(100.0 * share, 0.0):.0f} % of the variance of the readings. Check the columns and "
        "their units, and whether the record is complete"
    )


def delay_sentence(found: FirstModel) -> str:
    """Return what is to be known of a delay in the model; nothing where it has none."""
    has_delay = any(x.id == "transport_delay" for x in found.model("first").blocks)
    return f"delay_s: {WHOSE_DELAY}" if has_delay else ""


def sentences(found: FirstModel, quantities: Quantities = USUAL) -> list[str]:
    """Return the model in words, a line for each number."""
    structure = found.chosen.structure
    found_numbers = numbers(found, quantities)
    certain = any(x["std"] is not None for x in found_numbers)
    interval = "± is an interval of 95 %" if certain else "without intervals"
    lines = [f"{structure.name.replace('+', ' + ')}, order {structure.order}; {interval}"]
    for number in found_numbers:
        unit = "" if number["unit"] == "1" else f" {unit_text(number['unit'])}"
        std = number["std"]
        width = "" if std is None else f" ± {HALF_WIDTH * std:.2g}"
        lines.append(f"  {number['name']:>18}  {number['value']:.5g}{width}{unit}")
    told = ", ".join(f"{x:.4g}" for x in found.chosen.offsets)
    lines.append(f"  {'offset':>18}  {told} {unit_text(quantities.reading)}")
    if (course := input_hold(found)) != "hold":
        lines.append(f"the input is {COURSES[course]} between the rows; other commands need `--input-hold {course}`")
    for x in found.task.experiments:
        if x.zero_move is not None:
            height = f"{x.zero_move.height_um:.4g} {unit_text(quantities.reading)}"
            lines.append(
                f"{x.name}: from line {x.zero_move.row + FIRST_LINE} on the sensor reads {height} more, whatever is "
                "commanded: its zero moved, and that was taken from the readings"
            )
        if x.behind_pauses:
            lines.append(
                f"{x.name}: {x.behind_pauses} {'reading' if x.behind_pauses == 1 else 'readings'} behind a pause left "
                "out: nobody knows what was commanded in it"
            )
        if x.misread_s:
            listed = ", ".join(f"{t:.6g}" for t in x.misread_s[:MOST_LISTED])
            more = ", …" if len(x.misread_s) > MOST_LISTED else ""
            one = len(x.misread_s) == 1
            lines.append(
                f"{x.name}: {len(x.misread_s)} {'reading' if one else 'readings'} left out at {listed}{more} s: far "
                "from their neighbours and from the best simple structure"
            )
    return lines
