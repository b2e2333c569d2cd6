"""How the tip is looked for."""

from dataclasses import dataclass

from bender_loop.bounds import check_numbers

LINE, EXTREME = "line", "extreme"
METHODS = (LINE, EXTREME)
BORDERS = ("left", "right", "top", "bottom")
POSITIVE_WAYS = {"left": ("down", "up"), "right": ("down", "up"), "top": ("right", "left"), "bottom": ("right", "left")}

_BOUNDS = {
    "wire_um": (0.01, 1e5),
    "fit_widths": (3.0, 200.0),
    "least_contrast": (0.01, 0.99),
    "least_confidence": (0.01, 0.99),
    "end_tolerance_um": (0.01, 1e5),
    "margin_um": (0.01, 1e5),
}


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """What the picture shows and when its reading is believed.

    Attributes:
        method: line (edges along the wire, a line through their middle, its end) or extreme (the paper's: the
            farthest point of the largest contour, which moves in whole pixels and is believed whenever it exists).
        enters_from: the border of the picture at which the wire enters: left, right, top or bottom.
        positive: the way in the picture that a positive displacement goes: down or up for a wire from the left or the
            right, right or left for one from the top or the bottom; "" stands for the first of the two.
        bright: whether the wire is brighter than what is behind it.
        wire_um: diameter of the wire; what is much thicker or thinner is not the wire.
        fit_widths: length of wire, in diameters, through which the line is fitted.
        least_contrast: of the wire against what is behind it, as a fraction.
        least_confidence: below it the tip is declared lost.
        end_tolerance_um: how far along the wire its end may seem to move from its place at rest.
        margin_um: how near to the border of the picture the tip is no longer believed.
    """

    method: str = LINE
    enters_from: str = "left"
    positive: str = ""
    bright: bool = False
    wire_um: float = 15.0
    fit_widths: float = 12.0
    least_contrast: float = 0.12
    least_confidence: float = 0.5
    end_tolerance_um: float = 4.0
    margin_um: float = 12.0

    def __post_init__(self) -> None:
        for name, allowed in (("method", METHODS), ("enters_from", BORDERS)):
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name}: found {getattr(self, name)!r}, expected one of {', '.join(allowed)}")
        ways = POSITIVE_WAYS[self.enters_from]
        if self.positive not in ("", *ways):
            expected = f"{' or '.join(ways)} for a wire from the {self.enters_from}"
            raise ValueError(f"positive: found {self.positive!r}, expected {expected}")
        if not isinstance(self.bright, bool):
            raise ValueError(f"bright: found {self.bright!r}, expected true or false")
        check_numbers(self, _BOUNDS)

    @property
    def sign(self) -> float:
        """1 where a positive displacement goes the way of growing pixel numbers, else -1."""
        return -1.0 if self.positive == POSITIVE_WAYS[self.enters_from][1] else 1.0
