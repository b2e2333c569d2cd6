"""A sampled model as matrices of few states: balanced realisation of its pulse response.

Kung's method (12th Asilomar Conference, 1978): the Hankel matrix of the pulse response, shifted by one sample, in the
coordinates of its largest singular vectors. A tail that falls slowly, or not at all, is one state of its own.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_tuner.model.sampled_model import SampledModel

TOLERANCE = 1e-4
"""Largest error of the frequency response, as a share of its largest value over the grid that is compared."""
MOST_STATES = 60
_SLOW_TAIL = 1e-3
_GONE = 1e-9
_DENSE = 400
_COMPARED = 2048

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class StateSpace:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k]; the displacement in µm, the command in V.

    Attributes:
        period_s: sampling period.
        A: shape (n, n).
        B: shape (n, 1).
        C: shape (1, n).
        error: largest difference from the frequency response of the model, as a share of its largest value.
    """

    period_s: float
    A: Matrix
    B: Matrix
    C: Matrix
    error: float


def realise(model: SampledModel, latency_frames: int = 0) -> StateSpace:
    """Return the model, read `latency_frames` late, with the fewest states that keep to `TOLERANCE`."""
    pulse = np.concatenate((np.zeros(latency_frames), model.pulse_um_per_V))
    late = SampledModel(model.period_s, pulse, model.tail_ratio)
    omega = np.pi / model.period_s * np.geomspace(1e-4, 1.0, _COMPARED)
    wanted = late.frequency_response(omega)
    pulse, tail = _without_tail(late)
    values, vectors = _hankel_modes(pulse)
    found, error = None, np.inf
    for order in range(1, values.size + 1):
        found = _with_tail(_balanced(values[:order], vectors[:, :order]), tail)
        error = float(np.max(np.abs(_response(found, omega * model.period_s) - wanted)) / np.max(np.abs(wanted)))
        if error <= TOLERANCE:
            break
    assert found is not None
    return StateSpace(model.period_s, *found, error)


def _without_tail(model: SampledModel) -> tuple[Matrix, tuple[float, float] | None]:
    """(a pulse response that dies out, (first value, ratio) of a slow geometric one that was taken from it)."""
    pulse, ratio = model.pulse_um_per_V, model.tail_ratio
    if ratio == 0.0:
        return pulse, None
    samples = np.arange(1 - pulse.size, 1)
    if ratio ** (pulse.size - 1) > _SLOW_TAIL:
        tail = pulse[-1] * ratio**samples
        return pulse - tail, (float(tail[0]), ratio)
    further = math.ceil(math.log(_GONE) / math.log(ratio))
    return np.concatenate((pulse, pulse[-1] * ratio ** np.arange(1, further + 1))), None


def _hankel_modes(pulse: Matrix) -> tuple[Matrix, Matrix]:
    """Eigenvalues, largest magnitude first, and vectors of the symmetric Hankel matrix, zero after the pulse's end."""
    size = pulse.size
    if size <= _DENSE:
        from scipy.linalg import hankel

        values, vectors = np.linalg.eigh(hankel(pulse))
    else:
        from scipy.signal import fftconvolve
        from scipy.sparse.linalg import LinearOperator, eigsh

        def times(x: Matrix) -> Matrix:
            return fftconvolve(pulse, np.ravel(x)[::-1])[size - 1 :]

        operator = LinearOperator((size, size), matvec=times, dtype=float)  # pyright: ignore[reportCallIssue]
        values, vectors = eigsh(operator, k=MOST_STATES, which="LM", v0=np.ones(size))
    order = np.argsort(-np.abs(values))
    kept = order[np.abs(values[order]) > 1e-13 * np.abs(values[order[0]])][:MOST_STATES]
    return values[kept], vectors[:, kept]


def _balanced(values: Matrix, vectors: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    root, signs = np.sqrt(np.abs(values)), np.sign(values)
    # H = (vectors root) (root signs vectors^T); the shifted matrix is H with its rows moved up by one
    observed = vectors * root
    moved = np.vstack((observed[1:], np.zeros((1, root.size))))
    A = (vectors / root).T @ moved
    return A, (observed[0] * signs)[:, None], observed[:1]


def _with_tail(found: tuple[Matrix, Matrix, Matrix], tail: tuple[float, float] | None) -> tuple[Matrix, Matrix, Matrix]:
    if tail is None:
        return found
    A, B, C = found
    first, ratio = tail
    larger = np.zeros((A.shape[0] + 1, A.shape[0] + 1))
    larger[:-1, :-1], larger[-1, -1] = A, ratio
    return larger, np.vstack((B, [[first]])), np.hstack((C, [[1.0]]))


def _response(found: tuple[Matrix, Matrix, Matrix], phase: Matrix) -> NDArray[np.complex128]:
    A, B, C = found
    z = np.exp(1j * phase)[:, None, None]
    states = np.linalg.solve(z * np.eye(A.shape[0]) - A, B.astype(complex)[None])
    return np.asarray(C @ states, dtype=complex)[:, 0, 0]
