"""How an identification is done, checked when made."""

from dataclasses import dataclass
from typing import Literal

from bender_plant.blocks.sparse_equation import powers_of

LIBRARIES: dict[str, tuple[str, ...]] = {
    "paper": ("w", "u", "u'", "|w|", "w |w|"),
    "bouc_wen": ("u'", "w |u'|", "|w| u'"),
    "combined": (
        "w", "u", "|w|", "w |w|", "u^2", "u'", "u u'", "u^2 u'", "w u'", "w |u'|", "|w| u'", "u |u'|",
    ),
    "polynomial": (
        "w", "u", "w^2", "w u", "u^2", "w^3", "w^2 u", "w u^2", "u^3",
        "u'", "w u'", "u u'", "w^2 u'", "w u u'", "u^2 u'",
    ),
}  # fmt: skip
"""Candidate terms by the name of their library.

`paper`: the structure of equation (30). `bouc_wen`: equation (20) with the factor |w| that its last term lacks.
`combined`: both, with an asymmetry in u, a feedthrough that depends on u or w, and the Duhem term u |u'|.
`polynomial`: all products of w and u up to the third degree, with and without the voltage rate.
"""

AUTOMATIC = ("bouc_wen", "paper", "combined")
"""The libraries that `auto` tries, smallest first."""

KEEP = ("auto", "sindy", "prandtl_ishlinskii", "bouc_wen", "first_order_lag")
THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Below one of them a coefficient is dropped, with w, u and time scaled to unit size."""

InputHold = Literal["hold", "linear", "smooth"]

COMPANIONS = {"report": "-report.html", "loops": "-loops.png", "figures": "-figures.json"}
"""What is written beside a model file, by what follows the model's name."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of an identification.

    Attributes:
        library: `auto` or a key of `LIBRARIES`.
        terms: candidate terms instead of a library, as the block `sparse_equation` writes them.
        ensemble: bootstrap resamples for the inclusion probabilities, 0 for none.
        held_out_share: the part at the end of a single record that no fit sees.
        set_aside_s: time at the start that is neither fitted nor scored; None: the first cycle where the record
            does not start at 0 V, a tenth of a record without cycles that starts in motion, else nothing.
        delay_s: transport delay between command and reading; None looks for it.
        keep: which model is written; `auto` is the learned equation unless an operator is clearly better.

    Raises:
        ValueError: naming the field, what was found and what was expected.
    """

    library: str = "auto"
    terms: tuple[str, ...] = ()
    ensemble: int = 50
    held_out_share: float = 0.4
    set_aside_s: float | None = None
    delay_s: float | None = 0.0
    keep: str = "auto"

    def __post_init__(self) -> None:
        _one_of("library", self.library, ("auto", *LIBRARIES))
        _one_of("keep", self.keep, KEEP)
        _within("ensemble", self.ensemble, 0, 10_000)
        _within("held_out_share", self.held_out_share, 0.05, 0.9)
        _within("set_aside_s", self.set_aside_s, 0.0, float("inf"))
        _within("delay_s", self.delay_s, 0.0, 10.0)
        for term in self.terms:
            powers_of(term)
        if len(set(map(powers_of, self.terms))) != len(self.terms):
            raise ValueError(f"terms: found {self.terms}, expected each term once")

    def libraries(self) -> dict[str, tuple[str, ...]]:
        """The libraries to try, by name."""
        if self.terms:
            return {"own": self.terms}
        names = AUTOMATIC if self.library == "auto" else (self.library,)
        return {name: LIBRARIES[name] for name in names}


def _one_of(field: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ValueError(f"{field}: found {value!r}, expected one of {', '.join(allowed)}")


def _within(field: str, value: float | None, low: float, high: float) -> None:
    if value is not None and not low <= value <= high:
        raise ValueError(f"{field}: found {value!r}, expected {low:g} to {high:g}")
