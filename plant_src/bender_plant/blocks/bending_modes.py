"""The bending modes of the cantilever, driven by the quasi-static displacement w.

Each mode answers with unit static gain (paper, equations (13) and (14), with the modal mass and the damping that are
missing there):

    q_i'' + 2 zeta omega_i q_i' + omega_i^2 (q_i - w) = 0,      y = sum g_i q_i + (1 - sum g_i) w

The blocks that change the first mode give it further loads (nonlinear spring, friction, drag, hysteresis):

    q'' + 2 zeta omega q' + d q' |q'| + omega^2 (q + k_2 q^2 + k_3 q^3 + z + f(q') - w) = 0

`shares = "unity"` gives the first mode the whole displacement (g_1 = 1, one mode only); `shares = "beam"` takes the
static shares of the beam, and what the modes above the last one would carry follows w at once (residual flexibility).
The frequencies are those of the beam, or those of a uniform cantilever (wave numbers squared) with a given first one.
A parabola of w over the sub-step is answered exactly: a particular parabola plus a decaying rotation.
"""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from bender_plant.composite_beam import natural_frequency_Hz, static_share, wave_number
from bender_plant.kernels.loaded_mode import loaded_mode_step
from bender_plant.kernels.state import of_any_length
from bender_plant.kernels.vibration_mode import driven_mode, mode_factors, stiff_mode_step
from bender_plant.parameter import ModelError, check, check_given, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "bending_modes"
STAGE = "structure"
TITLE = "Bending modes of the cantilever"
MEMORY = True
STATE_OF_ANY_LENGTH = True
SHARES = ("unity", "beam")


@dataclass(frozen=True, slots=True)
class Loads:
    """What other blocks put on the first mode; see `kernels.loaded_mode`. Forces are divided by the stiffness."""

    quadratic_1_per_um: float = 0.0
    bending_1_per_um2: float = 0.0
    friction_um: float = 0.0
    breakaway_um: float = 0.0
    stribeck_um_per_s: float = 1.0
    drag_1_per_um: float = 0.0
    hysteresis_share: float = 0.0
    hysteresis_beta_1_per_um: float = 0.0
    hysteresis_gamma_1_per_um: float = 0.0


_NO_LOADS = Loads()


@dataclass(frozen=True, slots=True)
class Parameters:
    """How many modes, what they share, how they ring; `first_frequency_Hz` takes the place of the calculated one."""

    count: int = 1
    shares: str = "unity"
    first_frequency_Hz: float | None = None
    damping_ratio: float = parameter(
        0.02, unit="1", low=1e-6, high=0.95, text="damping ratio of every mode", tunable=True
    )
    frequency_factor: float = parameter(
        1.0, unit="1", low=1e-3, high=1e3, text="measured over calculated natural frequency", tunable=True
    )
    cubic_1_per_um2: float = parameter(
        0.0,
        unit="1/um2",
        text="k_3 of the restoring force q + k_3 q^3 of the first mode",
        tunable=True,
    )
    loads: "Loads | None" = None

    def __post_init__(self) -> None:
        if isinstance(self.count, bool) or not isinstance(self.count, int) or not 1 <= self.count <= 20:
            raise ModelError(f"{ID}.count: found {self.count!r}, expected a whole number from 1 to 20")
        if self.shares not in SHARES:
            raise ModelError(f"{ID}.shares: found {self.shares!r}, expected one of {SHARES}")
        if self.shares == "unity" and self.count != 1:
            raise ModelError(f"{ID}.count: found {self.count} with shares = 'unity', expected 1")
        if self.loads is not None and not isinstance(self.loads, Loads):
            raise ModelError(f"{ID}.loads: unknown key; friction, drag and springs are blocks of their own")
        check_given(self.first_frequency_Hz, "Hz", 1e-3, 1e7, f"{ID}.first_frequency_Hz")
        check(self, ID)

    @property
    def quadratic_1_per_um(self) -> float:
        """k_2 of the restoring force of the first mode."""
        return self.loads.quadratic_1_per_um if self.loads else 0.0

    def loaded(self, **further: float) -> "Parameters":
        """Return the modes with further loads on the first."""
        return replace(self, loads=replace(self.loads or _NO_LOADS, **further))


