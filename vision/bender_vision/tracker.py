"""From a picture to the displacement of the tip in micrometres."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import RunError
from bender_vision.extreme import extreme_point
from bender_vision.fine import measure_wire
from bender_vision.rough import find_wire
from bender_vision.scale import Calibration
from bender_vision.settings import LINE, TrackerSettings
from bender_vision.strip import edge_darkness
from bender_vision.tip import Sighting, Tip, TipLostError, lost_tip

_LEAST_SHARE_FOUND = 0.5
_DOUBTFUL_SPREAD_PX = 0.15
# Against the wire at rest. Motion makes it fainter but not thicker, as long as it moves less than its own width; a
# frame torn within the wire makes it thicker or thinner by twice the error.
_OFF_WIDTHS, _OFF_PX = 0.08, 0.8
_FAINTEST, _DARKEST = 0.5, 1.25
_LEAST_TAKEN = 0.97
"""Of the light that it takes at rest: a wire that jumps while the shutter is open shows twice."""
_SOFTER = 1.06
"""Edges this much wider than at rest are those of a wire that moved, two pixels or more, while the shutter was open."""


@dataclass(frozen=True, slots=True)
class Rest:
    """The wire at rest, in micrometres and in the picture's own directions.

    Attributes:
        place_um: of the tip, x and y.
        along: unit vector along the wire.
        normal: unit vector across it, the way of growing pixel numbers.
        width_px, depth: of the wire; 0 where the method does not measure them.
        softness: of its edges, px; nan where the method does not measure it.
        centre_px: how far the mean of its edges over all levels lies beside that at half its darkness.
        taken: how much of the light it takes away, px; nan where the method does not measure it.
    """

    place_um: tuple[float, float]
    along: tuple[float, float]
    normal: tuple[float, float]
    width_px: float
    depth: float
    softness: float
    centre_px: float
    taken: float


class Tracker:
    """Finds the tip in one picture after another; each is judged by itself and against the wire at rest.

    Args:
        settings: what the picture shows.
        calibration: what its pixels are worth.
    """

    def __init__(self, settings: TrackerSettings, calibration: Calibration) -> None:
        self.settings = settings
        self.calibration = calibration
        self.rest: Rest | None = None
        self._width_px = settings.wire_um / calibration.um_per_px

    def zero(self, images: Iterable[NDArray[np.uint8]]) -> None:
        """Take the rest position: the medians over pictures of the wire at rest.

        Raises:
            RunError: the tip was found in fewer than half of the pictures.
        """
        self.rest = None
        sightings: list[Sighting] = []
        reasons: list[str] = []
        for image in images:
            try:
                sightings.append(self._sight(image))
            except TipLostError as reason:
                reasons.append(str(reason))
        if not sightings or len(sightings) < _LEAST_SHARE_FOUND * (len(sightings) + len(reasons)):
            why = max(set(reasons), key=reasons.count) if reasons else "there was no picture"
            total = len(sightings) + len(reasons)
            raise RunError(
                f"rest position: the tip was found in {len(sightings)} of {total} pictures ({why});"
                " check focus, light and where the wire enters"
            )
        self.rest = self._rest_of(sightings)

    def locate(self, image: NDArray[np.uint8]) -> Tip:
        """Find the tip in a picture, (height, width), uint8; never raises for what the picture shows."""
        try:
            sighting = self._sight(image)
            confidence = self._confidence(sighting)
            displacement_um = self._displacement_um(sighting)
        except TipLostError as reason:
            return lost_tip(str(reason))
        return Tip(sighting.x, sighting.y, displacement_um, confidence)

    def in_frame(self, along_px: float, across_px: float) -> tuple[float, float]:
        """Return column and row in the frame of a place that is counted from the border where the wire enters."""
        width_px, height_px = self.calibration.width_px, self.calibration.height_px
        match self.settings.enters_from:
            case "right":
                return width_px - 1 - along_px, across_px
            case "top":
                return across_px, along_px
            case "bottom":
                return across_px, height_px - 1 - along_px
            case _:
                return along_px, across_px

    def _sight(self, image: NDArray[np.uint8]) -> Sighting:
        expected = (self.calibration.height_px, self.calibration.width_px)
        if image.shape != expected:
            found = " x ".join(str(size) for size in image.shape[::-1])
            raise TipLostError(f"the picture has {found} pixels, the calibration {expected[1]} x {expected[0]}")
        picture = self._turned(image)
        if self.settings.method != LINE:
            x, y = extreme_point(picture, self._width_px, self.settings)
            return Sighting(x, y, 0.0, 0.0, 0.0, 0.0, 1.0)
        rough = find_wire(picture, self._width_px, self.settings)
        sighting = measure_wire(picture, rough, self._width_px, self.settings.fit_widths)
        self._refuse_what_is_no_wire(sighting, picture.shape)
        _refuse_what_has_slipped(picture, rough.entry_y, sighting)
        return sighting

    def _turned(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture with the wire dark and entering from the left."""
        border = self.settings.enters_from
        picture = image.T if border in ("top", "bottom") else image
        if border in ("right", "bottom"):
            picture = picture[:, ::-1]
        if self.settings.bright:
            picture = 255 - picture
        return np.ascontiguousarray(picture)

    def _to_um(self, x: float, y: float) -> tuple[float, float]:
        """Micrometres, in the picture's own directions, of a place in the turned picture."""
        border = self.settings.enters_from
        if border == "right":
            x = self.calibration.width_px - 1 - x
        elif border == "bottom":
            x = self.calibration.height_px - 1 - x
        return self.calibration.to_um(*((y, x) if border in ("top", "bottom") else (x, y)))

    def _refuse_what_is_no_wire(self, sighting: Sighting, shape: tuple[int, ...]) -> None:
        settings = self.settings
        if sighting.depth < settings.least_contrast:
            raise TipLostError("the wire has too little contrast")
        if not 0.6 * self._width_px <= sighting.width <= 1.7 * self._width_px:
            raise TipLostError("what enters is not as thick as the wire")
        margin = settings.margin_um / self.calibration.um_per_px
        inside = margin <= sighting.y <= shape[0] - 1 - margin and sighting.x <= shape[1] - 1 - margin
        if not inside:
            raise TipLostError("the tip is out of view")

    def _confidence(self, sighting: Sighting) -> float:
        confidence = sighting.share / (1.0 + (sighting.spread / _DOUBTFUL_SPREAD_PX) ** 2)
        if confidence < self.settings.least_confidence:
            raise TipLostError("the wire is not clear enough")
        return float(min(1.0, confidence))

    def _rest_of(self, sightings: list[Sighting]) -> Rest:
        step_px = self._width_px
        places = np.array([self._to_um(one.x, one.y) for one in sightings])
        behind = np.array([self._to_um(one.x - step_px, one.y - step_px * one.slope) for one in sightings])
        place, direction = np.median(places, axis=0), np.median(places - behind, axis=0)
        direction /= math.hypot(*direction)
        along = float(direction[0]), float(direction[1])
        return Rest(
            (float(place[0]), float(place[1])),
            along,
            _normal(along, self.settings.enters_from),
            float(np.median([one.width for one in sightings])),
            float(np.median([one.depth for one in sightings])),
            float(np.median([one.softness for one in sightings])),
            float(np.median([one.centre_y - one.y for one in sightings])),
            float(np.median([one.taken for one in sightings])),
        )

    def _displacement_um(self, sighting: Sighting) -> float:
        rest = self.rest
        if rest is None:
            return math.nan
        x_um, y_um = self._to_um(sighting.x, _mean_y(sighting, rest))
        moved = (x_um - rest.place_um[0], y_um - rest.place_um[1])
        if self.settings.method == LINE:
            self._refuse_what_differs_from_rest(sighting, rest, moved)
        return self.settings.sign * (moved[0] * rest.normal[0] + moved[1] * rest.normal[1])

    def _refuse_what_differs_from_rest(self, sighting: Sighting, rest: Rest, moved: tuple[float, float]) -> None:
        along_um = moved[0] * rest.along[0] + moved[1] * rest.along[1]
        if abs(along_um) > self.settings.end_tolerance_um:
            raise TipLostError("the end of the wire is not where it was")
        if abs(sighting.width - rest.width_px) > min(_OFF_PX, _OFF_WIDTHS * rest.width_px):
            raise TipLostError("the wire is not as thick as it was")
        if not _FAINTEST <= sighting.depth / rest.depth <= _DARKEST:
            raise TipLostError("the wire is not as dark as it was")
        if sighting.taken < _LEAST_TAKEN * rest.taken:
            raise TipLostError("a part of the wire is elsewhere")


