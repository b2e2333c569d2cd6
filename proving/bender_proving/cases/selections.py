"""The catalogue of cases: what a method of diagnosis is judged on."""

from collections.abc import Callable, Iterable, Iterator
from itertools import combinations

from bender_proving.bench import stream
from bender_proving.cases.case import Case, Kind, spoiled
from bender_proving.cases.draw import CALIBRATIONS, DrawError, make_case
from bender_proving.cases.effects import INSIDE, OUTSIDE, common_sensors, effect
from bender_proving.cases.hidden import SENSORS, Sensor
from bender_proving.cases.weak import TRUTHS

_STAGES = ("supply", "material", "structure", "surroundings", "sensor")
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
    "nothing": nothing,
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


def _drawn(kind: Kind, name: str, seed: int, sensor: Sensor) -> Case:
    """A case of one effect; where nothing that a seed draws shows, another seed far off takes its place."""
    for again in range(_DRAWS - 1):
        try:
            return make_case(kind, (name,), seed + again * _FAR_OFF, sensor)
        except DrawError:
            continue
    return make_case(kind, (name,), seed + (_DRAWS - 1) * _FAR_OFF, sensor)


def _turns(stages: tuple[str, str], seed: int) -> list[tuple[str, str]]:
    """Pairs of effects of two stages in a fixed shuffled order, from the one whose turn it is."""
    first, second = ([name for name, entry in INSIDE.items() if entry.stage == stage] for stage in stages)
    possible = [(a, b) for a in first for b in second if common_sensors((a, b))]
    order = stream(0, " ".join(stages)).permutation(len(possible))
    start = seed % len(possible)
    return [possible[k] for k in (*order[start:], *order[:start])]


def _first_that_shows(turns: list[tuple[str, str]], seed: int) -> Case:
    for names in turns:
        possible = common_sensors(names)
        shown = possible[seed % len(possible) :] + possible[: seed % len(possible)]
        for sensor in shown:
            try:
                return make_case("pair", names, seed, sensor)
            except DrawError:
                continue
    stages = " and ".join(effect(name).stage for name in turns[0])
    raise DrawError(f"no pair of {stages} shows with seed {seed}; use another seed")
