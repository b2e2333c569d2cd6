"""Parameters of the FMU against missing effects, by the same evidence.

The records are diagnosed with the FMU as given, and again with the suspected parameters where they fit best: alone,
and beside the effects that were found. Each way is priced by its residual, its free numbers, and by among how many it
was picked: an effect is the luckiest of all starts of the search, a suspected parameter one of the few that the user
named. A pole that is off can be made up for by an effect whose zero falls on the pole as given; only that price tells
the coincidence from the cause. The cheapest way wins; of those that the evidence does not separate from it, one wins
whose correction stands in the FMU or around it, and then the one with fewer numbers. Where parameters alone and effects
alone do equally well, both are said.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.conclusion.findings import RecalibratedNumber
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.foreign.answers import Answers, short_step_s
from bender_discrepancy.foreign.calibration import Calibrated, calibrate
from bender_discrepancy.foreign.container_stages import Original, Stages, stages_around
from bender_discrepancy.foreign.corrected_fmu import why_none
from bender_discrepancy.foreign.suspects import Suspect
from bender_inference.fitting.criterion import independent_rows, price, very_strong, yardstick
from bender_inference.records.observations import Observations, observe
from bender_inference.records.stand_in import Suspected
from bender_inference.search.search import Progress
from bender_inference.settings import Settings
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.record import Record
from bender_loop.records.replay import replay
from bender_plant.model import Model

Array = NDArray[np.float64]
ALIKE = 0.3
"""Of its standard deviation: values of a parameter that are nearer are one."""


@dataclass(frozen=True, slots=True)
class Contest:
    """What competes.

    Attributes:
        plant: the FMU, running.
        records: of one bench.
        how: they are read.
        suspects: parameters that may be off.
        at: the diagnosis with values of parameters.
        tell: is told what is being done.
    """

    plant: WatchedPlant
    records: tuple[Record, ...]
    how: Settings
    suspects: tuple[Suspect, ...]
    at: Callable[[Mapping[str, float]], Diagnosis]
    tell: Progress


@dataclass(frozen=True, slots=True, eq=False)
class Account:
    """One way to explain the records: the diagnosis, and the parameters that were moved for it."""

    diagnosis: Diagnosis
    moved: Calibrated | None

    @property
    def effects(self) -> frozenset[str]:
        """Ids of the effects in it."""
        return frozenset(x.id for x in self.diagnosis.added)

    @property
    def stands(self) -> bool:
        """Whether all of it stands in the FMU, before it or behind it, and nothing of the stand-in had to give way."""
        return not (self.changes_inside or self.gave_way)

    @property
    def gave_way(self) -> bool:
        """Whether numbers of the stand-in were fitted again: the FMU's own may be off."""
        return self.diagnosis.findings.search.best.hypothesis.own is not None

    @property
    def changes_inside(self) -> bool:
        """Whether some of its effects stand beside the FMU."""
        return bool(self.diagnosis.stand_in and self.diagnosis.stand_in.beside)

    @property
    def numbers(self) -> int:
        """How many free numbers it has."""
        moved = len(self.moved.parameters) if self.moved else 0
        return self.diagnosis.findings.search.best.hypothesis.free_count + moved

    def cost(self, effective_rows: float) -> float:
        """Return the criterion on the rows that fits and choices see."""
        search = self.diagnosis.findings.search
        rows = sum(int(x.searched.sum()) for x in search.problem.observations)
        square = max(search.best.training_square + search.best.held_square, 1e-300)
        return effective_rows * math.log(square / rows) + price(self.numbers, effective_rows)

    def selection_cost(self, tried: int) -> float:
        """Return what it costs that its effects and parameters were picked, each among so many."""
        suspected = len(self.moved.parameters) + len(self.moved.unseen) if self.moved else 1
        return 2.0 * (len(self.effects) * math.log(max(tried, 1)) + math.log(max(suspected, 1)))


def compete(contest: Contest) -> Diagnosis:
    """Return the diagnosis that the evidence favours, with what it says of the suspected parameters."""
    given = Account(contest.at({}), None)
    contest.tell("fitting the suspected parameters alone")
    alone = _fitted(contest, _direct(contest), contest.suspects)
    ways = [given]
    off = [x.suspect for x in alone.parameters if x.is_off]
    open_gap = given.diagnosis.verdict not in ("no_gap", "recalibrated") or _leaves_more_than_noise(given, alone)
    seen = [x.suspect for x in alone.parameters]
    if off and open_gap:
        if len(off) < len(alone.parameters):
            alone = replace(_fitted(contest, _direct(contest), off), unseen=alone.unseen)
        ways += _with_parameters(contest, given, alone, off)
    elif seen and open_gap and given.gave_way:
        # an effect hides by itself what the stand-in had to give way to
        ways += _beside_effects(contest, [given], alone, seen)
    if seen and open_gap:
        ways += _in_place_of_effects(contest, given, alone, seen)
    return _choose(ways, alone)


