"""Cases drawn so that what is hidden shows: at least three times the noise, alone and beside its partner."""

import math
import zlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator, default_rng

from bender_proving.physics import sensor as sensors
from bender_proving.bench import Bench, excitation_stream, stream
from bender_proving.cases.case import Case, Kind, Start, identified
from bender_proving.chain import readings_um
from bender_proving.cases.effects import INSIDE, OUTSIDE, common_sensors, effect
from bender_proving.records.excitation import Excitation
from bender_proving.cases.hidden import NOISE_UM, Hidden, Sensor, Setting, log_uniform
from bender_proving.physics.lobatto import Array
from bender_proving.cases.residual import left_over_um
from bender_proving.cases.weak import draw_weak

LEAST, LEAST_OUTSIDE = 3.0, 5.0
FAINT = (0.8, 1.25)
MOVED = (0.05, 0.1, 0.2)
CALIBRATIONS = ("gain_error", "offset")
_ATTEMPTS = 400
_LOOPS = 8
_TRIES, _STRIDE = 24, 4.0
_WIDEST_UM = 200.0
_STEPS = "sensor_quantisation"
_STAGES = ("supply", "material", "structure", "surroundings", "sensor", "outside")
_HOW_MANY: dict[Kind, tuple[int, ...]] = {
    "single": (1,), "pair": (2,), "several": (3, 4, 5), "faint": (1,), "moved": (1,), "nothing": (0,),
    "calibration": (1, 2), "outside": (1,), "weak": (1,),
}  # fmt: skip


class DrawError(Exception):
    """No magnitude in the covered range shows enough in this record; another seed or sensor may do."""


def make_case(
    kind: Kind,
    effect_ids: Sequence[str] = (),
    seed: int = 0,
    sensor: Sensor | None = None,
    *,
    start: Start = "rest",
    closed_loop: bool = False,
    moved: float = 0.0,
) -> Case:
    """Draw the case of that kind and seed; the same arguments give the same case.

    Args:
        kind: "single", "faint" (a gap of about the noise), "moved" (away from its equation) and "outside" take one
            effect, "pair" two and "several" three to five of different stages, "calibration" `gain_error`, `offset`
            or both, "weak" the hidden one of a confusable pair, "nothing" none.
        effect_ids: ids of CONTRACT.md, for "outside" those of `bender_proving.cases.effects.OUTSIDE`.
        seed: of the excitation, of what is drawn, of the noise.
        sensor: that reads; None for the first one that excites all effects.
        start: of the first record.
        closed_loop: whether a controller plays the first record, before the camera.
        moved: rms that no form of the effect has, over the size of the effect; for the kind "moved".

    Raises:
        ValueError: an argument is not one of these; the message names it.
        DrawError: no draw leaves at least three times the noise (five outside the catalogue).
    """
    names = tuple(effect_ids)
    if seed < 0:
        raise ValueError(f"seed must be at least 0, found {seed!r}")
    _check(kind, names)
    reader = _reader(kind, names, sensor)
    if closed_loop and (reader != "camera" or start != "rest"):
        raise ValueError(f"closed_loop must start from rest before the camera, found {start!r}, {reader!r}")
    if (moved > 0.0) != (kind == "moved"):
        raise ValueError(f"moved must be above 0 for the kind 'moved' and for no other, found {moved!r} for {kind!r}")
    if closed_loop and moved > 0.0:
        raise ValueError(f"closed_loop must not be moved, which looks ahead in the record, found {moved!r}")
    ways = ((start,) if start != "rest" else ()) + (("closed loop",) if closed_loop else ())
    entropy = (zlib.crc32(" ".join((kind, reader, *sorted(names), *ways)).encode()) << 32) + seed
    rng = stream(entropy, "draw")
    if kind == "weak":
        weak, hidden = draw_weak(names[0], rng, lambda: excitation_stream(entropy))
        case = Case("", kind, (hidden,), seed, reader, weak=weak, entropy=entropy)
        return identified(case)
    clock = rng.choice(["even", "uneven", "runner"], p=[0.5, 0.25, 0.25])
    gain, offset_um = _calibration(kind, names, rng)
    blank = Case(
        "", kind, (), seed, reader, gain=gain, offset_um=offset_um,
        uneven=bool(clock == "uneven" and not closed_loop), runner_delay=bool(clock == "runner" and not closed_loop),
        start=start, closed_loop=closed_loop, entropy=entropy,
    )  # fmt: skip
    if kind in ("nothing", "calibration"):
        return identified(blank)
    plan = Bench(blank).excitation()
    if kind == "faint":
        return identified(replace(blank, effects=(_faint(names[0], plan, reader, rng),)))
    for _ in range(_LOOPS):
        drawn = draw_hidden(names, plan, reader, rng, LEAST_OUTSIDE if kind == "outside" else LEAST)
        case = identified(replace(blank, effects=drawn, moved=moved))
        # the loop goes another way where something is hidden
        if not closed_loop or strength(case) >= LEAST:
            return case
    raise DrawError(f"{' and '.join(names)}: nothing drawn shows in a closed loop")


