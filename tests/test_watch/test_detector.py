"""The tests side by side: quiet while nothing changes, quick when something does, what explains it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

from bender_watch.alarm.onset import onset_of, onset_of_variance, wide_clip
from bender_watch.alarm.suspects import compared
from bender_watch.baseline.noise import fit_noise
from bender_watch.baseline.signatures import distinct_groups
from bender_watch.sequential import run_length as lengths
from bender_watch.sequential.detector import GAP, JUDGED, NOT_JUDGED, Detector, Noise, make_tests

WHITE = Noise(np.zeros((1, 0)), np.array([0.5]))
COLOURED = Noise(np.array([[0.0], [0.8]]), np.array([0.5 / 0.6, 0.5]))


def detector(rows: float = 1e5, noise: Noise = WHITE, signatures: int = 2) -> Detector:
    names = tuple(f"effect_{k}" for k in range(signatures))
    ones = np.ones(signatures)
    return Detector(noise, make_tests(names, 0.0 * ones, ones, np.zeros(signatures, bool), rows))


def drawn(rows: int, seed: int, phi: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Noise of deviation 0.5 per innovation, and a level beside a signature of steps."""
    rng = np.random.default_rng(seed)
    noise = 0.5 * rng.standard_normal(rows)
    for k in range(1, rows):
        noise[k] += phi * noise[k - 1]
    steps = np.repeat(rng.standard_normal(rows // 20 + 1), 20)[:rows]
    return noise, np.column_stack([np.full(rows, 0.5), 0.5 * steps])


def judged(own: Detector, residual: np.ndarray, signatures: np.ndarray, kind: int = JUDGED):
    kinds = np.full(residual.size, kind, dtype=np.int64)
    return own.judge(residual, signatures, kinds, np.ones(residual.size))


@pytest.mark.parametrize(("noise", "phi"), [(WHITE, 0.0), (COLOURED, 0.8)])
def test_false_alarms_are_no_more_than_was_said(noise: Noise, phi: float) -> None:
    own, alarms, rows = detector(2000.0, noise), 0, 100_000
    residual, signatures = drawn(rows, 5, phi)
    begin = 0
    while (found := own.judge(residual, signatures, np.zeros(rows, np.int64), np.ones(rows), begin)).exceedance:
        alarms, begin = alarms + 1, found.exceedance.row + 1
        own.reset()
    # 50 on the average at the rate that was said; more than 67 has a chance of 1 %
    assert 5 <= alarms <= 67


def test_rows_in_which_a_signature_has_died_away_raise_nothing() -> None:
    """Sums over all rows forget what is too small beside them: such rows seemed to be known better than they are."""
    own, rng = detector(1e6, signatures=1), np.random.default_rng(11)
    signatures = np.tile(5.0 * np.exp(-np.arange(1000) / 60.0), 100)[:, None]
    for _ in range(8):
        assert judged(own, 0.5 * rng.standard_normal(len(signatures)), signatures).exceedance is None


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.integers(1, 399), max_size=5))
def test_stretches_of_any_length_say_the_same(seed: int, cuts: list[int]) -> None:
    residual, signatures = drawn(400, seed, 0.8)
    residual[200:] += 1.0
    residual[90:95] = np.nan
    whole = judged(detector(noise=COLOURED), residual, signatures)
    own, parts = detector(noise=COLOURED), []
    for a, b in zip([0, *sorted(set(cuts))], [*sorted(set(cuts)), 400], strict=True):
        found = judged(own, residual[a:b], signatures[a:b])
        parts.append(found.innovations)
        if found.exceedance:
            assert whole.exceedance is not None
            assert a + found.exceedance.row == whole.exceedance.row
            return
    assert whole.exceedance is None
    assert np.array_equal(np.concatenate(parts), whole.innovations, equal_nan=True)


def test_what_was_remembered_goes_on() -> None:
    residual, signatures = drawn(300, 8, 0.8)
    one, other = detector(noise=COLOURED), detector(noise=COLOURED)
    judged(one, residual[:200], signatures[:200])
    other.restore(one.state())
    mine, theirs = (judged(x, residual[200:], signatures[200:]) for x in (one, other))
    assert np.array_equal(mine.tops, theirs.tops)


def test_the_state_of_other_tests_is_refused() -> None:
    with pytest.raises(ValueError, match="other tests"):
        detector(signatures=3).restore(detector().state())


@pytest.mark.parametrize("amplitude", [2.0, 4.0, -4.0])
def test_a_change_is_found_near_the_bound_of_any_test(amplitude: float) -> None:
    residual, signatures = drawn(4000, 3)
    residual[2000:] += amplitude * signatures[2000:, 1]
    found = judged(detector(), residual, signatures).exceedance
    assert found is not None
    # Wald: ln(rows between false alarms) over the information that a row has
    information = np.cumsum(0.5 * (amplitude * signatures[2000:, 1] / 0.5) ** 2)
    bound = int(np.searchsorted(information, np.log(1e5)))
    assert 0 <= found.row - 2000 <= 3 * bound + 10


