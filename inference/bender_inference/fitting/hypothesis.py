"""A hypothesis: which effects are missing from a model, and which of the model's own linear numbers are off."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from bender_effects.form import Form, Free, Values
from bender_plant.model import Model


@dataclass(frozen=True, slots=True)
class Part:
    """One effect of a hypothesis: the form it takes and its numbers."""

    form: Form
    values: Values


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """The effects that are taken to be missing; none is the model as given.

    Attributes:
        parts: the effects, in the order of adding.
        own: the model's own linear numbers (frequency, damping, lag, delay) where they are free; None where they are
            as given. They are no effect: what changes is recalibrated.
        structure: a linear model in the place of the one as given; None for that one.
        equation: an equation without a name for what effects and numbers leave; None where there is none.
    """

    parts: tuple[Part, ...] = ()
    own: Part | None = None
    structure: Model | None = None
    equation: Part | None = None

    @property
    def all_parts(self) -> tuple[Part, ...]:
        """The effects, then the equation, then the model's own numbers."""
        return (*self.parts, *(x for x in (self.equation, self.own) if x is not None))

    @property
    def free(self) -> tuple[Free, ...]:
        """All free numbers, those of the effects first."""
        return tuple(free for part in self.all_parts for free in part.form.free)

    @property
    def effects(self) -> tuple[str, ...]:
        """The ids of the effects, in the order of adding."""
        return tuple(part.form.effect for part in self.parts)

    @property
    def free_count(self) -> int:
        """How many free numbers there are, the model's own included."""
        return sum(len(part.values) for part in self.all_parts)

    def values(self) -> Values:
        """All free numbers, one effect after the other, the model's own at the end."""
        return tuple(x for part in self.all_parts for x in part.values)

    def with_values(self, values: Sequence[float]) -> "Hypothesis":
        """Return the same effects with other numbers."""
        parts, begin = [], 0
        for part in self.all_parts:
            end = begin + len(part.values)
            parts.append(Part(part.form, tuple(float(x) for x in values[begin:end])))
            begin = end
        own = parts.pop() if self.own is not None else None
        equation = parts.pop() if self.equation is not None else None
        return replace(self, parts=tuple(parts), own=own, equation=equation)

    def plus(self, form: Form, values: Values) -> "Hypothesis":
        """Return the hypothesis with one effect more."""
        return replace(self, parts=(*self.parts, Part(form, values)))

    def minus(self, index: int) -> "Hypothesis":
        """Return the hypothesis without one of its effects."""
        return replace(self, parts=self.parts[:index] + self.parts[index + 1 :])

    def freeing(self, form: Form, values: Values) -> "Hypothesis":
        """Return the hypothesis with the model's own linear numbers free beside the effects."""
        return replace(self, own=Part(form, values))

    def model(self, base: Model, record: int = 0) -> Model:
        """Return the base model with the effects in it, with the surroundings of one record.

        Raises:
            ModelError: a number is out of its bounds.
        """
        base = self.linear(base)
        for part in (*(() if self.own is None else (self.own,)), *self.parts, *self._equations):
            base = part.form.apply(base, part.form.of_record(part.values, record))
        return base

    def linear(self, base: Model) -> Model:
        """Return its linear structure; the model as given where it has none of its own."""
        return self.structure or base

    @property
    def _equations(self) -> tuple[Part, ...]:
        return () if self.equation is None else (self.equation,)

    def alone(self, record: int = 0) -> "Hypothesis":
        """Return the hypothesis for one record by itself."""
        parts = tuple(Part(x.form.alone(), x.form.of_record(x.values, record)) for x in self.parts)
        return replace(self, parts=parts)

    def around(self, model: Model, record: int) -> Model:
        """Return a model that has the effects with the surroundings of another record in it."""
        for part in self.parts:
            if part.form.records > 1:
                model = part.form.apply(model, part.form.of_record(part.values, record))
        return model

    def keeps_shown_of(self, other: "Hypothesis") -> bool:
        """Return whether every effect of another hypothesis that a witness shows is in this one as well."""
        return all(x.form.effect in self.effects for x in other.parts if x.form.shown)

    @property
    def has_surroundings(self) -> bool:
        """Whether records differ in some of its numbers."""
        return any(part.form.records > 1 for part in self.parts)
