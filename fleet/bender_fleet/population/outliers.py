"""Units that stand out, by robust distance, and why.

Each number is centred by its median and scaled by the median absolute deviation; of a unit, the squares are summed.
Under a normal population the sum follows chi-squared with as many degrees as the unit has numbers. The tail is
corrected for the number of units (Bonferroni), so that a fleet without outliers names one in a hundred fleets.
"""

from dataclasses import dataclass

import numpy as np

from bender_fleet.population.features import Array, Feature, Population

FEWEST, CHANCE, MOST_REASONS = 10, 0.01, 3
MAD_TO_STD = 1.4826
RARE_SHARE, RARE_FLEET = 0.01, 100


@dataclass(frozen=True, slots=True)
class Outlier:
    """A unit that stands out.

    Attributes:
        unit: its name.
        distance: robust distance, in standard deviations of a population without outliers.
        reasons: the numbers that lie farthest off.
    """

    unit: str
    distance: float
    reasons: tuple[str, ...]


def distances(population: Population) -> tuple[Array, Array, list[Feature]]:
    """Return distances (n,), NaN for units without numbers, the deviations (n, m), and the features of the columns."""
    kept, columns = [], []
    for feature in population.features:
        scaled = _deviations(feature)
        if scaled is not None:
            kept.append(feature)
            columns.append(scaled)
    if not columns:
        return np.full(len(population.units), np.nan), np.empty((len(population.units), 0)), []
    table = np.stack(columns, axis=1)
    squares = np.nansum(table**2, axis=1)
    counted = np.isfinite(table).any(axis=1)
    return np.where(counted, np.sqrt(squares), np.nan), table, kept


def outliers(population: Population) -> list[Outlier]:
    """Return the units that stand out, the farthest first."""
    from scipy.stats import chi2

    far, table, features = distances(population)
    if not features:
        return []
    degrees = np.isfinite(table).sum(axis=1)
    tail = chi2.sf(np.nan_to_num(far) ** 2, np.maximum(degrees, 1))
    chosen = np.flatnonzero(np.isfinite(far) & (tail < CHANCE / max(len(population.units), 1))).tolist()
    found = [Outlier(population.units[k]["unit"], float(far[k]), _reasons(table[k], features, k)) for k in chosen]
    named = {x.unit for x in found}
    found += [x for x in _with_rare_effects(population, far) if x.unit not in named]
    return sorted(found, key=lambda x: -x.distance)


def _deviations(feature: Feature) -> Array | None:
    values = feature.comparable
    seen = values[np.isfinite(values)]
    if seen.size < FEWEST:
        return None
    middle = np.median(seen)
    spread = MAD_TO_STD * np.median(np.abs(seen - middle))
    return (values - middle) / spread if spread > 1e-9 * max(abs(middle), 1e-12) else None


def _reasons(deviations: Array, features: list[Feature], unit: int) -> tuple[str, ...]:
    from bender_report.wording import quantity

    order = np.argsort(-np.abs(np.nan_to_num(deviations)))[:MOST_REASONS]
    return tuple(
        f"{features[k].label} {quantity(float(features[k].values[unit]), features[k].unit)}, usually "
        f"{quantity(float(np.median(features[k].seen)), features[k].unit)}"
        for k in order
        if abs(np.nan_to_num(deviations[k])) > 3.0
    )


def _with_rare_effects(population: Population, far: Array) -> list[Outlier]:
    if len(population.units) < RARE_FLEET:
        return []
    found: dict[int, list[str]] = {}
    for name, has in population.has_effect.items():
        count = int(has.sum())
        if count <= RARE_SHARE * len(population.units):
            for k in np.flatnonzero(has):
                found.setdefault(int(k), []).append(f"{name}, which {count} of {len(population.units)} units have")
    return [Outlier(population.units[k]["unit"], float(far[k]), tuple(why)) for k, why in found.items()]
