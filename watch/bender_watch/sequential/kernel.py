"""Rows through whitening and the tests, compiled from the functions of this file.

Whitening: the autoregressive predictor of the noise, of as many rows as have come since the last gap. Signatures pass
the same filter as the residual (generalised least squares), so that a change of size c moves the whitened residual e by
c z. Innovations are clipped, and what is clipped does not enter the past: an outlying reading is one bounded score.

Tests, on every row that counts:

    CUSUM of level      S = max(0, S + e - 1/2), and for -e
    CUSUM of variance   S = max(0, S + min(e^2, c^2) - k) for a doubled one, and the mirrored one for a quarter
    GLR of signature j  (sum z_j e)^2 / (sum z_j^2 (1 + tau_j^2 sum z_j^2))   over the last 3 to 7 times 2^i rows

where tau_j is how far the amplitude of signature j goes astray on the training record itself. Windows of length w end
at multiples of a fourth of w: sums at these places are all that is remembered.

What is not known of a record (its level, what came before it) is a regression on known columns u_k beside the noise: e
is its recursive residual (Brown, Durbin and Evans, JRSS B 37, 1975), (e - u a) / sqrt(1 + u P u) with the estimate a of
the rows before and its covariance P, and white of unit variance whatever the amplitudes are. The last columns may be a
drift that is followed (positions, then a slope of each): its part of u a is given back, so that it is not lost for
whoever asks what the drift is. Between rows it moves on (Kalman, J. Basic Eng. 82, 1960).
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from bender_compiled.kernels import generated, sources

LEVELS, PLACES = 24, 8
"""Windows reach back 7 * 2^23 rows; of each level so many sums are kept."""
SHORTEST = 3
"""Rows of the shortest window: no fewer rows than that can raise an alarm of a signature."""
FAINT = 1e-9
"""Part of the sums over all rows: a window that holds less is lost in their rounding."""
REBASED = 1 << 20
"""Rows after which sums begin anew at nought; windows are differences of them."""
WINDOWS_PER_ROW = PLACES - SHORTEST + (PLACES - 4)
"""That end at a row in the mean: those of the first level, and of each further one half as many as of the last."""
LEVEL_REFERENCE = 0.5
LOUD_REFERENCE, QUIET_REFERENCE = 1.3862943611198906, 0.46209812037329684
"""ln R / (1 - 1 / R) for a variance that is doubled, and for a quarter of it."""
WANDER = 0.3
"""Part of itself by which a slope wanders while the drift becomes e times as old, one deviation.

