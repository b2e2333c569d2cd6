"""First models of drawn systems: a case that a scan used to miss."""

import pytest

from bender_studies.benchmarks.first_model import trial


@pytest.mark.slow
def test_a_mode_is_found_where_the_delay_made_up_for_it() -> None:
    """Beside the delay that was fitted without the mode, the mode's own frequency promises nothing."""
    found = trial(2, 78)
    assert (found.found, found.found_order) == ("gain+lag+mode+delay", found.order)
    assert found.error_ratio < 1.02


@pytest.mark.slow
def test_two_modes_behind_a_delay_that_hide_each_other_are_found() -> None:
    """No simpler structure has a part of them: the start is the roots of the frequency response."""
    found = trial(11, 79)
    assert found.found == "gain+mode+mode+delay"
    assert found.error_ratio < 1.02
