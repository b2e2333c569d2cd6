"""A record of a hidden bench whose camera is exposed for some time: every reading is the mean over an exposure."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bender_loop.records.record import Record
    from bender_proving import Case

Array = NDArray[np.float64]

EXPOSURES_S = (0.002, 0.02)
"""A frame has to be read out and answered before the next exposure begins."""
INSTANTS = 240
"""At so many instants within an exposure the tip is simulated: the mean over two periods is true to 1e-4 of a swing."""


def exposed_record(case: "Case", exposure_s: float) -> "Record":
    """Return a case's own record with readings that are means over an exposure, read without a picture.

    A command that answers a reading acts after the shutter has closed.
    """
    from bender_loop.records.record import Record
    from bender_proving import NOISE_UM, Bench

    bench = Bench(case)
    plan = bench.excitation()
    played, rows = plan.commands, plan.recorded
    acting_s = played.act_s + 0.5 * exposure_s
    seen_um = _exposed_um(case, played.read_s, exposure_s, acting_s, played.voltage_V).mean(axis=1)[rows]
    noise_um = case.gain * NOISE_UM[case.sensor] * bench.noise().standard_normal(seen_um.size)
    return Record(
        plan.time_s[rows],
        plan.voltage_V[rows],
        seen_um + noise_um,
        command_time_s=acting_s[rows],
        exposure_s=np.full_like(seen_um, exposure_s),
    )


def _exposed_um(case: "Case", middle_s: Array, exposure_s: float, acting_s: Array, voltage_V: Array) -> Array:
    """Return where the tip is while the shutter is open, (n, 240): equal parts of every exposure."""
    from bender_proving.chain import Commands, readings_um

    parts = (np.arange(INSTANTS) + 0.5) / INSTANTS - 0.5
    instants_s = (middle_s[:, None] + exposure_s * parts).ravel()
    tip_um = readings_um(Commands(instants_s, acting_s, voltage_V), case.effects).reshape(-1, INSTANTS)
    return case.gain * tip_um + case.offset_um
