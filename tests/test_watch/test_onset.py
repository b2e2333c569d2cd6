"""Since when, how large, whether it grows."""

import numpy as np

from bender_watch.alarm.onset import onset_of, onset_of_variance


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


def test_louder_noise_and_since_when() -> None:
    e = np.random.default_rng(4).standard_normal(500)
    e[300:] *= 2.0
    found = onset_of_variance(e, louder=True)
    assert found.low <= 310
    assert found.high >= 290
    assert found.amplitude > 1.0
