"""Modes that are linear, but for a spring on the first, over a whole signal, one mode after the other.

The formulas are the plant's. Almost every simulation of a search runs them. The factors of a sub-step of a mode depend
on its length, and with a spring on one of few stiffnesses. Most signals have few different lengths: the factors of the
last ones are kept in a table.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

from bender_compiled.kernels import generated, sources

LINEAR_MODES = "linear_modes"

_RUN = """
PLACES = 256
ODD, FURTHER = 0x1E3779B97F4A7C15, 0x3C6EF372FE94F82B


@njit(cache=True, nogil=True)
def run(state, modes, spring, h, w0, wm, w1):
    y0, ym, y1 = np.zeros(h.size), np.zeros(h.size), np.zeros(h.size)
    bits = h.view(np.int64)
    lengths, levels, kept = np.empty(PLACES), np.empty(PLACES), np.empty((PLACES, {size}))
    cubic, bend, quadratic = spring
    after = np.empty(len(state))
    for k in range(len(state)):
        after[k] = state[k]
    rest = 1.0
    for k in range(len(modes)):
        omega, zeta, share = modes[k]
        q, v = state[2 * k], state[2 * k + 1]
        rest -= share
        if k == 0 and (cubic != 0.0 or quadratic != 0.0):
            lengths[:] = 0.0
            for i in range(h.size):
                stiffness = nearest_level(stiffness_at(q, quadratic, cubic, bend))
                n = (bits[i] * ODD + np.int64(stiffness * STIFFNESS_LEVELS) * FURTHER >> 50) & (PLACES - 1)
                if lengths[n] != h[i] or levels[n] != stiffness:
                    lengths[n], levels[n] = h[i], stiffness
                    root = math.sqrt(stiffness)
                    {keep} = mode_factors(omega * root, zeta / root, h[i])
                factors = {keep}
                end, rate, middle = stiffened_mode(
                    q, v, zeta, quadratic, cubic, bend, stiffness, factors, h[i], w0[i], wm[i], w1[i]
                )
                y0[i], ym[i], y1[i] = share * q, share * middle, share * end
                q, v = end, rate
            after[2 * k], after[2 * k + 1] = q, v
            continue
        # no sub-step is as short as that: every place is empty
        lengths[:] = 0.0
        for i in range(h.size):
            # the highest bits of a product depend on all bits of the length
            n = (bits[i] * ODD >> 50) & (PLACES - 1)
            if lengths[n] != h[i]:
                lengths[n] = h[i]
                {keep} = mode_factors(omega, zeta, h[i])
            factors = {keep}
            end, rate, middle = driven_mode(q, v, zeta, factors, h[i], w0[i], wm[i], w1[i])
            y0[i] += share * q
            ym[i] += share * middle
            y1[i] += share * end
            q, v = end, rate
        after[2 * k], after[2 * k + 1] = q, v
    for i in range(h.size):
        y0[i] += rest * w0[i]
        ym[i] += rest * wm[i]
        y1[i] += rest * w1[i]
    return y0, ym, y1, after
"""


@cache
def linear_modes_run() -> Callable[..., tuple[Any, Any, Any, Any]]:
    """Return the compiled run `run(state, modes, spring, h, w0, wm, w1)`, with arrays (n,).

    The modes are those of (omega, zeta, share), the spring of the first is (k_3, b, k_2). It returns the values at the
    start, middle and end of every sub-step and the state at the end, as `kernels.uncut_run` does.
    """
    from bender_plant.kernels import vibration_mode as mode

    used = [mode.mode_factors, mode.driven_mode, mode.stiffness_at, mode.nearest_level, mode.stiffened_mode]
    size = len(mode.mode_factors(1.0, 0.5, 1.0))
    run = _RUN.format(size=size, keep=", ".join(f"kept[n, {k}]" for k in range(size)))
    return generated(LINEAR_MODES, sources(used) + "\n" + run).run


def spring_alone(modes: tuple[tuple[float, ...], ...]) -> tuple[float, float, float] | None:
    """Return the spring (k_3, b, k_2) of the first of modes that have no other load, by constants of `bending_modes`.

    None where another load is on one of them, or a spring on another one than the first.
    """
    others = (x for mode in modes for x in (mode[7], mode[9], mode[10]))
    later = (x for mode in modes[1:] for x in (mode[3], mode[5]))
    return None if any(others) or any(later) else modes[0][3:6]  # pyright: ignore[reportReturnType]
