"""The sub-step of a play ends where it engages or where its input turns."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from bender_plant.kernels.play import first_engagement, play
from bender_plant.parabola import INSTANT, value

NEAR = 1e-6
VOLTS = st.floats(-60.0, 60.0)
RADII = st.lists(st.floats(0.0, 40.0), min_size=1, max_size=4)


@given(VOLTS, VOLTS, VOLTS, RADII, st.data())
@example(0.0, 5.0, 10.0, [5.0], None)
@example(0.0, 8.0, 0.0, [3.0], None)
@example(0.0, 0.0, 11.0, [1e-3, 1e-5], None)
def test_until_it_ends_every_play_stands_or_is_pushed(u0, um, u1, radii, data):
    outputs = [0.0] * len(radii) if data is None else [data.draw(VOLTS) for _ in radii]
    end = first_engagement(tuple(outputs), tuple(radii), u0, um, u1)
    assert 0.0 < end <= 1.0
    inside = np.array([value(u0, um, u1, x) for x in np.linspace(0.0, end, 202)[1:-1]])
    steps = np.diff(np.concatenate([[u0], inside, [value(u0, um, u1, end)]]))
    assert np.all(steps >= -NEAR) or np.all(steps <= NEAR)
    # what happens within an instant of the beginning is taken for it
    near = NEAR + 8.0 * INSTANT * float(np.ptp((u0, um, u1)))
    for output, radius in zip(outputs, radii, strict=True):
        at_start = play(output, u0, radius)
        pushed = (inside - radius > at_start + near) | (inside + radius < at_start - near)
        stands = (inside - radius < at_start - near) & (inside + radius > at_start + near)
        assert not (pushed.any() and stands.any())


@given(st.floats(0.1, 30.0), st.floats(-20.0, 20.0), st.floats(0.1, 40.0))
def test_a_play_engages_where_a_straight_input_has_crossed_its_slack(radius, start, rise):
    end = first_engagement((start,), (radius,), start, start + 0.5 * rise, start + rise)
    expected = radius / rise if NEAR < radius / rise < 1.0 - NEAR else 1.0
    assert abs(end - expected) < 1e-6
