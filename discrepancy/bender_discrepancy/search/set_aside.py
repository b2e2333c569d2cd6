"""Readings set aside by what a hypothesis leaves, and everything counted anew without them."""

from dataclasses import replace

import numpy as np

from bender_discrepancy.fitting.hypothesis import Bench
from bender_discrepancy.fitting.output_error import Fitted, fit, recounted
from bender_discrepancy.records.outliers import outlying
from bender_discrepancy.search.state import Found, noise_of

# turns in which readings are set aside: without some the noise is smaller, and others stand out
MOST_SETTLINGS = 3


def set_outlying_aside(bench: Bench, fitted: Fitted, noise_um: float) -> int:
    """Set isolated readings aside in every record, and take others back; returns how many changed."""
    changed = 0
    kept = []
    for r, x in zip(fitted.residuals, bench.observations, strict=True):
        whole = replace(x, usable=np.isfinite(x.measured_um))
        after = whole.without(outlying(whole, r, noise_um))
        changed += int(np.count_nonzero(after.usable != x.usable))
        kept.append(after)
    bench.observations = tuple(kept)
    return changed


def settled(bench: Bench, found: Found) -> Found:
    """Set outlying readings aside by what the best hypothesis leaves, and count everything anew without them."""
    best = found.best
    for _ in range(MOST_SETTLINGS):
        changed = set_outlying_aside(bench, best, found.noise_um)
        if changed:
            best = fit(bench, best.hypothesis) or best
        found.noise_um = min(found.noise_um, noise_of(best, bench))
        if not changed:
            break
    best = recounted(best, bench)
    steps = [*(recounted(x, bench) for x in found.steps[:-1]), best]
    return replace(found, base=recounted(found.base, bench), best=best, steps=steps)


def cleared(bench: Bench, found: Found, tried: list[Fitted], leader: Fitted) -> tuple[Found, list[Fitted], Fitted]:
    """Set readings aside by what the leader leaves, and count everything without them.

    What is misread, and how large the noise is, show best where least structure is left; every estimate of the noise
    errs upwards where some is.
    """
    if set_outlying_aside(bench, leader, found.noise_um):
        again = fit(bench, leader.hypothesis) or leader
        tried = [again if x is leader else recounted(x, bench) for x in tried]
        leader = again
        base, best = recounted(found.base, bench), recounted(found.best, bench)
        found = replace(found, base=base, best=best, steps=[*(recounted(x, bench) for x in found.steps[:-1]), best])
    found.noise_um = min(found.noise_um, noise_of(leader, bench))
    return found, tried, leader
