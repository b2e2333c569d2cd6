"""The range of levels of late is that of all levels within the time, whatever their order."""

import math
import random

import pytest

from bender_hil.recent_range import RecentRange


def test_nothing_is_known_before_the_first_level():
    assert RecentRange(1.0).since_s(0.0) == math.inf


def test_the_level_that_held_at_the_beginning_counts_until_the_next_one_is_as_old_as_the_span():
    recent = RecentRange(1.0)
    recent.add(-math.inf, 0.0)
    recent.add(2.0, 7.0)
    assert recent.range(2.999) == (0.0, 7.0)
    assert recent.since_s(2.999) == -math.inf
    assert recent.range(3.0) == (7.0, 7.0)
    assert recent.since_s(3.0) == 2.0


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_range_of_all_levels_that_held_within_the_span(seed: int):
    rng = random.Random(seed)
    recent, levels, now_s = RecentRange(0.5), [], 0.0
    for _ in range(300):
        now_s += rng.choice([0.0, 0.001, 0.03, 0.4, 0.7])
        recent.add(now_s, float(rng.randrange(6)))
        levels.append((now_s, recent._levels[-1][1]))
        now_s += rng.choice([0.0, 0.2])
        ends_s = [*(at_s for at_s, _ in levels[1:]), math.inf]
        held = [level for (_, level), end_s in zip(levels, ends_s, strict=True) if end_s > now_s - 0.5]
        assert recent.range(now_s) == (min(held), max(held))
