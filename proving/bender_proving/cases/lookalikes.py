"""What else, in its simplest form, comes as near to a moved form as its own equation does.

Between an effect and another one that leaves less of it than it is moved by, the record cannot decide: which of the two
is nearer is up to the part that neither has.
"""

from bender_proving.bench import Bench
from bender_proving.cases.case import Case
from bender_proving.cases.residual import left_over_um
from bender_proving.cases.rivals import SIMPLE, mimicked_um
from bender_proving.chain import readings_um


def lookalike(case: Case) -> str:
    """Return an effect that comes within what a form is moved by, "" where none does.

    The first record is asked, without noise and before the form is moved; its own effect leaves nothing of it.

    Raises:
        ValueError: the case is no moved one.
    """
    if case.kind != "moved":
        raise ValueError(f"a case of kind 'moved' is expected, found {case.kind!r}")
    plan = Bench(case).excitation()
    rows = plan.recorded
    reading_um = readings_um(plan.commands, case.effects)[rows]
    within_um = case.moved * left_over_um(reading_um, readings_um(plan.commands)[rows])
    others = (name for name in SIMPLE if name not in case.effect_ids)
    return next((name for name in others if mimicked_um(name, reading_um, plan, within_um) <= within_um), "")
