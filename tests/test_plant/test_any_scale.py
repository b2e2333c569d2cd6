"""A device is the same in any unit: what large numbers do to rounding is no corner of its course."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_compiled.simulation import Drive, Simulator
from bender_plant.blocks import BLOCKS
from bender_plant.model import load_model
from bender_plant.parabola import first_crossing
from bender_plant.parameter import WIDEST, meanings

values = st.floats(-50.0, 50.0).map(lambda x: round(x, 6))


@given(st.tuples(values, values, values), values, st.integers(0, 40))
def test_a_level_is_passed_at_the_same_instant_in_any_unit(
    course: tuple[float, float, float], level: float, power: int
) -> None:
    """Units are powers of two: only what counts as negligible may differ."""
    unit = 2.0**power
    u0, um, u1 = course
    own, scaled = first_crossing(*course, level), first_crossing(unit * u0, unit * um, unit * u1, unit * level)
    assert scaled == pytest.approx(own, abs=1e-6) or min(abs(course[0] - level), abs(course[2] - level)) < 1e-6


@pytest.mark.parametrize("unit", [1e-3, 1e3, 1e6, 1e9])
def test_a_backlash_reads_the_same_in_any_unit(unit: float) -> None:
    time = np.arange(400) / 50.0
    command = 20.0 * np.sin(3.0 * time) + 5.0 * np.sin(17.0 * time)
    own, scaled = (
        Simulator(Drive(time, time, k * command, linear=True)).run(
            load_model("beam").with_block("backlash", half_width_um=3.0 * k)
        )
        for k in (1.0, unit)
    )
    np.testing.assert_allclose(scaled.reading_um, unit * own.reading_um, rtol=1e-6, atol=1e-6 * unit)


def test_no_number_of_a_device_is_bounded_by_the_unit_in_which_it_is_read() -> None:
    for block in BLOCKS.values():
        for name, meaning in meanings(block.parameters).items():
            if any(x in meaning.unit for x in ("um", "V")) and not name.startswith("straight") and "far" not in name:
                assert meaning.low in (0.0, 1e-30, -WIDEST), (block.id, name)
                assert meaning.high in (0.0, WIDEST, 1e9), (block.id, name)