From there on what fades over three time constants, or by the logarithm of time, stays below the thresholds; the smaller
it is, the fewer rows of a fade must have been seen for a stop of it to be an alarm.
"""
CUSUMS = ("level_up", "level_down", "louder", "quieter")


def whiten(coefficients: Any, past: Any, rows: int) -> float:
    """Return what the last rows foretell of the next one."""
    total = 0.0
    for i in range(rows):
        total += coefficients[rows, i] * past[i]
    return total


def remember(past: Any, value: float) -> float:
    """Put a row before the others."""
    for i in range(len(past) - 1, 0, -1):
        past[i] = past[i - 1]
    if len(past):
        past[0] = value
    return value


def cusum_step(total: float, score: float) -> float:
    """Return the next sum of a CUSUM."""
    return max(0.0, total + score)


def window_variance(information: float, allowance: float, inflation: float) -> float:
    """Return the variance of the score over a window while nothing has changed, by its information."""
    return inflation * information * (1.0 + allowance * allowance * information)


def project(covariance: Any, column: Any, found: Any) -> float:
    """Put the product of a covariance with a column into `found`; return that with the column once more."""
    for i in range(len(column)):
        found[i] = 0.0
    for j in range(len(column)):
        # of most rows most are nought: pasts have faded
        if column[j] != 0.0:
            for i in range(len(column)):
                found[i] += covariance[i, j] * column[j]
    total = 0.0
    for i in range(len(column)):
        total += column[i] * found[i]
    return total


def learn_unknown(amplitudes: Any, covariance: Any, projected: Any, wide: float, score: float) -> float:
    """Take a row of a regression: `wide` is the deviation of what was foretold of it, `score` what it was off by."""
    for i in range(len(amplitudes)):
        if projected[i] != 0.0:
            amplitudes[i] += projected[i] * score / wide
            for j in range(len(amplitudes)):
                covariance[i, j] -= projected[i] * projected[j] / (wide * wide)
    return score


def pass_time(amplitudes: Any, covariance: Any, positions: int, step: float, age: float, wander: float) -> float:
    """Move a drift on by a step; return its age then.

    Its slopes wander by a part of themselves while its age grows by a factor of e, whatever the unit of time is: nobody
    knows how fast a drift bends, and the only time that it has is its age.

    Args:
        amplitudes: (n,) of the columns; the last `2 positions` are positions and their slopes.
        covariance: (n, n).
        positions: how many there are.
        step: time that passes.
        age: of the drift, in the same unit.
        wander: by how much of themselves, one deviation.
    """
    size = len(amplitudes)
    older = math.log((age + step) / age)
    for v in range(size - positions, size):
        p = v - positions
        amplitudes[p] += step * amplitudes[v]
        for j in range(size):
            covariance[p, j] += step * covariance[v, j]
        for j in range(size):
            covariance[j, p] += step * covariance[j, v]
        more = wander * wander * older * (amplitudes[v] * amplitudes[v] + covariance[v, v])
        covariance[v, v] += more
        covariance[p, v] += 0.5 * step * more
        covariance[v, p] += 0.5 * step * more
        covariance[p, p] += step * step * more / 3.0
    return age + step


_RUN = """
@njit(cache=True, nogil=True)
def run(
    begin, residual, signatures, columns, followed, steps, age, state_of_row, spread_of_row, coefficients, spreads,
    past, past_signatures, past_columns, amplitudes, covariance, counts, clip, quiet_clip, sums, informations,
    ring_sums, ring_informations, ring_filled, cusums, cusum_since, allowances, inflations, one_sided, cusum_limits,
    glr_limits, innovations, drifts, whitened, tops, alarm,
):
    rows, size, unknowns = residual.size, signatures.shape[1], columns.shape[1] - 1
    u, projected = np.zeros(unknowns), np.zeros(unknowns)
    order = past.size
    levels, places = ring_filled.size, ring_sums.shape[1]
    for k in range(begin, rows):
        state = state_of_row[k]
        if state >= GAP:
            counts[0] = 0
        innovations[k], drifts[k], tops[k] = np.nan, 0.0, 0.0
        if steps[k] > 0.0:
            age[0] = pass_time(amplitudes, covariance, followed // 2, steps[k], age[0], WANDER)
        if residual[k] != residual[k]:
            counts[0] = 0
            counts[2] = 0
            for j in range(whitened.shape[1]):
                whitened[k, j] = 0.0
            continue
        seen = counts[0]
        spread = spreads[seen] * spread_of_row[k]
        expected = whiten(coefficients, past, seen)
        known = drift = 0.0
        for j in range(unknowns):
            u[j] = (columns[k, j] - whiten(coefficients, past_columns[j], seen)) / spread
            remember(past_columns[j], columns[k, j])
            known += u[j] * amplitudes[j]
            if j >= unknowns - followed:
                drift += u[j] * amplitudes[j]
        wide = math.sqrt(1.0 + max(project(covariance, u, projected), 0.0) + columns[k, unknowns] ** 2)
        e = ((residual[k] - expected) / spread - known) / wide
        score = min(max(e, -clip), clip)
        for j in range(size):
            z = (signatures[k, j] - whiten(coefficients, past_signatures[j], seen)) / (spread * wide)
            whitened[k, j] = z
            remember(past_signatures[j], signatures[k, j])
        for j in range(size, whitened.shape[1]):
            lag = j - size
            whitened[k, j] = alarm[8 + lag] if counts[2] > lag else 0.0
        remember(past, expected + (known + score * wide) * spread)
        counts[0] = min(seen + 1, order)
        innovations[k], drifts[k] = e, drift / wide
        for lag in range(whitened.shape[1] - size - 1, 0, -1):
            alarm[8 + lag] = alarm[7 + lag]
        alarm[8] = score
        counts[2] = min(counts[2] + 1, 8)
        if state % GAP != 0:
            continue
        learn_unknown(amplitudes, covariance, projected, wide, score)
        counts[1] += 1
        n = counts[1]
        top, which, length, value = 0.0, -1, 0, 0.0
        mild = min(max(e, -quiet_clip), quiet_clip)
        square = mild * mild
        for c in range(4):
            gain = score - LEVEL_REFERENCE
            if c == 1:
                gain = -score - LEVEL_REFERENCE
            elif c == 2:
                gain = square - LOUD_REFERENCE
            elif c == 3:
                # what might have been off and was not is no quieter noise
                gain = QUIET_REFERENCE - min(e * e * wide * wide, quiet_clip * quiet_clip)
            cusums[c] = cusum_step(cusums[c], gain)
            if cusums[c] == 0.0:
                cusum_since[c] = n
            ratio = cusums[c] / cusum_limits[c]
            if ratio > top and n - cusum_since[c] >= SHORTEST:
                top, which, length, value = ratio, c, n - cusum_since[c], cusums[c]
        for j in range(whitened.shape[1]):
            z = whitened[k, j]
            sums[j] += z * score
            informations[j] += z * z
        step = 1
        for level in range(levels):
            if n % step:
                break
            filled = ring_filled[level]
            shortest = SHORTEST if level == 0 else 4
            for w in range(shortest, places):
                if w > filled:
                    break
                place = (filled - w) % places
                for j in range(whitened.shape[1]):
                    score_j = sums[j] - ring_sums[level, place, j]
                    if one_sided[j] and score_j < 0.0:
                        continue
                    information = informations[j] - ring_informations[level, place, j]
                    # what the sums over all rows have lost is no knowledge of these
                    if information <= FAINT * (abs(informations[j]) + abs(ring_informations[level, place, j])):
                        continue
                    variance = window_variance(information, allowances[j], inflations[j])
                    limit = glr_limits[j]
                    # no division: it takes as long as all the rest, and almost no window leads
                    if score_j * score_j > top * top * limit * limit * variance:
                        value = score_j * score_j / variance
                        top, which, length = math.sqrt(value) / limit, 4 + j, w * step
            place = filled % places
            for j in range(whitened.shape[1]):
                ring_sums[level, place, j] = sums[j]
                ring_informations[level, place, j] = informations[j]
            ring_filled[level] = filled + 1
            step *= 2
        if n % REBASED == 0:
            for j in range(whitened.shape[1]):
                for level in range(levels):
                    for place in range(places):
                        ring_sums[level, place, j] -= sums[j]
                        ring_informations[level, place, j] -= informations[j]
                sums[j], informations[j] = 0.0, 0.0
        tops[k] = top
        if top >= 1.0:
            alarm[0], alarm[1], alarm[2], alarm[3] = k, which, length, value
            return k
    return -1
"""


@cache
def detector_run() -> Callable[..., int]:
    """Return the compiled run over a stretch of rows, from `begin` to the first alarm (its row) or the end (-1)."""
    numbers = {
        "GAP": 16, "SHORTEST": SHORTEST, "LEVEL_REFERENCE": LEVEL_REFERENCE, "LOUD_REFERENCE": LOUD_REFERENCE,
        "QUIET_REFERENCE": QUIET_REFERENCE, "FAINT": FAINT, "REBASED": REBASED, "WANDER": WANDER,
    }  # fmt: skip
    head = "\n".join(f"{name} = {value!r}" for name, value in numbers.items())
    text = sources([whiten, remember, cusum_step, window_variance, project, learn_unknown, pass_time])
    return generated("watch", f"{text}\n\n{head}\n{_RUN}").run