def test_outlying_readings_are_no_alarm_and_a_constant_sensor_is() -> None:
    residual, signatures = drawn(3000, 4)
    residual[::100] += 40.0
    residual[1501], residual[1502] = 40.0, 40.0
    assert judged(detector(1e6), residual, signatures).exceedance is None
    residual[2000:] = 0.0
    found = judged(detector(1e6), residual, signatures).exceedance
    assert found is not None
    assert found.test == "quieter"
    assert 2000 < found.row < 2100


def test_rows_that_are_not_judged_raise_nothing() -> None:
    residual, signatures = drawn(500, 6)
    found = judged(detector(), residual + 5.0, signatures, NOT_JUDGED)
    assert found.exceedance is None
    assert found.rows == 0


def test_behind_a_gap_the_first_row_is_judged_without_a_past() -> None:
    own = detector(noise=COLOURED)
    residual, signatures = np.array([1.0, 1.0]), np.zeros((2, 2))
    found = own.judge(residual, signatures, np.array([JUDGED, JUDGED + GAP]), np.ones(2))
    assert found.innovations == pytest.approx([1.0 * 0.6 / 0.5] * 2)


def simulated_run_length(reference: float, threshold: float, rows: int, seed: int) -> float:
    """Mean rows between crossings of a CUSUM of normal rows that begins anew after each."""
    total, crossings = 0.0, 0
    for x in np.random.default_rng(seed).standard_normal(rows):
        total = max(0.0, total + x - reference)
        if total >= threshold:
            total, crossings = 0.0, crossings + 1
    return rows / crossings


@pytest.mark.parametrize("reference", [0.25, 0.5, 1.0])
def test_approximation_chain_and_simulation_agree(reference: float) -> None:
    threshold = lengths.cusum_threshold(300.0, reference)
    chain = lengths.markov_run_length(ndtr, reference, threshold)
    assert lengths.siegmund_run_length(reference, threshold) == pytest.approx(300.0, rel=0.02)
    assert chain == pytest.approx(300.0, rel=0.08)
    assert simulated_run_length(reference, threshold, 150_000, 1) == pytest.approx(chain, rel=0.2)


@given(st.floats(1e2, 1e9), st.floats(1.1, 100.0))
def test_rarer_false_alarms_have_higher_thresholds(run_length: float, factor: float) -> None:
    assert lengths.glr_threshold(run_length * factor, 9.0) > lengths.glr_threshold(run_length, 9.0)


def test_the_union_of_few_windows_is_below_all_of_them() -> None:
    few, many = lengths.glr_threshold(1e6, 2.0), lengths.glr_threshold(1e6, 1e6)
    assert few < many
    assert lengths.glr_run_length(many) == pytest.approx(1e6, rel=1e-3)
    assert 2.0 * 2.0 * ndtr(-few) == pytest.approx(1e-6, rel=1e-6)


@given(st.floats(0.5, 5.0), st.floats(-6.0, 6.0))
def test_what_is_clipped_has_no_tail(clip: float, value: float) -> None:
    at = np.array([value])
    normal, square = lengths.clipped_normal(clip)(at)[0], lengths.clipped_square(clip)(at)[0]
    assert normal == (1.0 if value >= clip else 0.0 if value < -clip else pytest.approx(ndtr(value)))
    assert square == (1.0 if value >= clip**2 else 0.0 if value < 0.0 else pytest.approx(2.0 * ndtr(value**0.5) - 1.0))


def test_a_run_length_of_a_few_rows_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 10 rows"):
        lengths.glr_threshold(5.0, 9.0)


def test_the_interval_holds_the_row_of_the_change() -> None:
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(200):
        z = np.repeat(rng.standard_normal(40), 10)
        e = rng.standard_normal(400)
        e[250:] += 1.2 * z[250:]
        found = onset_of(e, z)
        # rows in which the signature is near nought say nothing: either side of them is the same change
        held += found.low <= 250 <= found.high + 1
    assert held >= 180


def test_amplitude_and_its_deviation() -> None:
    rng = np.random.default_rng(2)
    off = []
    for _ in range(100):
        z, e = rng.standard_normal(300), rng.standard_normal(300)
        e[100:] += 0.7 * z[100:]
        found = onset_of(e, z)
        off.append((found.amplitude - 0.7) / found.std)
    assert abs(np.mean(off)) < 0.5
    assert 0.7 < np.std(off) < 1.4


