"""The effects that a diagnosis reports, each with its hypothesis, its share of the gap, its grade and its rivals."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from bender_discrepancy.conclusion.shares import closed_by, held_square_um2, shares_of_gap
from bender_inference.fitting.output_error import Fitted
from bender_inference.search.judgement.grades import Grade, Graded, Rival
from bender_inference.search.judgement.probability import Case
from bender_inference.search.result import SearchResult

# open rivals that are reported as effects, and rivals that are listed beside each effect
MOST_REPORTED, MOST_LISTED = 4, 6
# of what explains too little, so many are told that close at least this part
MOST_TOLD, LEAST_TOLD = 3, 0.1
OPEN_VERDICTS = ("ambiguous", "likely")


@dataclass(frozen=True, slots=True, eq=False)
class Contender:
    """One effect that is reported.

    Attributes:
        fitted: the hypothesis in which it stands.
        index: its place in that hypothesis.
        share_of_gap: part of the recalibrated residual's variance above the noise floor that it closes; those of one
            hypothesis add up to what it closes. Of a rival: what it would close in the place of the effect.
        before_um: rms on held-out rows of the hypothesis without it, fitted again.
        after_um: the same with it.
        without: the criterion's difference to the hypothesis without it.
        grade: how sure it is.
        probability: that it is there.
        rivals: others that were fitted in its place, best first.
        rival_of: the effect whose place it would take, for the rivals of an open verdict; None otherwise.
        is_all: without it nothing but the recalibrated model is left.
        case: what its probability follows from; None of a rival, whose own follows from that of the effect.
    """

    fitted: Fitted
    index: int
    share_of_gap: float
    before_um: float
    after_um: float
    without: float
    grade: Grade
    probability: float
    rivals: tuple[Rival, ...]
    rival_of: str | None = None
    is_all: bool = False
    case: Case | None = None

    @property
    def id(self) -> str:
        """The contract's name of the effect."""
        return self.fitted.hypothesis.effects[self.index]


def leaders(search: SearchResult) -> tuple[Fitted, ...]:
    """Return the hypotheses that the records cannot distinguish, best first; the best alone where they can."""
    if search.verdict.word not in OPEN_VERDICTS or search.grades.commuting:
        return (search.best,)
    rivals = (y for x in search.grades.effects for y in _open(search, x))
    distinct: dict[frozenset[str], Fitted] = {}
    for x in sorted(rivals, key=lambda x: search.archive.square(x.fitted)):
        distinct.setdefault(frozenset(x.fitted.hypothesis.effects), x.fitted)
    return (search.best, *list(distinct.values())[:MOST_REPORTED])


def _open(search: SearchResult, graded: Graded) -> Iterator[Rival]:
    """Yield the rivals of an effect that may stand in its place."""
    part = search.best.hypothesis.parts[graded.index]
    is_ambiguous = search.verdict.word == "ambiguous"
    for x in graded.rivals:
        if is_ambiguous and x.reach == "as large":
            continue
        memory = next((y.form.memory for y in x.fitted.hypothesis.parts if y.form.effect == x.id), False)
        if x.reach or (search.grades.one_sine and part.form.memory and memory and _closes_as_well(search, x)):
            yield x


def _closes_as_well(search: SearchResult, rival: Rival) -> bool:
    """Return whether a rival with a memory, which one sine cannot rule out, closes the gap nearly as well."""
    rules, base = search.rules, search.found.base
    best, other = (rules.closed_share(search.archive, base, x) for x in (search.best, rival.fitted))
    return other > 0.8 * best


def contested(search: SearchResult) -> frozenset[str]:
    """Return the effects of the best hypothesis that are not certain."""
    return frozenset(x.id for x in search.grades.effects if x.grade != "certain")


@dataclass(frozen=True, slots=True)
class Alternative:
    """Effects that are not said to be missing, though they would account for the gap in part or as well.

    Attributes:
        effects: by their ids, in the order of adding.
        closes: part of the variance of the gap above the noise floor, over the training and selection blocks.
    """

    effects: tuple[str, ...]
    closes: float


def alternatives(search: SearchResult, verdict: str) -> tuple[Alternative, ...]:
    """Return what came nearest where nothing explains the gap, and what fits as well as the model's own numbers do.

    Args:
        search: what was found.
        verdict: the final one.
    """
    archive, base = search.archive, search.found.base
    tried = [x for x in archive.fits if x.hypothesis.parts]
    if verdict == "recalibrated" and search.best.hypothesis.own is not None:
        tried = [x for x in tried if not search.rules.is_preferred(archive, search.best, x)]
    elif verdict != "unexplained":
        return ()
    once: dict[frozenset[str], Alternative] = {}
    for x in archive.by_fit(tried):
        told = Alternative(x.hypothesis.effects, search.rules.closed_share(archive, base, x))
        once.setdefault(frozenset(told.effects), told)
    return tuple(x for x in once.values() if x.closes > LEAST_TOLD)[:MOST_TOLD]


def contenders(search: SearchResult, known_shares: Mapping[str, float] | None = None) -> list[Contender]:
    """Return the effects to report: those of the best hypothesis, then the rivals that it cannot be told from.

    Certain effects stand in the order of adding, others with the likeliest first.

    Args:
        search: what was found.
        known_shares: of the gap, by effect, where they are known already.
    """
    graded = search.grades.effects
    if search.verdict.word == "likely":
        graded = tuple(sorted(graded, key=lambda x: -x.probability))
    shares = known_shares or shares_of_gap(search.archive, search.found.base, search.best)
    found = [_own(search, x, shares[x.id]) for x in graded]
    if search.verdict.word not in OPEN_VERDICTS or search.grades.commuting:
        return found
    known = set(search.best.hypothesis.effects)
    for x in graded:
        for rival in _open(search, x):
            if rival.id not in known and len(known) < len(graded) + MOST_REPORTED:
                known.add(rival.id)
                index = rival.fitted.hypothesis.effects.index(rival.id)
                found.append(_in_place(search, x, rival, index, shares[x.id]))
    return found


def _own(search: SearchResult, graded: Graded, share: float) -> Contender:
    """Return an effect of the best hypothesis."""
    rest, left = (held_square_um2(x, search.problem) ** 0.5 for x in (graded.without, search.best))
    rivals = graded.rivals[:MOST_LISTED]
    return Contender(
        search.best, graded.index, share, rest, left, graded.difference, graded.grade, graded.probability, rivals,
        is_all=graded.without is search.found.base, case=graded.case,
    )  # fmt: skip


def _in_place(search: SearchResult, graded: Graded, rival: Rival, index: int, replaced: float) -> Contender:
    """Return a rival that may stand in the place of an effect of the best hypothesis, which has a share of the gap."""
    rest, left = (held_square_um2(x, search.problem) for x in (graded.without, rival.fitted))
    best, other = (closed_by(search.archive, search.found.base, x) for x in (search.best, rival.fitted))
    share = min(max(replaced + other - best, 0.0), 1.0)
    beside = (Rival(graded.id, search.best, -rival.difference, -rival.deviations, rival.reach),)
    against = graded.probability_of(rival)
    return Contender(
        rival.fitted, index, share, rest**0.5, left**0.5, rival.difference, "possible", against, beside, graded.id,
        is_all=graded.without is search.found.base,
    )  # fmt: skip
