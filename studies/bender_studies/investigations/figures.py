"""The counts of many investigations."""

from collections.abc import Sequence
from statistics import median

from bender_studies.investigations.trial import InvestigationTrial

COLUMNS = ("hidden", "benches", "right", "median bench s", "longest", "beyond a limit", "errors")


def rows(found: Sequence[InvestigationTrial]) -> list[tuple[str, int, str, str, str, int, int]]:
    """Return a row for each kind of bench, and one for all."""
    kinds = list(dict.fromkeys(x.kind for x in found))
    return [_row(kind, [x for x in found if x.kind == kind]) for kind in kinds] + [_row("all", found)]


def _row(name: str, some: Sequence[InvestigationTrial]) -> tuple[str, int, str, str, str, int, int]:
    times = [x.bench_s for x in some if not x.error]
    return (
        name,
        len(some),
        f"{sum(x.is_right for x in some)} of {len(some)}",
        f"{median(times):.0f}" if times else "-",
        f"{max(times):.0f}" if times else "-",
        sum(bool(x.beyond) for x in some),
        sum(bool(x.error) for x in some),
    )


def sentences(found: Sequence[InvestigationTrial]) -> list[str]:
    """Return what the bench said of new gains, and every bench that came out wrong."""
    matters = [x for x in found if x.matters]
    praised = sum(x.judgement == "better" for x in matters)
    lines = [
        f"new gains that save more than 5 % on the bench without noise: {len(matters)} benches, shown to be better "
        f"on {praised} of them",
        f"called better without being it: {sum(x.is_false_praise for x in found)} of "
        f"{sum(x.judgement == 'better' for x in found)}",
    ]
    for x in found:
        if not x.is_right or x.error:
            said = x.error or f"{x.verdict} ({', '.join(x.effects) or 'no effect'}), ended by {x.ended}"
            lines.append(f"{x.id}: {' + '.join(x.truth) or x.kind} on the {x.sensor}: {said}")
    return lines