def _leaves_more_than_noise(given: Account, alone: Calibrated) -> bool:
    return given.diagnosis.verdict == "recalibrated" and alone.rms_um < given.diagnosis.gap.recalibrated.rms_um


def _with_parameters(contest: Contest, given: Account, alone: Calibrated, off: Sequence[Suspect]) -> list[Account]:
    """Return what is found with the parameters moved: alone, and beside effects."""
    first = Account(contest.at(alone.values()), alone)
    ways = [first]
    beside = [given] if given.effects and given.diagnosis.fmu else []
    # with the parameters as given, an effect may make up for them and hide the one that is missing
    if first.effects and first.effects not in [x.effects for x in beside]:
        beside.append(first)
    known = [x.moved for x in ways if x.moved]
    return ways + _beside_effects(contest, beside, alone, off, known)


def _beside_effects(
    contest: Contest,
    beside: Sequence[Account],
    alone: Calibrated,
    off: Sequence[Suspect],
    known: Sequence[Calibrated] = (),
) -> list[Account]:
    """Return what is found with parameters fitted beside the effects of some ways, where these are not known values."""
    if why_none() is not None:
        return []
    ways: list[Account] = []
    # what stands beside the FMU changes its inside, as the suspected parameters do: they are fitted with it and without
    tried = [(way, inside) for way in beside for inside in ((True, False) if way.changes_inside else (True,))]
    for way, inside in tried:
        contest.tell("fitting the suspected parameters beside the effects")
        again = _beside(contest, way, off, inside=inside)
        if (
            again is not None
            and any(x.is_off for x in again.parameters)
            and not is_among(again, [*known, *(x.moved for x in ways if x.moved)])
        ):
            ways.append(Account(contest.at(again.values()), replace(again, unseen=alone.unseen)))
    return ways


def _in_place_of_effects(contest: Contest, given: Account, alone: Calibrated, seen: Sequence[Suspect]) -> list[Account]:
    """Return what is found with parameters in the place of each of several effects.

    What is missing besides may hide by itself that a parameter is off, and an effect make up for it.
    """
    if len(given.effects) < 2 or given.diagnosis.fmu is None or why_none() is not None:
        return []
    ways: list[Account] = []
    for effect in sorted(given.effects):
        contest.tell(f"fitting the suspected parameters instead of {effect}")
        again = _beside(contest, _lacking(given, effect), seen, inside=True)
        off = [] if again is None else [x.suspect for x in again.parameters if x.is_off]
        if off and again is not None and len(off) < len(again.parameters):
            again = _beside(contest, _lacking(given, effect), off, inside=True)
        if not off or again is None or is_among(again, [x.moved for x in ways if x.moved]):
            continue
        way = Account(contest.at(again.values()), replace(again, unseen=alone.unseen))
        if len(way.effects) < len(given.effects):
            ways.append(way)
    return ways


def is_among(fitted: Calibrated, known: Sequence[Calibrated]) -> bool:
    """Return whether these parameters were found already, to within a part of what the records leave open."""
    for values in (x.values() for x in known):
        if values.keys() == fitted.values().keys() and all(
            abs(x.value - values[x.suspect.name]) < ALIKE * x.std for x in fitted.parameters
        ):
            return True
    return False


def _lacking(way: Account, effect: str) -> Account:
    """Return a way with one effect taken out of its corrected model."""
    model = way.diagnosis.model
    shorter = replace(model, blocks=tuple(x for x in model.blocks if x.id != effect))
    return replace(way, diagnosis=replace(way.diagnosis, findings=replace(way.diagnosis.findings, model=shorter)))


def _beside(contest: Contest, way: Account, off: Sequence[Suspect], *, inside: bool) -> Calibrated | None:
    """Return the parameters fitted with the effects of a way around the FMU, None where none stand there.

    Args:
        contest: what competes.
        way: with the effects.
        off: parameters that are fitted.
        inside: with those effects that stand beside the FMU, too.
    """
    search, known, plant = way.diagnosis.findings.search, way.diagnosis.stand_in, contest.plant
    assert known is not None
    first, start = contest.records[0], dict(known.start_values)
    plant.set_parameters(start)
    plant.follow(first.time_s, first.further)
    plant.reset()
    original = Original(plant.path, plant.input, plant.output, start, plant.read(), first.quantities)
    stages = stages_around(search.base, way.diagnosis.model, original.rest_um)
    if stages.before is None and stages.behind is None:
        return None
    # the stand-in's own numbers gave way to what the parameters are now fitted to
    changed = stages.inside if inside and search.best.hypothesis.own is None else None
    return _fitted(contest, _around(contest, original, replace(stages, inside=changed), search.base), off)


