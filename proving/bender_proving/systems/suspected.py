"""A lag or a mode whose number is not the one in its model, an effect that its model lacks, or both.

The answer of the system is exact; effects in front of it act on the held input, those behind it on the reading, so that
neither needs sub-steps. What is drawn is drawn again until it shows: what a parameter or an effect changes, and no
gain, offset or parameter makes up for, is at least three times the noise.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bender_proving.systems.linear import Array, LinearSystem

ROWS, ROW_S, HELD_ROWS, FULL_V = 1200, 0.02, 15, 40.0
NOISE_UM, LEAST, DRAWS = 0.03, 3.0, 200
LEAST_OFF, MOST_OFF = 0.05, 0.30
KINDS = ("parameter", "effect", "parameter", "effect", "parameter", "effect", "parameter", "both")
"""Of case k the one at k modulo eight: of 40 cases 25 have a parameter that is off, 20 an effect, 5 both."""
STRUCTURES = ("lag", "mode")
GIVEN: Mapping[str, Mapping[str, float]] = {
    "lag": {"time_constant_s": 0.2},
    "mode": {"frequency_Hz": 3.0, "damping_ratio": 0.1},
}
"""The numbers of the model, by structure."""
SIZES: Mapping[str, tuple[float, float]] = {
    "transport_delay": (0.01, 0.2), "supply_quantisation": (0.5, 8.0), "dead_zone": (0.3, 6.0),
    "saturation": (0.03, 0.5), "lens_distortion": (0.02, 0.3), "periodic_disturbance": (0.1, 3.0),
    "thermal_drift": (0.3, 6.0),
}  # fmt: skip
"""Smallest and largest size: s, V, V, share lost at full voltage, share at full stroke, um, um."""
_BEHIND: Mapping[str, Callable[[Array, Array, float, float], Array]] = {
    "lens_distortion": lambda y, _, size, __: y + size * y * np.abs(y) / FULL_V,
    "periodic_disturbance": lambda y, t, size, other: y + size * np.sin(2.0 * math.pi * (0.1 + 3.0 * other) * t),
    "thermal_drift": lambda y, t, size, other: y - size * np.expm1(-t / (t[-1] * (0.1 + 0.5 * other))),
}
_FRONT: Mapping[str, Callable[[Array, float], Array]] = {
    "supply_quantisation": lambda u, size: np.round(u / size) * size,
    "dead_zone": lambda u, size: np.sign(u) * np.maximum(np.abs(u) - size, 0.0),
    "saturation": lambda u, size: _flattened(u, size),
}


class NothingShowsError(Exception):
    """Nothing that was drawn shows in the record; another seed may do."""


@dataclass(frozen=True, slots=True, eq=False)
class SuspectedCase:
    """One case, its record (n,) and the truth.

    Attributes:
        number: of the case.
        kind: "parameter", "effect" or "both".
        structure: "lag" or "mode".
        given: numbers of the model.
        true: numbers of the bench; one of them differs where a parameter is off.
        effect: id of CONTRACT.md, "" for none.
        size: of the effect.
        time_s: rows.
        voltage_V: held from each row on.
        reading_um: with noise.
    """

    number: int
    kind: str
    structure: str
    given: Mapping[str, float]
    true: Mapping[str, float]
    effect: str
    size: float
    time_s: Array
    voltage_V: Array
    reading_um: Array

    @property
    def off(self) -> dict[str, float]:
        """True values of the numbers that are off."""
        return {name: value for name, value in self.true.items() if value != self.given[name]}


def suspected_case(number: int, seed: int) -> SuspectedCase:
    """Return the case of this number: kind and structure go round, the rest is drawn from the seed.

    Raises:
        NothingShowsError: nothing drawn shows.
    """
    rng = np.random.default_rng([seed, number])
    kind, structure = KINDS[number % len(KINDS)], STRUCTURES[number // len(KINDS) % len(STRUCTURES)]
    given = GIVEN[structure]
    time_s = np.arange(ROWS, dtype=np.float64) * ROW_S
    voltage_V = np.repeat(rng.uniform(0.0, FULL_V, ROWS // HELD_ROWS), HELD_ROWS)
    voltage_V[:HELD_ROWS] = 0.0
    for _ in range(DRAWS):
        true, effect, size, other = dict(given), "", 0.0, float(rng.random())
        if kind != "effect":
            name = str(rng.choice(list(given)))
            true[name] = given[name] * (1.0 + float(rng.choice([-1.0, 1.0]) * rng.uniform(LEAST_OFF, MOST_OFF)))
        if kind != "parameter":
            effect = str(rng.choice(list(SIZES)))
            low, high = SIZES[effect]
            size = float(np.exp(rng.uniform(math.log(low), math.log(high))))

        def clean(values: Mapping[str, float], hidden: str, size: float = size, other: float = other) -> Array:
            return _read(structure, values, hidden, size, other, time_s, voltage_V)

        if _shows(clean, true, given, effect):
            reading = clean(true, effect) * float(rng.uniform(0.9, 1.1)) + float(rng.uniform(-1.0, 1.0))
            reading = reading + NOISE_UM * rng.standard_normal(ROWS)
            return SuspectedCase(number, kind, structure, given, true, effect, size, time_s, voltage_V, reading)
    raise NothingShowsError(f"case {number} of seed {seed}: nothing drawn leaves {LEAST:g} times the noise")


def _read(
    structure: str, values: Mapping[str, float], effect: str, size: float, other: float, time_s: Array, voltage_V: Array
) -> Array:
    delay_s = size if effect == "transport_delay" else 0.0
    if structure == "lag":
        system = LinearSystem(1.0, (values["time_constant_s"],), (), delay_s)
    else:
        system = LinearSystem(1.0, (), ((values["frequency_Hz"], values["damping_ratio"], 1.0),), delay_s)
    acting = _FRONT[effect](voltage_V, size) if effect in _FRONT else voltage_V
    answer = system.answer(time_s, acting)
    return _BEHIND[effect](answer, time_s, size, other) if effect in _BEHIND else answer


def _shows(
    clean: Callable[[Mapping[str, float], str], Array],
    true: Mapping[str, float],
    given: Mapping[str, float],
    effect: str,
) -> bool:
    """Return whether all that is hidden shows beside gain and offset, an effect also beside the parameters."""
    whole = clean(true, effect)
    without = [clean(given, effect)] if true != given else []
    plain = [np.ones(ROWS)]
    if any(_left(whole, [x, *plain]) < LEAST * NOISE_UM for x in without):
        return False
    if not effect:
        return True
    moved = [clean({**true, name: value * (1.0 + step)}, "") for name, value in true.items() for step in (-0.01, 0.01)]
    slopes = [up - down for down, up in zip(moved[::2], moved[1::2], strict=True)]
    return _left(whole, [clean(true, ""), *slopes, *plain]) >= LEAST * NOISE_UM


def _left(whole: Array, columns: list[Array]) -> float:
    """Return the rms of what a sum of columns leaves."""
    basis = np.column_stack(columns)
    return float(np.std(whole - basis @ np.linalg.lstsq(basis, whole, rcond=None)[0]))


def _flattened(voltage_V: Array, loss: float) -> Array:
    """Return an arctangent of slope 1 at 0 that loses this share at full voltage."""
    low, high = 1e-6, 1e3
    for _ in range(80):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if math.atan(middle) / middle > 1.0 - loss else (low, middle)
    scale_V = FULL_V / low
    return scale_V * np.arctan(voltage_V / scale_V)
