"""Which signature explains a change, and which ones are told apart."""

import numpy as np
import pytest

from bender_watch.alarm.onset import onset_of
from bender_watch.alarm.suspects import compared
from bender_watch.baseline.signatures import distinct_groups

ROWS, AT = 1500, 600


def signatures(rng: np.random.Generator) -> np.ndarray:
    """Return level, gain, a curve of the same movement, and spikes behind its steps."""
    moves = np.repeat(rng.uniform(-1.0, 1.0, ROWS // 25), 25)
    spikes = np.where(np.arange(ROWS) % 25 == 0, np.diff(moves, prepend=0.0), 0.0)
    return np.column_stack([np.ones(ROWS), moves, moves**2 + 0.5 * moves, spikes])


def suspected(e: np.ndarray, z: np.ndarray, *only: int) -> tuple[int, int]:
    onsets = [onset_of(e, z[:, j]) for j in range(z.shape[1])]
    likelihood, moved = compared(e, z, onsets, np.isin(np.arange(z.shape[1]), only))
    best = int(np.argmax(likelihood))
    return best, moved[best].place


def changed(rng: np.random.Generator, added: np.ndarray) -> np.ndarray:
    return rng.standard_normal(ROWS) + np.where(np.arange(ROWS) >= AT, added, 0.0)


def test_what_is_left_beside_level_and_gain_is_compared() -> None:
    rng = np.random.default_rng(1)
    z = signatures(rng)
    best, place = suspected(changed(rng, 2.0 * z[:, 2] - 0.8 * z[:, 1]), z)
    assert best == 2
    assert abs(place - AT) < 60


@pytest.mark.parametrize("place", [0, 1])
def test_level_and_gain_alone_are_not_told_as_more(place: int) -> None:
    rng = np.random.default_rng(2)
    z = signatures(rng)
    assert suspected(changed(rng, 0.7 * z[:, place]), z)[0] == place


def test_a_sign_that_an_effect_cannot_have_is_not_taken_for_it() -> None:
    rng = np.random.default_rng(6)
    z = signatures(rng)
    e = changed(rng, -1.5 * z[:, 2])
    assert suspected(e, z)[0] == 2
    assert suspected(e, z, 2)[0] != 2


def test_few_large_rows_keep_their_shape_and_a_wild_one_is_set_aside() -> None:
    rng = np.random.default_rng(3)
    z = signatures(rng)
    e = changed(rng, 25.0 * z[:, 3])
    e[900] = 1e6
    best, place = suspected(e, z)
    assert best == 3
    assert abs(place - AT) < 60


def test_an_effect_is_grouped_by_what_it_adds_to_level_and_gain() -> None:
    rng = np.random.default_rng(4)
    z = signatures(rng)
    effects = ["offset", "gain_error", "curve", "spikes", "another curve", "gain again"]
    every = np.column_stack([z, z[:, 2] - 0.9 * z[:, 1], z[:, 1] + 0.02 * z[:, 3]])
    groups = distinct_groups(effects, every, 2)
    assert [x.effects for x in groups] == [
        ("offset",), ("gain_error", "gain again"), ("curve", "another curve"), ("spikes",)
    ]  # fmt: skip


def test_other_forms_of_an_effect_take_no_place_of_another_effect() -> None:
    rng = np.random.default_rng(5)
    names = ["offset", "gain_error", *["creep"] * 20, "backlash"]
    groups = distinct_groups(names, rng.standard_normal((400, len(names))), 2)
    assert ("backlash",) in [x.effects for x in groups]