def _direct(contest: Contest) -> Callable[[dict[str, float]], list[Array]]:
    hold = contest.how.input_hold
    given = {x.name: x.given for x in contest.suspects}

    def run(values: dict[str, float]) -> list[Array]:
        contest.plant.set_parameters(given | values)
        return [
            replay(contest.plant, x, input_hold=hold, untimed=contest.how.untimed).simulated_um for x in contest.records
        ]

    return run


def _around(
    contest: Contest, original: Original, stages: Stages, stand_in: Model
) -> Callable[[dict[str, float]], list[Array]]:
    seen = [observe(x, contest.how.linear, contest.how.untimed, contest.how.smooth) for x in contest.records]
    answers = Answers(contest.plant, [original])
    step_s = short_step_s(seen, [stages], [stand_in])
    name = original.output.name

    def run(values: dict[str, float]) -> list[Array]:
        answers.set_parameters(values)
        rows = zip(seen, contest.records, strict=True)
        return [answers.readings(name, original.rest_um, stages, x, record, step_s) for x, record in rows]

    return run


def _fitted(
    contest: Contest, run: Callable[[dict[str, float]], list[Array]], suspects: Sequence[Suspect]
) -> Calibrated:
    seen: list[Observations] = [
        observe(x, contest.how.linear, contest.how.untimed, contest.how.smooth) for x in contest.records
    ]
    return calibrate(run, seen, suspects, free_reading=True)


def _choose(ways: Sequence[Account], alone: Calibrated) -> Diagnosis:
    given = ways[0]
    least = min(ways, key=lambda x: x.diagnosis.findings.search.best.training_square)
    search = least.diagnosis.findings.search
    by = yardstick(search.problem, search.best, search.grades.by.tried)
    rows = independent_rows(search.problem, search.best)
    costs = [x.cost(rows) + x.selection_cost(by.tried) for x in ways]
    close = [x for x, c in zip(ways, costs, strict=True) if c <= min(costs) + very_strong(by.confidence)]
    best = min(close, key=lambda x: (not x.stands, not is_complete(x), x.numbers))
    rival = next((x for x in close if _rivals(best, x)), None)
    suspected = Suspected(
        tuple((x.suspect.name, x.suspect.given, x.value, x.std, x.suspect.unit) for x in _moved(best)),
        alone.unseen,
        alone.combinations,
        None if rival is None else _describe(rival),
    )
    return with_suspected(best, given, suspected)


def is_complete(way: Account) -> bool:
    """Return whether a way leaves nothing above the noise unexplained."""
    return way.diagnosis.verdict in ("no_gap", "recalibrated") or way.diagnosis.is_complete


def _rivals(best: Account, other: Account) -> bool:
    """Return whether one has parameters and no effects, the other effects and no parameters, and both explain all."""
    if other is best or not (is_complete(best) and is_complete(other) and best.stands and other.stands):
        return False
    kinds = {(bool(x.effects), x.moved is not None) for x in (best, other)}
    return kinds == {(True, False), (False, True)}


def _moved(way: Account) -> tuple:
    return () if way.moved is None else way.moved.parameters


def _describe(way: Account) -> str:
    moved = [f"{x.suspect.name} at {x.value:.4g}" for x in _moved(way)]
    return " and ".join([*moved, *sorted(way.effects)])


def with_suspected(best: Account, given: Account, suspected: Suspected) -> Diagnosis:
    """Return the diagnosis of a way with the parameters that were moved among what was recalibrated."""
    found = best.diagnosis
    assert found.stand_in is not None
    known = replace(found.stand_in, suspected=suspected)
    if best.moved is None:
        word = "ambiguous" if suspected.rival else found.verdict
        return replace(found, stand_in=known, findings=replace(found.findings, verdict=word))
    numbers = tuple(RecalibratedNumber(name, was, now, std, unit) for name, was, now, std, unit in suspected.moved)
    verdict = "recalibrated" if found.verdict == "no_gap" else found.verdict
    nothing_else = found.verdict in ("no_gap", "recalibrated")
    reason = "parameters of the FMU were off" + (
        ", and nothing else is missing" if nothing_else else f"; {found.findings.reason}"
    )
    findings = replace(
        found.findings,
        verdict="ambiguous" if suspected.rival else verdict,
        reason=reason,
        recalibrated=(*numbers, *found.findings.recalibrated),
        changed=(*numbers, *found.findings.changed),
    )
    return replace(found, findings=findings, gap=_from_given(found, given.diagnosis), stand_in=known)


def _from_given(found: Diagnosis, given: Diagnosis) -> Measured:
    """Return a gap whose first stage is that of the FMU as given."""
    assert found.stand_in is not None
    assert given.stand_in is not None
    shifts = zip(given.stand_in.differences_um, found.stand_in.differences_um, strict=True)
    windows = found.findings.search.searched
    before = [y + (a - b)[rows] for y, (a, b), rows in zip(given.gap.before_um, shifts, windows, strict=True)]
    return replace(found.gap, before=given.gap.before, before_um=before, is_corrected=True)
