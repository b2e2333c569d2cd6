"""What goes with the date, and which batch differs: rank tests, corrected for their number (Bonferroni)."""

from dataclasses import dataclass
from datetime import date

import numpy as np
from numpy.typing import NDArray

from bender_fleet.population.features import Array, Feature, Population

CHANCE = 0.01
FEWEST, FEWEST_DAYS, FEWEST_OF_BATCH, MOST_BATCHES = 12, 5, 4, 60


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """A number, or the share of units with an effect, that goes with the date.

    Attributes:
        label: of the number.
        unit: of the values.
        days: (n,) ordinal days.
        values: (n,).
        rank_correlation: of Spearman.
        early: median of the first quarter of the days.
        late: median of the last quarter.
    """

    label: str
    unit: str
    days: Array
    values: Array
    rank_correlation: float
    early: float
    late: float


@dataclass(frozen=True, slots=True)
class BatchFinding:
    """A batch that differs from the others: in an effect's share, or in a number's median."""

    batch: str
    label: str
    unit: str
    inside: float
    outside: float
    count: int
    is_share: bool
    p: float


def days_of(population: Population) -> Array:
    """Return the day of every unit as an ordinal, NaN where none is given."""
    return np.array([x["date"].toordinal() if isinstance(x["date"], date) else np.nan for x in population.units])


def drifts(population: Population) -> list[Drift]:
    """Return what goes with the date, the clearest first."""
    from scipy.stats import spearmanr

    days = days_of(population)
    if np.unique(days[np.isfinite(days)]).size < FEWEST_DAYS:
        return []
    candidates = [*population.features, *_shares(population)]
    tested = []
    for feature in candidates:
        both = np.isfinite(days) & np.isfinite(feature.values)
        x, y = days[both], feature.values[both]
        if both.sum() < FEWEST or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
            continue
        result = spearmanr(x, y)
        tested.append((float(result.pvalue), float(result.statistic), feature, x, y))  # pyright: ignore[reportAttributeAccessIssue]
    found = [t for t in tested if t[0] < CHANCE / max(len(tested), 1)]
    return [_drift(r, feature, x, y) for _, r, feature, x, y in sorted(found, key=lambda t: -abs(t[1]))]


def batches(population: Population) -> list[str]:
    """Return the names of the batches."""
    return sorted({x["batch"] for x in population.units if x["batch"]})


def in_batch(population: Population, name: str) -> NDArray[np.bool_]:
    """Return which units are of a batch and have a result."""
    return np.array([x["batch"] == name and x["status"] == "done" for x in population.units])


def bad_batches(population: Population) -> list[BatchFinding]:
    """Return in what batches differ from the others, the clearest first.

    A batch that was found to differ in something is set aside before the others are compared in it: beside a bad batch,
    good ones would seem to be too good.
    """
    names = batches(population)
    if not 2 <= len(names) <= MOST_BATCHES:
        return []
    own = {name: in_batch(population, name) for name in names}
    own = {name: of for name, of in own.items() if of.sum() >= FEWEST_OF_BATCH}
    shares = [(x, True) for x in _shares(population)]
    compared = [*shares, *((x, False) for x in population.features)]
    chance = CHANCE / max(len(own) * len(compared), 1)
    found: list[BatchFinding] = []
    for feature, is_share in compared:
        left = dict(own)
        while len(left) > 1:
            tested = [x for name in left if (x := _against(name, left, feature, is_share)) is not None]
            first = min(tested, key=lambda x: x.p, default=None)
            if first is None or first.p >= chance:
                break
            found.append(first)
            del left[first.batch]
    return sorted(found, key=lambda x: x.p)


def _against(name: str, own: dict[str, NDArray[np.bool_]], feature: Feature, is_share: bool) -> BatchFinding | None:
    """Return how a batch differs from the others in one number, None where there are too few to compare."""
    from scipy.stats import fisher_exact, mannwhitneyu

    others = np.any([of for other, of in own.items() if other != name], axis=0)
    inside, outside = _finite(feature.values[own[name]]), _finite(feature.values[others])
    if min(inside.size, outside.size) < FEWEST_OF_BATCH:
        return None
    if is_share:
        has = [int(inside.sum()), int(outside.sum())]
        p = float(fisher_exact([has, [inside.size - has[0], outside.size - has[1]]])[1])  # pyright: ignore[reportArgumentType]
        middle = np.mean
    else:
        p, middle = float(mannwhitneyu(inside, outside).pvalue), np.median
    return BatchFinding(
        name, feature.name if is_share else feature.label, feature.unit,
        float(middle(inside)), float(middle(outside)), inside.size, is_share, p,
    )  # fmt: skip


def _shares(population: Population) -> list[Feature]:
    nothing = np.full(len(population.units), np.nan)
    done = np.array([x["status"] == "done" for x in population.units])
    every = {"an alarm": population.has_alarm} if population.has_alarm.any() else {}
    return [
        Feature(name, f"share of units with {name}", "1", np.where(done, has.astype(float), np.nan), nothing)
        for name, has in (every | population.has_effect).items()
    ]


def _drift(correlation: float, feature: Feature, x: Array, y: Array) -> Drift:
    first, last = np.quantile(x, [0.25, 0.75])
    middle = np.mean if set(np.unique(y)) <= {0.0, 1.0} else np.median
    early, late = float(middle(y[x <= first])), float(middle(y[x >= last]))
    return Drift(feature.label, feature.unit, x, y, correlation, early, late)


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]