def test_what_grows_is_a_ramp_and_what_stands_is_none() -> None:
    rng = np.random.default_rng(3)
    e = rng.standard_normal(600)
    grown, stood = e.copy(), e.copy()
    grown[200:] += np.linspace(0.0, 6.0, 400)
    stood[200:] += 3.0
    ramp, step = (onset_of(x, np.ones(600)) for x in (grown, stood))
    assert ramp.grows
    assert ramp.ramp
    assert ramp.low <= 230
    assert not step.grows
    assert abs(step.place - 200) <= 2


@pytest.mark.parametrize(("size", "every"), [(1.0, 1), (5.0, 1), (30.0, 1), (5.0, 25), (30.0, 25)])
def test_a_ramp_that_has_ended_stands_from_its_end_on(size: float, every: int) -> None:
    rng = np.random.default_rng(5)
    # a lag is seen behind jumps only
    z = np.where(np.arange(4000) % every == 0, np.sqrt(every) * rng.standard_normal(4000), 0.0)
    e = rng.standard_normal(4000) + size * z * np.clip((np.arange(4000) - 1000) / 500.0, 0.0, 1.0)
    found = onset_of(e, z, wide_clip(e[1200:], z[1200:]))
    assert found.ramp
    assert not found.grows
    assert found.place == pytest.approx(1000, abs=150)
    assert found.place + found.length == pytest.approx(1500, abs=150)
    assert 1490 <= found.whole <= 1800
    assert found.amplitude == pytest.approx(size, rel=0.1)


def test_of_what_still_grows_half_is_there_half_way() -> None:
    e = np.random.default_rng(6).standard_normal(1000)
    e[200:] += np.linspace(0.0, 12.0, 800)
    found = onset_of(e, np.ones(1000), wide_clip(e[200:], np.ones(800)))
    assert found.grows
    assert found.whole == pytest.approx(600, abs=30)
    assert found.weights(1000)[found.whole] == pytest.approx(0.5, abs=0.01)


def test_an_outlier_is_beyond_the_clip_of_rows_that_are_usual() -> None:
    e, z = np.random.default_rng(7).standard_normal((2, 500))
    e[100] = 50.0
    assert wide_clip(e, z) < 5.0


def test_louder_noise_and_since_when() -> None:
    e = np.random.default_rng(4).standard_normal(500)
    e[300:] *= 2.0
    found = onset_of_variance(e, louder=True)
    assert found.low <= 310
    assert found.high >= 290
    assert found.amplitude > 1.0


@pytest.mark.parametrize("rows", [1000, 4000])
@pytest.mark.parametrize("phi", [0.0, 0.7])
def test_outlying_readings_are_no_noise(rows: int, phi: float) -> None:
    rng = np.random.default_rng(rows)
    noise = 0.05 * rng.standard_normal(rows)
    for k in range(1, rows):
        noise[k] += phi * noise[k - 1]
    outlying = rng.random(rows) < 0.01
    found, kept = fit_noise(noise + outlying, np.ones(rows, bool), np.ones(rows), 1e-9)
    assert not np.any(kept & outlying)
    assert kept.mean() > 0.95
    assert found.spreads_um[-1] == pytest.approx(0.05, rel=0.08)
    assert found.spreads_um[0] == pytest.approx(0.05 / np.sqrt(1.0 - phi**2), rel=0.12)


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


def test_of_the_forms_of_an_effect_the_one_most_like_the_others_stands_for_it() -> None:
    rng = np.random.default_rng(6)
    base, far = rng.standard_normal((400, 4)), rng.standard_normal((400, 20))
    lone, middle = base[:, 3], base[:, 2]
    near = [middle + 0.5 * rng.standard_normal(400) for _ in range(2)]
    every = np.column_stack([base[:, 0], base[:, 1], lone, near[0], middle, near[1], far])
    names = ["offset", "gain_error", *["creep"] * 4, *[f"other {k}" for k in range(20)]]
    assert [x.place for x in distinct_groups(names, every, 2) if x.effects[0] == "creep"] == [4]


def test_a_form_unlike_the_others_of_its_effect_comes_before_one_that_is_like_them() -> None:
    rng = np.random.default_rng(7)
    base, middle = rng.standard_normal((400, 3)), rng.standard_normal(400)
    near = [middle + 0.6 * rng.standard_normal(400) for _ in range(3)]
    others = rng.standard_normal((400, 14))
    every = np.column_stack([base[:, :2], middle, *near, base[:, 2], others])
    names = ["offset", "gain_error", *["creep"] * 5, *[f"other {k}" for k in range(14)]]
    assert [x.place for x in distinct_groups(names, every, 2) if x.effects[0] == "creep"] == [2, 6]
