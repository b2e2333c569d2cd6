"""The linear model that is given with a rig."""

from typing import TYPE_CHECKING

from bender_identify.first_model.structures import Structure
from bender_loop.tables.quantities import factor
from bender_plant.model import Model

if TYPE_CHECKING:
    from bender_proving.gallery import PublishedRig


def nominal(rig: "PublishedRig", units: tuple[str, str]) -> Model:
    """Return a gain with the lags and the mode that the rig's authors give.

    Args:
        rig: of the gallery.
        units: of inputs and readings, in which its record is kept.
    """
    structure = Structure(lags=len(rig.lags_s), modes=0 if rig.mode is None else 1)
    gain = rig.gain * factor(rig.reading[1], units[1]) / factor(rig.drive[1], units[0])
    return structure.model((*rig.lags_s, *(rig.mode or ())), gain, 0.0, rig.name)
