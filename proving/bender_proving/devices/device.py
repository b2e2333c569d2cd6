"""A device: elements in a random order between command and reading, stepped along a fine clock.

Each element is a small machine of its own: it takes a number and the time step, and gives a number. Nothing here is a
form of the catalogue: a loop is a row of stops in series, a curve a broken line, a lag a backward Euler step.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Element = Callable[[float, float], float]
"""Takes the value before it and the step in s; returns the value behind it."""
RIGHT_NAMES: dict[str, frozenset[str]] = {
    "lag": frozenset({"sensor_lag", "source_resistance", "plant_lag", "transport_delay", "supply_fall_lag"}),
    "mode": frozenset({"second_mode", "tip_mass", "structural_damping"}),
    "delay": frozenset({"transport_delay", "sensor_lag", "source_resistance", "plant_lag"}),
    "play": frozenset({"backlash", "rate_independent_hysteresis", "hysteretic_spring"}),
    "stops": frozenset({"rate_independent_hysteresis", "hysteretic_spring", "coulomb_friction", "backlash"}),
    "broken line": frozenset(
        {
            "saturation", "electrostriction", "lens_distortion", "output_curve", "asymmetric_gain", "quadratic_spring",
            "stiffening", "dead_zone", "asymmetric_dead_zone", "output_dead_zone", "fold", "output_limit",
        }
    ),
    "coarse": frozenset({"sensor_quantisation", "supply_quantisation"}),
    "drift": frozenset({"thermal_drift", "ageing", "creep"}),
    "hum": frozenset({"periodic_disturbance"}),
}  # fmt: skip
"""Names that a diagnosis may give to each kind of element; the gain and the offset are everybody's.

