"""How much is computed, in one place: nothing here decides what is said, only how long a search may look for it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Budget:
    """Limits of a search.

    Attributes:
        beam: hypotheses that another effect is tried on.
        wide: hypotheses outside the beam that a quickly scanned effect is tried on, where a step leaves structure.
        patience: steps in turn that bring nothing.
        rough_first, rough_later: effects that are fitted roughly, on the model as given and on one with an effect.
        fitted_first, fitted_later: of these, effects that are fitted to the end.
        starts: of one effect and kind.
        valleys: starts of one form, in different valleys of the misfit where it has them.
        forms: of one effect that are fitted to the end, of few numbers.
        few_numbers: of an effect; one with more is flexible.
        rough_evaluations: of a rough fit.
        first_evaluations: of a fit from a known hypothesis, before it is fitted to the end.
        readings_per_number: a form with more free numbers than readings allow is not tried.
        nearly_done: times the noise; what leaves so little is not looked at for other valleys and forms.
        hopeless: times the least square so far; a fit does not make up for that after its start.
        far: times the least square so far; a further effect of few numbers does not make up for that.
        enough: part of the square that a step may leave; one that takes off more is made on the leader alone.
        behind: times the least square so far; one that is left further behind by a rough fit is not fitted to the end.
        flexible: part of what the simple forms leave, by which a flexible one must promise less.
        finalists: hypotheses that are fitted again without the ends of the records.
        leaders: such hypotheses of other forms, where the best one is worse there than no effect at all.
        turns: rounds in which effects are replaced by better ones.
        work_substeps: simulated in a search, and more for every row, before a step is not begun any more; as much
            again for every effect that was found.
        work_per_row: the latter.
        most_work_substeps: for any number of rows.
    """

    beam: int = 3
    wide: int = 12
    patience: int = 1
    rough_first: int = 14
    rough_later: int = 8
    fitted_first: int = 8
    fitted_later: int = 4
    starts: int = 3
    valleys: int = 2
    forms: int = 2
    few_numbers: int = 4
    rough_evaluations: int = 4
    first_evaluations: int = 6
    readings_per_number: int = 4
    nearly_done: float = 1.2
    hopeless: float = 10.0
    far: float = 100.0
    enough: float = 0.25
    behind: float = 4.0
    flexible: float = 0.05
    finalists: int = 5
    leaders: int = 20
    turns: int = 2
    work_substeps: float = 5e7
    work_per_row: float = 3e4
    most_work_substeps: float = 2e8

    def work_for(self, rows: int, effects: int) -> float:
        """Return how many sub-steps a search in so many rows may simulate, once it has found so many effects."""
        return (1 + effects) * min(self.work_substeps + self.work_per_row * rows, self.most_work_substeps)


BUDGET = Budget()
CORE_S_PER_SUBSTEP = 2e-7
"""What a simulated sub-step takes of one idle core, about, with what is fitted to it."""
