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
    structure = Structure(modes=0 if rig.mode is None else 1)
    gain = rig.gain * factor(rig.reading[1], units[1]) / factor(rig.drive[1], units[0])
    model = structure.model(rig.mode or (), gain, 0.0, rig.name)
    # the authors' first lag is that of the drive: what lags behind it is missing on the side of the sensor
    for block, tau in zip(("source_resistance", "sensor_lag"), rig.lags_s, strict=False):
        model = model.with_block(block, time_constant_s=tau)
    return model