A fold in part and a limit that still follows are a line with one corner.
"""
ALWAYS_RIGHT = frozenset({"gain_error", "offset"})


@dataclass(frozen=True, slots=True)
class Device:
    """What was drawn.

    Attributes:
        kinds: of its elements, from command to reading.
        gain: reading per command.
        numbers: a row of random numbers per element, which make it.
        time_scale_s: by which its times are measured.
    """

    kinds: tuple[str, ...]
    gain: float
    numbers: tuple[tuple[float, ...], ...]
    time_scale_s: float

    @property
    def right_names(self) -> frozenset[str]:
        """The ids that are no false name of what is in it; a mode that is damped beyond 1 is two lags."""
        drawn = zip(self.kinds, self.numbers, strict=True)
        is_slow = any(kind == "mode" and _damping_ratio(numbers) >= 1.0 for kind, numbers in drawn)
        kinds = (*self.kinds, "lag") if is_slow else self.kinds
        return ALWAYS_RIGHT.union(*(RIGHT_NAMES[kind] for kind in kinds))

    def elements(self, span: float) -> list[Element]:
        """Return its elements at rest.

        Args:
            span: of the command; sizes are parts of it.
        """
        pairs = zip(self.kinds, self.numbers, strict=True)
        return [_MAKERS[kind](numbers, span, self.time_scale_s) for kind, numbers in pairs]


def draw_device(rng: np.random.Generator) -> Device:
    """Return a device of none to four elements."""
    count = int(rng.choice([0, 1, 2, 3, 4], p=[0.08, 0.3, 0.3, 0.22, 0.1]))
    kinds = tuple(str(kind) for kind in rng.choice(sorted(RIGHT_NAMES), size=count, replace=False))
    numbers = tuple(tuple(float(x) for x in rng.uniform(size=6)) for _ in kinds)
    gain = float(10.0 ** rng.uniform(-1.5, 1.5)) * (-1.0 if rng.uniform() < 0.15 else 1.0)
    return Device(kinds, gain, numbers, float(10.0 ** rng.uniform(-2.0, 0.3)))


def _lag(numbers: tuple[float, ...], _: float, scale_s: float) -> Element:
    tau_s, state = scale_s * (0.2 + numbers[0]), 0.0

    def step(value: float, dt_s: float) -> float:
        nonlocal state
        state += (value - state) * dt_s / (tau_s + dt_s)
        return state

    return step


def _mode(numbers: tuple[float, ...], _: float, scale_s: float) -> Element:
    omega, damping = 2.0 / (scale_s * (0.2 + numbers[0])), _damping_ratio(numbers)
    place = speed = 0.0

    def step(value: float, dt_s: float) -> float:
        nonlocal place, speed
        # backward Euler: stable whatever the step
        speed = (speed + dt_s * omega**2 * (value - place)) / (1.0 + 2.0 * damping * omega * dt_s + (omega * dt_s) ** 2)
        place += dt_s * speed
        return place

    return step


def _damping_ratio(numbers: tuple[float, ...]) -> float:
    return float(10.0 ** (-1.7 + 1.9 * numbers[1]))


def _delay(numbers: tuple[float, ...], _: float, scale_s: float) -> Element:
    delay_s, waiting = scale_s * (0.1 + numbers[0]), deque([(0.0, 0.0)])
    now_s = 0.0

    def step(value: float, dt_s: float) -> float:
        nonlocal now_s
        now_s += dt_s
        waiting.append((now_s, value))
        while len(waiting) > 1 and waiting[1][0] <= now_s - delay_s:
            waiting.popleft()
        return waiting[0][1]

    return step


def _play(numbers: tuple[float, ...], span: float, _: float) -> Element:
    return _stops((numbers[0], 0.0, 1.0, 0.0, 0.0, 0.0), span, 1.0)


def _stops(numbers: tuple[float, ...], span: float, _: float) -> Element:
    # a mass without inertia dragged between stops: it moves only when a stop pushes it
    halves = [span * (0.01 + 0.06 * x) for x in (numbers[0], 0.4 * numbers[3], 2.0 * numbers[4])]
    weights = [numbers[2], 0.5 * numbers[1], 0.3 * numbers[5]]
    held, total = [0.0, 0.0, 0.0], sum(weights)

    def step(value: float, _: float) -> float:
        for k, half in enumerate(halves):
            held[k] = value - half if held[k] < value - half else value + half if held[k] > value + half else held[k]
        return sum(w * x for w, x in zip(weights, held, strict=True)) / total if total else value

    return step


def _broken_line(numbers: tuple[float, ...], span: float, _: float) -> Element:
    corners = [span * x for x in (-0.3 - numbers[0], -0.1 * numbers[1], 0.1 + 0.4 * numbers[2], 0.7)]
    slopes = [1.0, 0.6 + 0.5 * numbers[3], 1.0, 0.7 + 0.5 * numbers[4], 0.5 + 0.6 * numbers[5]]

    def step(value: float, _: float) -> float:
        total = last = 0.0
        sign = 1.0 if value >= 0.0 else -1.0
        edges = [x for x in corners if x > 0.0] if sign > 0.0 else [-x for x in reversed(corners) if x < 0.0]
        parts = slopes[2:] if sign > 0.0 else slopes[1::-1]
        for edge, slope in zip([*edges, math.inf], parts, strict=False):
            total += slope * (min(abs(value), edge) - last) if abs(value) > last else 0.0
            last = edge
        return sign * total

    return step


def _coarse(numbers: tuple[float, ...], span: float, _: float) -> Element:
    size = span * 10.0 ** (-3.0 + 1.7 * numbers[0])
    return lambda value, _dt: size * math.floor(value / size + 0.5)


def _drift(numbers: tuple[float, ...], span: float, scale_s: float) -> Element:
    now_s, size = 0.0, span * 0.1 * (2.0 * numbers[0] - 1.0)

    def step(value: float, dt_s: float) -> float:
        nonlocal now_s
        now_s += dt_s
        return value + size * now_s / (now_s + 40.0 * scale_s * (0.3 + numbers[1]))

    return step


def _hum(numbers: tuple[float, ...], span: float, scale_s: float) -> Element:
    now_s, size, pitch = 0.0, span * 0.03 * (0.1 + numbers[0]), (0.3 + 3.0 * numbers[1]) / scale_s

    def step(value: float, dt_s: float) -> float:
        nonlocal now_s
        now_s += dt_s
        return value + size * math.sin(pitch * now_s + 6.0 * numbers[2])

    return step


_MAKERS: dict[str, Callable[[tuple[float, ...], float, float], Element]] = {
    "lag": _lag, "mode": _mode, "delay": _delay, "play": _play, "stops": _stops, "broken line": _broken_line,
    "coarse": _coarse, "drift": _drift, "hum": _hum,
}  # fmt: skip
