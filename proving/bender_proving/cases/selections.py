"""The catalogue of cases: what a method of diagnosis is judged on."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from bender_proving.bench import stream
from bender_proving.cases.case import STARTS, Case, Given, Kind, Start, identified, spoiled
from bender_proving.cases.draw import CALIBRATIONS, MOVED, DrawError, make_case
from bender_proving.cases.effects import INSIDE, OUTSIDE, common_sensors, effect
from bender_proving.cases.hidden import SENSORS, Sensor
from bender_proving.cases.weak import TRUTHS

_STAGES = ("supply", "material", "structure", "surroundings", "sensor")
OWN = ("tip_mass", "structural_damping")
OFF_FREQUENCY, OFF_DAMPING, OFF_GAIN = 0.03, 1.5, 0.1
"""How far numbers of a model that is given may be off: a share, a factor, a share."""
LAGS = ("source_resistance", "sensor_lag")
OFF_LAG = (1.5, 3.0)
"""By which factor the lag of a model is off, one way or the other."""
OWN_LAG_S: dict[Sensor, tuple[float, float]] = {"camera": (0.01, 0.06), "vibrometer": (0.0005, 0.003)}
_DRAWS, _FAR_OFF = 10, 1_000_000
_CALIBRATED = (("gain_error",), ("offset",), CALIBRATIONS)


def singles(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect of CONTRACT.md on every sensor that excites it, once per seed."""
    for seed in seeds:
        for name, entry in INSIDE.items():
            for sensor in entry.ranges:
                yield _drawn("single", name, seed, sensor)


def pairs(seeds: Iterable[int]) -> Iterator[Case]:
    """One pair of effects for each pair of stages and seed: ten per seed, none again until all have had their turn.

    A pair one of whose effects hides the other in all its draws gives its turn to the next one.
    """
    for seed in seeds:
        for stages in combinations(_STAGES, 2):
            yield _first_that_shows(_turns(stages, seed), seed)


def _several(count: int, seeds: Iterable[int]) -> Iterator[Case]:
    """So many effects of as many stages: every choice of stages once per seed."""
    for seed in seeds:
        for stages in combinations(_STAGES, count):
            yield _first_that_shows(_turns(stages, seed), seed, "several")


def triples(seeds: Iterable[int]) -> Iterator[Case]:
    """Three effects of three stages, ten per seed."""
    return _several(3, seeds)


def quadruples(seeds: Iterable[int]) -> Iterator[Case]:
    """Four effects of four stages, five per seed."""
    return _several(4, seeds)


def quintuples(seeds: Iterable[int]) -> Iterator[Case]:
    """An effect of every stage, one case per seed."""
    return _several(5, seeds)