def strength(case: Case) -> float:
    """What the case hides over its noise: rms left of its clean first record by the nominal bench, recalibrated.

    0 where its spring gave way: there is no such record.
    """
    bench = Bench(case)
    plan = bench.excitation()
    model, clean = readings_um(plan.commands)[plan.recorded], bench.clean(plan)
    return left_over_um(clean, model) / (case.gain * NOISE_UM[case.sensor]) if _possible(clean) else 0.0


def _check(kind: Kind, names: tuple[str, ...]) -> None:
    if kind not in _HOW_MANY:
        raise ValueError(f"kind must be one of {', '.join(_HOW_MANY)}, found {kind!r}")
    if len(names) not in _HOW_MANY[kind] or len(set(names)) != len(names):
        counts = " or ".join(map(str, _HOW_MANY[kind]))
        raise ValueError(f"effect_ids of kind {kind} must be {counts} different names, found {names!r}")
    allowed = CALIBRATIONS if kind == "calibration" else tuple(OUTSIDE if kind == "outside" else INSIDE)
    for name in names:
        if name not in allowed:
            raise ValueError(f"effect_ids of kind {kind} must be among {', '.join(allowed)}, found {name!r}")
    if kind in ("pair", "several") and len({effect(name).stage for name in names}) < len(names):
        raise ValueError(f"effect_ids of a {kind} must be of different stages, found {names!r}")


def _reader(kind: Kind, names: tuple[str, ...], sensor: Sensor | None) -> Sensor:
    possible: tuple[Sensor, ...] = ("camera", "vibrometer")
    if kind == "weak":
        possible = ("camera",)
    elif kind != "calibration":
        possible = common_sensors(names)
    if sensor is None and possible:
        return possible[0]
    if sensor is None or sensor not in possible:
        raise ValueError(f"sensor must excite {', '.join(names)}: {' or '.join(possible) or 'none'}, found {sensor!r}")
    return sensor


def _calibration(kind: Kind, names: tuple[str, ...], rng: Generator) -> tuple[float, float]:
    """A wrong gain and offset where they are the case, slight ones in a third of the cases that hide something."""
    if kind == "calibration":
        gain = math.exp(rng.choice([-1.0, 1.0]) * math.log(log_uniform(rng, 1.05, 100.0)))
        offset_um = gain * rng.choice([-1.0, 1.0]) * log_uniform(rng, 0.5, 200.0)
        return (gain if "gain_error" in names else 1.0, offset_um if "offset" in names else 0.0)
    if kind == "nothing" or "sensor_quantisation" in names or rng.random() > 1.0 / 3.0:
        return 1.0, 0.0
    return float(rng.uniform(0.85, 1.15)), float(rng.uniform(-3.0, 3.0))


def draw_hidden(
    names: tuple[str, ...], plan: Excitation, sensor: Sensor, rng: Generator, least: float
) -> tuple[Hidden, ...]:
    """Draw effects so that each shows under an excitation, alone and beside the others, by so many times the noise.

    Raises:
        DrawError: nothing drawn does.
    """
    order = sorted(names, key=lambda name: _STAGES.index(effect(name).stage))
    floor_um = least * NOISE_UM[sensor]
    model = _reading(plan, ())
    for _ in range(_ATTEMPTS):
        drawn = tuple(item for name in order if (item := _one(name, plan.setting, rng)) is not None)
        if len(drawn) == len(order) and _shows(drawn, plan, model, floor_um):
            return drawn
    raise DrawError(f"{' and '.join(names)}: nothing drawn leaves {least:g} times the noise of the {sensor}")


