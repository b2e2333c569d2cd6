"""What a look at a picture yields, and the failure that has a reason."""

import math
from dataclasses import dataclass


class TipLostError(Exception):
    """The tip cannot be said; the message is the reason, a few words."""


@dataclass(frozen=True, slots=True)
class Tip:
    """Where the tip is, or why that cannot be said.

    Attributes:
        along_px: from the border at which the wire enters, in pixels; nan when lost.
        across_px: row (wire from the left or right) or column (from the top or bottom) of the tip; nan when lost.
        displacement_um: across the wire's direction at rest, from its place at rest; nan when lost or not yet zeroed.
        confidence: 0 (lost) to 1.
        lost: None, or why nothing is said.
    """

    along_px: float
    across_px: float
    displacement_um: float
    confidence: float
    lost: str | None = None


def lost_tip(reason: str) -> Tip:
    """A tip that was not found."""
    return Tip(float("nan"), float("nan"), float("nan"), 0.0, reason)


@dataclass(frozen=True, slots=True)
class Sighting:
    """The wire in one picture, turned so that it enters from the left; all in pixels of that picture.

    Attributes:
        x, y: of the middle of the wire's end.
        slope: of the wire there.
        width: of the wire at its end, between the half heights of its edges.
        depth: how much darker than its surroundings, as a fraction.
        spread: standard deviation that the fit leaves to y.
        share: part of the wire looked at that agrees with the line.
        softness: how wide the edges are, both together; nan where that cannot be said.
        centre_y: like y, but of a wire that moved its mean over the exposure; nan where that cannot be said.
        taken: how much of the light the wire takes away, px of full darkness; nan where that cannot be said.
    """

    x: float
    y: float
    slope: float
    width: float
    depth: float
    spread: float
    share: float
    softness: float = math.nan
    centre_y: float = math.nan
    taken: float = math.nan