def _omegas(settings: Parameters, beam: "CompositeBeam | None") -> list[float]:
    factor = 2.0 * math.pi * settings.frequency_factor
    modes = range(1, settings.count + 1)
    if settings.first_frequency_Hz is not None:
        first = factor * settings.first_frequency_Hz / wave_number(1) ** 2
        return [first * wave_number(mode) ** 2 for mode in modes]
    if beam is None:
        raise ModelError(
            f"{ID}: found no [beam] in the model, expected one to take the frequencies from, or first_frequency_Hz"
        )
    return [factor * natural_frequency_Hz(beam, mode) for mode in modes]


_Mode = tuple[float, ...]


def _load(cubic: float, x: Loads) -> tuple[float, ...]:
    # written out: this is called for every simulation of a fit, and `astuple` copies deeply
    return (
        cubic, x.bending_1_per_um2, x.quadratic_1_per_um, x.friction_um, x.breakaway_um, x.stribeck_um_per_s,
        x.drag_1_per_um, x.hysteresis_share, x.hysteresis_beta_1_per_um, x.hysteresis_gamma_1_per_um,
    )  # fmt: skip


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[_Mode, ...]:
    """Return (omega, zeta, share, k_3, b, k_2, f_c, f_s, v_s, d, alpha, beta, gamma) of each mode.

    In rad/s, 1, 1, 1/um^2, 1/um^2, 1/um, um, um, um/s, 1/um, 1, 1/um, 1/um; from k_3 on of the first mode alone.
    """
    shares = [1.0] if settings.shares == "unity" else [static_share(k) for k in range(1, settings.count + 1)]
    zeta = settings.damping_ratio
    none = _load(0.0, _NO_LOADS)
    loads = [_load(settings.cubic_1_per_um2, settings.loads or _NO_LOADS)] + [none] * (settings.count - 1)
    omegas = _omegas(settings, beam)
    return tuple((omega, zeta, g, *load) for omega, g, load in zip(omegas, shares, loads, strict=True))


def initial(constants: tuple[_Mode, ...]) -> tuple[float, ...]:
    """Return (q_1, q_1', q_2, q_2', ..., z of the first) at rest."""
    return (0.0, 0.0) * len(constants) + (0.0,)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return no bound for linear modes (exact), a part of the period for one with another load."""
    loads = settings.loads or _NO_LOADS
    springs = settings.cubic_1_per_um2 or loads.quadratic_1_per_um or loads.hysteresis_share
    if not (springs or loads.breakaway_um or loads.drag_1_per_um):
        return math.inf, math.inf
    limit = (0.05 if loads.hysteresis_share else 0.12) / _omegas(settings, beam)[0]
    return limit, limit


def ringing_step_s(settings: Parameters, beam: "CompositeBeam | None") -> float:
    """Return the longest sub-step over which the ringing of the quickest mode passes for a parabola."""
    return 0.2 / max(_omegas(settings, beam))


def step(
    state: tuple[float, ...],
    constants: tuple[_Mode, ...],
    time_s: float,
    h: float,
    w0: float,
    wm: float,
    w1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance every mode over one sub-step; returns the state and the tip at its start, middle and end."""
    del time_s
    y0, ym, y1, rest = 0.0, 0.0, 0.0, 1.0
    z = state[2 * len(constants)]
    after: list[float] = []
    for k in range(len(constants)):
        omega, zeta, share, cubic, bend, quadratic, kinetic, breakaway, speed, drag, alpha, beta, gamma = constants[k]
        q0, v0 = state[2 * k], state[2 * k + 1]
        if breakaway > 0.0 or drag > 0.0 or alpha > 0.0:
            load = (quadratic, cubic, bend, kinetic, breakaway, speed, drag / (omega * omega), alpha, beta, gamma)
            q, v, z, middle = loaded_mode_step(q0, v0, z, omega, zeta, load, h, w0, wm, w1)
        elif cubic == 0.0 and quadratic == 0.0:
            q, v, middle = driven_mode(q0, v0, zeta, mode_factors(omega, zeta, h), h, w0, wm, w1)
        else:
            q, v, middle = stiff_mode_step(q0, v0, omega, zeta, quadratic, cubic, bend, h, w0, wm, w1)
        after.append(q)
        after.append(v)
        y0 += share * q0
        ym += share * middle
        y1 += share * q
        rest -= share
    after.append(z)
    return of_any_length(after), y0 + rest * w0, ym + rest * wm, y1 + rest * w1
