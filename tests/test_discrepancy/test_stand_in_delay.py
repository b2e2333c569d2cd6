"""The stand-in of an FMU has the delays that the FMU has, and none of the grain that it is fitted to."""

from types import SimpleNamespace

import numpy as np
import pytest

from bender_discrepancy.foreign.surrogate import _of_real_delays
from bender_identify.first_model.structures import Structure
from bender_loop.records.record import Record


@pytest.mark.parametrize(("delay_s", "kept"), [(0.05, False), (0.49, False), (0.51, True), (40.0, True)])
def test_a_delay_of_a_small_part_of_a_row_is_none(delay_s: float, kept: bool) -> None:
    """An oven read every 5 s: with 0.05 s in its stand-in, a missing delay of 40 s could not be added any more."""
    time_s = 5.0 * np.arange(10.0)
    slow, fine = (Record(x, np.ones(10), np.zeros(10)) for x in (time_s, time_s / 256.0))
    fit = SimpleNamespace(structure=Structure(lags=1, delay=True), values=(300.0, delay_s))
    structure, values = _of_real_delays(fit, [(slow, time_s), (fine, time_s)])  # type: ignore[arg-type]
    assert (structure.delay, len(values)) == (kept, 1 + kept)
    assert values[0] == 300.0


def test_what_has_no_delay_stays_as_it_is() -> None:
    record = Record(np.arange(10.0), np.ones(10), np.zeros(10))
    fit = SimpleNamespace(structure=Structure(lags=1), values=(0.01,))
    assert _of_real_delays(fit, [(record, np.zeros(10))]) == (fit.structure, fit.values)  # type: ignore[arg-type]