def _one(name: str, setting: Setting, rng: Generator) -> Hidden | None:
    entry = effect(name)
    size = log_uniform(rng, *entry.ranges[setting.sensor])
    sign = -1.0 if entry.signed and rng.random() < 0.5 else 1.0
    form = str(rng.choice(entry.forms))
    try:
        return entry.hide(form, sign * size, setting, rng)
    except ValueError:
        return None


def _shows(drawn: tuple[Hidden, ...], plan: Excitation, model: Array, floor_um: float) -> bool:
    """Whether every effect shows against the bench without it, alone and with the others."""
    alone = [_reading(plan, (item,)) for item in drawn]
    if not all(_possible(reading) and left_over_um(reading, model) >= floor_um for reading in alone):
        return False
    return len(drawn) == 1 or all(_shows_beside(item, drawn, plan, floor_um) for item in drawn)


def _shows_beside(item: Hidden, drawn: tuple[Hidden, ...], plan: Excitation, floor_um: float) -> bool:
    """Whether an effect leaves something that gain, offset and other sizes of the others do not take up.

    A spring that is stiffer is a gain where its ringing does not pass the sensor, and beside a drift a gain and another
    drift. Steps of the sensor are noise to all others.
    """
    if item.id == _STEPS:
        return True
    smooth = tuple(x for x in drawn if x.id != _STEPS)
    steps_um = [x["step_um"] for x in drawn if x.id == _STEPS]
    floor_um = math.hypot(floor_um, LEAST * math.hypot(*steps_um) / math.sqrt(12.0)) if steps_um else floor_um
    together = _reading(plan, smooth)
    others = tuple(x for x in smooth if x is not item)
    without = _reading(plan, others)
    # two that keep each other in check may run away when one of them is left out
    if not (_possible(together) and _possible(without)):
        return False
    smaller = [_reading(plan, tuple(y for y in others if y is not x)) for x in others]
    return left_over_um(together, without, *(x for x in smaller if _possible(x))) >= floor_um


def _faint(name: str, plan: Excitation, sensor: Sensor, rng: Generator) -> Hidden:
    """One effect that leaves about as much as the noise: its size is sought, all else of it stays as drawn."""
    entry, model = effect(name), _reading(plan, ())
    smallest, largest = entry.ranges[sensor]
    for _ in range(_LOOPS):
        form, sign = str(rng.choice(entry.forms)), -1.0 if entry.signed and rng.random() < 0.5 else 1.0
        number = int(rng.integers(2**32))

        def left(size: float) -> tuple[float, Hidden | None]:
            try:
                item = entry.hide(form, sign * size, plan.setting, default_rng(number))  # noqa: B023
            except ValueError:
                return math.nan, None
            reading = _reading(plan, (item,))
            return (left_over_um(reading, model) / NOISE_UM[sensor] if _possible(reading) else math.nan), item

        size = smallest if left(smallest)[0] < left(largest)[0] or math.isnan(left(largest)[0]) else largest
        down = 1.0 / _STRIDE if size == smallest else _STRIDE
        ends: list[float | None] = [None, None]
        if entry.none_at is not None:
            # the bench has some of it: what is hidden is more or less than that
            ends[:] = entry.none_at, size
            size = math.sqrt(entry.none_at * size)
        for _ in range(_TRIES):
            found, item = left(size)
            if item is not None and FAINT[0] <= found <= FAINT[1]:
                return item
            # a size beyond what is possible leaves too much
            ends[int(not found < 1.0)] = size
            quiet, loud = ends
            if quiet is not None and loud is not None:
                size = math.sqrt(quiet * loud)
            else:
                size *= down if quiet is None else 1.0 / down
    raise DrawError(f"{name}: no size leaves about the noise of the {sensor}")


def _reading(plan: Excitation, hidden: tuple[Hidden, ...]) -> Array:
    reading = readings_um(plan.commands, hidden)[plan.recorded]
    for item in hidden:
        reading = sensors.round_rows(item, reading)
    return reading


def _possible(reading_um: Array) -> bool:
    return bool(np.all(np.abs(reading_um) < _WIDEST_UM))
