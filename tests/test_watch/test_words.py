"""Events in words."""

import pytest

from bender_watch.words import forecast

DAY = 86400.0


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ((9 * DAY, 7 * DAY, 12 * DAY), "leaves what is allowed in 9 days (7 days to 12 days)"),
        ((9 * DAY, 7 * DAY, None), "leaves what is allowed in 9 days (7 days to never)"),
        ((None, 7 * DAY, None), "likely stays within what is allowed; leaves it in 7 days at the earliest"),
        ((None, None, None), "stays within what is allowed"),
    ],
)
def test_a_forecast_says_when_or_that_it_stays(times: tuple[float | None, ...], said: str) -> None:
    names = ("leaves_in_s", "leaves_low_s", "leaves_high_s")
    assert forecast(dict(zip(names, times, strict=True))) == said
