"""The reference shaper: a set-point that jumps becomes one that a plant can follow, of bounded rate and curvature.

Each sample the shaped reference moves with the velocity from which it can still stop at the set-point with the allowed
change of velocity per sample, the discrete form of the time-optimal profile (J. Han, From PID to active disturbance
rejection control, IEEE Transactions on Industrial Electronics 56 (2009) 900-906, equation 11):

    d = r - p,    a = curvature dt^2,    v dt = a (sqrt(1/4 + 2 |d| / a) - 1/2) sign(d),    |v| <= rate

so that it arrives without passing the set-point, and a step smaller than one sample's worth is taken at once.

Standard library only: the file is carried inside the controller FMU.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Shaper:
    """Bounds of the shaped reference.

    Attributes:
        rate_um_per_s: largest velocity, inf for none.
        curvature_um_per_s2: largest change of velocity per time, inf for none.

    Raises:
        ValueError: a bound is not > 0.
    """

    rate_um_per_s: float = math.inf
    curvature_um_per_s2: float = math.inf

    def __post_init__(self) -> None:
        for name in ("rate_um_per_s", "curvature_um_per_s2"):
            value = getattr(self, name)
            if not value > 0.0:
                raise ValueError(f"{name} must be > 0, found {value!r}")


class Shaped(NamedTuple):
    """Where the shaped reference is, and how fast it moves."""

    position_um: float = 0.0
    rate_um_per_s: float = 0.0


def rise_in(step_um: float, duration_s: float) -> Shaper:
    """Return the shaper that takes a step of `step_um` in `duration_s`: half of it speeding up, half slowing down.

    Raises:
        ValueError: the step is zero, or the duration is not > 0.
    """
    if step_um == 0.0 or not duration_s > 0.0:
        raise ValueError(f"found a step of {step_um!r} µm in {duration_s!r} s, expected another than 0, and a time > 0")
    return Shaper(2.0 * abs(step_um) / duration_s, 4.0 * abs(step_um) / duration_s**2)


def shape(shaper: Shaper, before: Shaped, setpoint_um: float, dt_s: float) -> Shaped:
    """Return the shaped reference one sample of `dt_s` later."""
    distance = setpoint_um - before.position_um
    most = shaper.curvature_um_per_s2 * dt_s * dt_s
    if most == math.inf or abs(distance) <= most:
        way = abs(distance)
    else:
        way = most * (math.sqrt(0.25 + 2.0 * abs(distance) / most) - 0.5)
        # from a standstill, or from the wrong direction, it speeds up no faster than the curvature allows
        way = min(way, math.copysign(before.rate_um_per_s, before.rate_um_per_s * distance) * dt_s + most)
    way = math.copysign(min(way, shaper.rate_um_per_s * dt_s, abs(distance)), distance)
    return Shaped(before.position_um + way, way / dt_s)