def _mean_y(sighting: Sighting, rest: Rest) -> float:
    """Where the wire's end was on the average of the exposure.

    The middle between the edges is where the wire was for half of the time: of a tip that comes to rest within the
    exposure not its mean. The mean over levels is, but what lies beside the wire moves it more: it counts where the
    edges are softer than at rest, and elsewhere the two are the same.
    """
    if sighting.softness > _SOFTER * rest.softness and math.isfinite(sighting.centre_y - rest.centre_px):
        return sighting.centre_y - rest.centre_px
    return sighting.y


def _refuse_what_has_slipped(picture: NDArray[np.uint8], entry_y: float, sighting: Sighting) -> None:
    """Where bytes of a line were lost, the first columns stand at the far border and the wire begins too late."""
    near, far = (edge_darkness(picture, column, entry_y, sighting.width) for column in (0, -1))
    if near < 0.5 * sighting.depth or far > 0.5 * sighting.depth:
        raise TipLostError("the lines of the picture have slipped")


def _normal(along: tuple[float, float], border: str) -> tuple[float, float]:
    """The unit vector across the wire that points the way of growing pixel numbers."""
    across = (-along[1], along[0])
    grows = across[0] if border in ("top", "bottom") else across[1]
    return across if grows > 0.0 else (-across[0], -across[1])