def faint(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect on its first sensor, with a gap of about the noise."""
    for seed in seeds:
        for name, entry in INSIDE.items():
            yield _drawn("faint", name, seed, next(iter(entry.ranges)))


def moved(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect on every sensor that excites it, moved from its equation by 5, 10 and 20 % of its size, in turn.

    Three seeds in a row have each of them by each size.
    """
    for seed in seeds:
        turns: list[tuple[str, Sensor]] = [(name, sensor) for name, entry in INSIDE.items() for sensor in entry.ranges]
        for k, (name, sensor) in enumerate(turns):
            yield _drawn("moved", name, seed, sensor, moved=MOVED[(seed + k) % len(MOVED)])


def approximate(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect on its first sensor, given a model whose frequency, damping and gain are a little wrong.

    But for effects that are another frequency or another damping.
    """
    for seed in seeds:
        for name, entry in INSIDE.items():
            if name not in OWN:
                case = _drawn("single", name, seed, next(iter(entry.ranges)))
                rng = stream(case.entropy, "given")
                frequency, gain = (float(rng.uniform(1.0 - x, 1.0 + x)) for x in (OFF_FREQUENCY, OFF_GAIN))
                damping = float(np.exp(rng.uniform(-1.0, 1.0) * np.log(OFF_DAMPING)))
                yield identified(replace(case, given=Given(frequency, damping, gain)))


def lagging(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect on its first sensor, which lags, and by another time than the model that is given says.

    But for effects that are lags themselves, or the number of the model that could make up for one.
    """
    for seed in seeds:
        for name, entry in INSIDE.items():
            if name not in (*OWN, *LAGS):
                sensor = next(iter(entry.ranges))
                case = _drawn("single", name, seed, sensor)
                rng = stream(case.entropy, "lagging")
                lag_s = float(np.exp(rng.uniform(*np.log(OWN_LAG_S[sensor]))))
                off = float(np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(*np.log(OFF_LAG))))
                yield identified(replace(case, given=Given(lag=off, lag_s=lag_s)))


def starts(seeds: Iterable[int]) -> Iterator[Case]:
    """Nothing hidden: begun in motion, with a step in the first row, and in a closed loop, on either sensor."""
    for seed in seeds:
        for start in STARTS[1:]:
            yield make_case("nothing", (), seed, SENSORS[seed % len(SENSORS)], start=start)
        yield make_case("nothing", (), seed, "camera", closed_loop=True)


def begun(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect on its first sensor, in a record that begins in motion or with a step, in turn."""
    for seed in seeds:
        for k, (name, entry) in enumerate(INSIDE.items()):
            start = STARTS[1:][(seed + k) % 2]
            yield _drawn("single", name, seed, next(iter(entry.ranges)), start=start)


def loops(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect that the camera sees, in a closed loop; those that never show in one are left out."""
    for seed in seeds:
        for name, entry in INSIDE.items():
            if "camera" in entry.ranges:
                try:
                    yield make_case("single", (name,), seed, "camera", closed_loop=True)
                except DrawError:
                    continue


def nothing(seeds: Iterable[int]) -> Iterator[Case]:
    """Benches without anything hidden, one per seed; the sensors take turns."""
    for seed in seeds:
        yield make_case("nothing", (), seed, SENSORS[seed % len(SENSORS)])


def calibrations(seeds: Iterable[int]) -> Iterator[Case]:
    """A wrong gain, a wrong offset and both, on either sensor, once per seed."""
    for seed in seeds:
        for names in _CALIBRATED:
            for sensor in SENSORS:
                yield make_case("calibration", names, seed, sensor)


def outside(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect that no catalogue should have, on every sensor that excites it, once per seed."""
    for seed in seeds:
        for name, entry in OUTSIDE.items():
            for sensor in entry.ranges:
                yield _drawn("outside", name, seed, sensor)


def weak(seeds: Iterable[int]) -> Iterator[Case]:
    """Every effect that has a rival it can be confused with, excited too weakly to tell, once per seed."""
    for seed in seeds:
        for name in TRUTHS:
            yield make_case("weak", (name,), seed)


SELECTIONS: dict[str, Callable[[Iterable[int]], Iterator[Case]]] = {
    "singles": singles,
    "pairs": pairs,
    "triples": triples,
    "quadruples": quadruples,
    "quintuples": quintuples,
    "faint": faint,
    "moved": moved,
    "begun": begun,
    "approximate": approximate,
    "lagging": lagging,
    "loops": loops,
    "nothing": nothing,
    "starts": starts,
    "calibrations": calibrations,
    "outside": outside,
    "weak": weak,
}


def cases(selection: str | Iterable[str], seeds: Iterable[int]) -> Iterator[Case]:
    """The cases of a selection, drawn one at a time as they are asked for.

    Args:
        selection: names of `SELECTIONS`; "all" for all of them; "spoiled <name>" for the same cases with 1 % of
            outlying and 2 % of lost frames.
        seeds: a case is drawn anew for each.

    Raises:
        ValueError: a name is not one of these.
    """
    names = (selection,) if isinstance(selection, str) else tuple(selection)
    numbers = tuple(seeds)
    for name in names:
        kept = name.removeprefix("spoiled ")
        if kept != "all" and kept not in SELECTIONS:
            raise ValueError(f"selection must be all or among {', '.join(SELECTIONS)}, found {name!r}")
    for name in names:
        kept = name.removeprefix("spoiled ")
        for each in SELECTIONS if kept == "all" else (kept,):
            for case in SELECTIONS[each](numbers):
                yield case if kept == name else spoiled(case)


def _drawn(kind: Kind, name: str, seed: int, sensor: Sensor, *, start: Start = "rest", moved: float = 0.0) -> Case:
    """A case of one effect; where nothing that a seed draws shows, another seed far off takes its place."""
    for again in range(_DRAWS - 1):
        try:
            return make_case(kind, (name,), seed + again * _FAR_OFF, sensor, start=start, moved=moved)
        except DrawError:
            continue
    return make_case(kind, (name,), seed + (_DRAWS - 1) * _FAR_OFF, sensor, start=start, moved=moved)


def _turns(stages: tuple[str, ...], seed: int) -> list[tuple[str, ...]]:
    """Effects of these stages, one of each, in a fixed shuffled order, from those whose turn it is."""
    of_stages = [[name for name, entry in INSIDE.items() if entry.stage == stage] for stage in stages]
    possible = [names for names in product(*of_stages) if common_sensors(names)]
    order = stream(0, " ".join(stages)).permutation(len(possible))
    start = seed % len(possible)
    return [possible[k] for k in (*order[start:], *order[:start])]


def _first_that_shows(turns: Sequence[tuple[str, ...]], seed: int, kind: Kind = "pair") -> Case:
    for names in turns:
        possible = common_sensors(names)
        shown = possible[seed % len(possible) :] + possible[: seed % len(possible)]
        for sensor in shown:
            try:
                return make_case(kind, names, seed, sensor)
            except DrawError:
                continue
    stages = " and ".join(effect(name).stage for name in turns[0])
    raise DrawError(f"nothing of {stages} shows with seed {seed}; use another seed")
