"""Several outputs of one FMU weighed together: does one correction of the input explain all of them?

Every output was diagnosed by itself. What was found to act on the input of one output has to act on all the others as
well: they share that input. Each such correction is therefore put before the FMU, and every output is read with it. A
way is one correction of the input for all outputs (or none, or one for each output by itself); it costs

    sum over outputs of C_j,        C_j = n_j ln(S_j / n_j) + price of the numbers behind output j,

and the price of its own numbers: the criterion of a single search (`fitting.criterion`), each output with its own
noise, so that the differences are those of one likelihood of all readings. Gain and offset of every reading are free.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from bender_discrepancy.conclusion.measurement.corrected_model import corrected
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.foreign.container_stages import Original, stages_around
from bender_inference.fitting.criterion import price, very_strong
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model

EACH_BY_ITSELF = "each output by itself"
OWN_STAGE = "supply"
"""Effects whose numbers are in units of the input and of time alone, and so the same for every output."""


@dataclass(frozen=True, slots=True)
class Correction:
    """What stands on one side of the FMU.

    Attributes:
        effects: their ids.
        stages: as a chain; None for nothing.
        count: of its free numbers.
        parts: the effects as they were found, where their numbers may be fitted again.
    """

    effects: tuple[str, ...] = ()
    stages: Model | None = None
    count: int = 0
    parts: tuple[Part, ...] = ()


NOTHING = Correction()


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """An output of the FMU that was diagnosed by itself.

    Attributes:
        diagnosis: of its readings.
        original: the FMU with this output.
        before: corrections of the input that its readings allow, the best first.
        behind: corrections of the output, the best first, nothing among them.
    """

    diagnosis: Diagnosis
    original: Original
    before: tuple[Correction, ...]
    behind: tuple[Correction, ...]

    @property
    def name(self) -> str:
        """The variable that is read."""
        return self.original.output.name

    @property
    def rows(self) -> float:
        """As how many independent ones the readings of fits and choices count."""
        return self.diagnosis.findings.search.grades.by.effective_rows

    @property
    def numbers(self) -> dict[tuple[str, str], tuple[float, float]]:
        """The scalars of what acts on its input by effect and name, with their weights, where these are known."""
        named = {x.id: x for x in self.diagnosis.added}
        return {
            (effect, x.name): (x.value, 1.0 / x.std**2)
            for effect in self.before[0].effects
            for x in named[effect].numbers
            if 0.0 < x.std < math.inf and x.name == x.field
        }

    @property
    def floor(self) -> float:
        """Noise of its readings, in the unit that they have."""
        return self.diagnosis.gap.floor_um


@dataclass(frozen=True, slots=True)
class OutputResidual:
    """What an output leaves with a correction on either side.

    Attributes:
        cost: n ln(S / n) of its innovations.
        rms: on held-out readings.
        gain: of the reading, that was fitted.
        offset: of the reading, for the record that the corrected model stands for.
    """

    cost: float
    rms: float
    gain: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class JointExplanation:
    """One way to explain all outputs.

    Attributes:
        shared: what acts on the input of all of them.
        source: the output by whose readings its numbers were found; several where they were averaged.
        behind: what acts behind each output, by its name.
        left: what each output leaves, by its name.
        cost: the criterion; lower is better.
        each: whether every output has its own correction of the input instead.
        apart: outputs that have more of their own on the input beside what all of them share.
    """

    shared: Correction
    source: tuple[str, ...]
    behind: Mapping[str, Correction]
    left: Mapping[str, OutputResidual]
    cost: float
    each: bool = False
    apart: frozenset[str] = frozenset()

    @property
    def effects(self) -> frozenset[str]:
        """Ids of what acts on the input."""
        return frozenset(self.shared.effects)


@dataclass(frozen=True, slots=True, eq=False)
class RankedExplanations:
    """All ways, the cheapest first, and how far apart two have to be."""

    ways: tuple[JointExplanation, ...]
    threshold: float

    @property
    def best(self) -> JointExplanation:
        """The way that the readings favour: among equals the one with fewer numbers of the input."""
        return min(self.close(), key=lambda x: (x.each, x.cost))

    def close(self) -> tuple[JointExplanation, ...]:
        """Return the ways that the readings do not rule out."""
        return tuple(x for x in self.ways if x.cost <= self.ways[0].cost + self.threshold)

    def rivals(self) -> tuple[JointExplanation, ...]:
        """Return those of them that name something else than the best one."""
        best, found = self.best, {}
        for way in self.close():
            if not way.each and not best.each and way.effects != best.effects:
                found.setdefault(way.effects, way)
        return tuple(found.values())


def output_of(diagnosis: Diagnosis, original: Original) -> Output:
    """Return an output with what may stand on either side of the FMU by its own readings."""
    search = diagnosis.findings.search
    before: list[Correction] = []
    behind: list[Correction] = []
    for k, fitted in enumerate(diagnosis.findings.leaders):
        record = diagnosis.findings.of_record
        model = diagnosis.findings.model if k == 0 else corrected(search.base, fitted, 0.0, record)
        sides = stages_around(search.base, model, original.rest_um)
        before.append(_side(sides.before, fitted.hypothesis))
        behind.append(_side(sides.behind, fitted.hypothesis))
    return Output(diagnosis, original, _once(before), _once([*behind, NOTHING]))


def _side(stages: Model | None, hypothesis: Hypothesis) -> Correction:
    if stages is None:
        return NOTHING
    present = {x.id for x in stages.blocks}
    parts = [x for x in hypothesis.parts if x.form.effect in present]
    return Correction(tuple(x.form.effect for x in parts), stages, sum(len(x.values) for x in parts), tuple(parts))


def _once(found: Sequence[Correction]) -> tuple[Correction, ...]:
    kept: dict[frozenset[str], Correction] = {}
    for x in found:
        kept.setdefault(frozenset(x.effects), x)
    return tuple(kept.values())


def corrections(outputs: Sequence[Output]) -> list[tuple[Correction, tuple[str, ...]]]:
    """Return the corrections of the input that compete, each with the outputs that its numbers are from."""
    found: list[tuple[Correction, tuple[str, ...]]] = [(NOTHING, ())]
    found += [(x, (output.name,)) for output in outputs for x in output.before if x.stages is not None]
    return found + averaged(outputs)


def averaged(outputs: Sequence[Output]) -> list[tuple[Correction, tuple[str, ...]]]:
    """Return the corrections that several outputs found by themselves, with their numbers weighed by 1 / std^2.

    Numbers of the film or the material have the output in their units, and are left as one output has them.
    """
    same: dict[frozenset[str], list[Output]] = {}
    for output in outputs:
        first = output.before[0]
        if first.stages is not None and all(BLOCKS[x].stage == OWN_STAGE for x in first.effects):
            same.setdefault(frozenset(first.effects), []).append(output)
    found = []
    for those in (x for x in same.values() if len(x) > 1):
        mean = _mean(those)
        if mean is not None:
            found.append((mean, tuple(x.name for x in those)))
    return found


def _mean(outputs: Sequence[Output]) -> Correction | None:
    """Return the correction of several outputs with averaged numbers, None where their forms differ."""
    first = outputs[0].before[0]
    values = [x.numbers for x in outputs]
    if first.stages is None or any(set(x) != set(values[0]) for x in values):
        return None
    stages = first.stages
    for effect in first.effects:
        mean = {
            name: float(np.average([x[effect, name][0] for x in values], weights=[x[effect, name][1] for x in values]))
            for of, name in values[0]
            if of == effect
        }
        settings = next(x.parameters for x in stages.blocks if x.id == effect)
        stages = stages.with_block(effect, **(_given(settings) | mean))
    return replace(first, stages=stages)


def _given(settings: Any) -> dict[str, Any]:
    values = {x.name: getattr(settings, x.name) for x in fields(settings)}
    return {name: x for name, x in values.items() if x is not None}


def rank_explanations(
    outputs: Sequence[Output],
    left: Mapping[tuple[str, int, int], OutputResidual],
    own: Mapping[str, OutputResidual],
    confidence: float,
    competing: Sequence[tuple[Correction, tuple[str, ...]]] | None = None,
    fitted: Mapping[tuple[str, int, int], Correction] | None = None,
) -> RankedExplanations:
    """Return all ways, the cheapest first.

    Args:
        outputs: of one FMU.
        left: what an output leaves, by its name and the places of the correction before and behind.
        own: what each output leaves with all that it has by itself.
        confidence: that no chance decides.
        competing: the corrections of the input in the order of their places; None for all.
        fitted: corrections behind with other numbers, by the keys of `left`.
    """
    rows = sum(x.rows for x in outputs)
    found, again = [], fitted or {}
    for place, (shared, source) in enumerate(corrections(outputs) if competing is None else competing):
        behind, kept, cost, apart = {}, {}, price(shared.count, rows), set()
        for x in outputs:
            keys = [(k, b) for k, b in enumerate(x.behind) if (x.name, place, k) in left]
            options = [(left[x.name, place, k], again.get((x.name, place, k), b)) for k, b in keys]
            more = _own_beside(shared, x, [y for y in outputs if y.name in source], confidence)
            options += [(own[x.name], more)] if more is not None else []
            least, chosen = min(options, key=lambda o: o[0].cost + price(o[1].count, x.rows))
            behind[x.name], kept[x.name] = chosen, least
            apart |= {x.name} if chosen is more else set()
            cost += least.cost + price(chosen.count, x.rows)
        found.append(JointExplanation(shared, source, behind, kept, cost, apart=frozenset(apart)))
    if not _all_agree(outputs, confidence):
        cost = sum(own[x.name].cost + price(x.before[0].count + x.behind[0].count, x.rows) for x in outputs)
        found.append(JointExplanation(NOTHING, (), {x.name: x.behind[0] for x in outputs}, dict(own), cost, each=True))
    ways = tuple(sorted(found, key=lambda x: x.cost))
    return RankedExplanations(ways, very_strong(confidence))


def _all_agree(outputs: Sequence[Output], confidence: float) -> bool:
    """Return whether every output found the same on its input, by chance at most apart: then none has its own."""
    first, *others = outputs
    shared = first.before[0]
    return bool(shared.effects) and all(
        set(x.before[0].effects) == set(shared.effects) and _agree(first, x, shared, confidence) for x in others
    )


def _own_beside(shared: Correction, output: Output, sources: Sequence[Output], confidence: float) -> Correction | None:
    """Return what an output has by itself beside what all share, None where it has no more on its input, or other."""
    before, behind = output.before[0], output.behind[0]
    if (
        not shared.effects
        or not set(shared.effects) < set(before.effects)
        or not all(_agree(output, x, shared, confidence) for x in sources)
    ):
        return None
    rest = tuple(x for x in before.effects if x not in shared.effects)
    return Correction((*rest, *behind.effects), None, before.count - shared.count + behind.count)


def _agree(one: Output, other: Output, shared: Correction, confidence: float) -> bool:
    """Return whether two outputs found the same numbers of what they share, by chance at most apart."""
    first, second = one.numbers, other.numbers
    alike = [x for x in first if x in second and x[0] in shared.effects]
    far = math.sqrt(very_strong(confidence))
    return all(
        abs(first[x][0] - second[x][0]) <= far * math.hypot(*(y[x][1] ** -0.5 for y in (first, second))) for x in alike
    )
