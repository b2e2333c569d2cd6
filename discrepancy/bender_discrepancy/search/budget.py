"""How much is computed, in one place: nothing here decides what is said, only how long a search may look for it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Budget:
    """Limits of a search.

    Attributes:
        effects: at most so many effects in one hypothesis.
        beam: hypotheses that another effect is tried on.
        replaced, replaced_near: turns in which effects are replaced by better ones, and those where little is left.
        rough_first, rough_later: effects that are fitted roughly, on the model as given and on one with an effect.
        fitted_first, fitted_later: of these, effects that are fitted to the end.
        starts: of one effect and kind.
        valleys: starts of one form, in different valleys of the misfit where it has them.
        forms, flexible_forms: of one effect that are fitted to the end, of few numbers and of many.
        rough_evaluations: of a rough fit.
        readings_per_number: a form with more free numbers than readings allow is not tried.
        nearly_done: times the noise; where a hypothesis leaves so little, others that leave far more stay rough.
        hopeless: times the least square so far; a fit does not make up for that after its start.
        behind: times the least square so far; one that is left further behind by a rough fit is not fitted to the end.
        flexible: the same for a start or rough fit of a far more flexible hypothesis than that one.
        own_tried: leaders beside which, and beside the best of the simplest, the model's own linear numbers are freed.
        certified: evaluations of a fit that looks at an effect again with another one taken out.
        work_substeps: simulated in a search, and more for every row: a step that would go beyond is not begun.
            A million take some 0.2 s of one core. Few rows tell of few effects, so they are not searched for long.
        work_per_row: the latter.
        most_work_substeps: for any number of rows. A camera record of 170 s needs less for five effects.
        per_effect: times the same work besides, for every effect found, where they remove most of the gap.
        work_growth: a step on one model costs about so many times what came before it: two models, and a revision.
        together: times the same work besides, for several more effects at once where structure is left.
        near: times the noise, which is little; where several more effects leave more, they are not looked at any
            further.
    """

    effects: int = 5
    beam: int = 3
    replaced: int = 2
    replaced_near: int = 4
    rough_first: int = 14
    rough_later: int = 8
    fitted_first: int = 8
    fitted_later: int = 4
    starts: int = 3
    valleys: int = 2
    forms: int = 2
    flexible_forms: int = 1
    rough_evaluations: int = 4
    readings_per_number: int = 4
    nearly_done: float = 1.2
    hopeless: float = 10.0
    behind: float = 4.0
    flexible: float = 1.3
    own_tried: int = 2
    certified: int = 6
    work_substeps: float = 5e7
    work_per_row: float = 1.8e5
    most_work_substeps: float = 8e8
    per_effect: float = 0.5
    work_growth: float = 0.5
    together: float = 2.0
    near: float = 3.0

    def work_for(self, rows: int) -> float:
        """Return how many sub-steps a search in so many rows may simulate."""
        return min(self.work_substeps + self.work_per_row * rows, self.most_work_substeps)


BUDGET = Budget()
