"""A bench of `bender_proving` in a closed loop, in virtual time, with any controller."""

from typing import Any, Protocol

import numpy as np

from bender_loop.control.references import Reference
from bender_loop.records.record import Array, Record
from bender_proving import NOISE_UM, Bench, Case
from bender_proving.records.excitation import Excitation

WINDOW_ROWS, MOST_ROWS = 15, 240
"""So many samples are brought to agree at a time: at first, and at most where they do in a few rounds."""
FEW_ROUNDS, MANY_ROUNDS = 7, 12
AGREE_V = 1e-5
_FROM_V, _STEP_V = 10.0, 5.0


class Controller(Protocol):
    """A controller as a pure step."""

    def rest(self) -> Any:
        """Return the state before the first sample."""
        ...

    def step(self, state: Any, time_s: float, reading_um: float) -> tuple[Any, float]:
        """Return the state after a sample, and the command in V."""
        ...


def run_hidden(
    case: Case, controller: Controller, reference: Reference, rate_Hz: float, duration_s: float, seed: int | None
) -> Record:
    """Run the loop from rest; the displacement of the record is the true one, without noise.

    The bench has no state to step on from: it computes a whole record from rest. So the commands of a window are
    guessed, the bench answers them, the controller answers the bench, and this is repeated until the commands of the
    window stay what they are (waveform relaxation: E. Lelarasmee, A. Ruehli and A. Sangiovanni-Vincentelli, IEEE
    Transactions on Computer-Aided Design 1 (1982) 131-145). While a round changes commands, the answer of the bench is
    moved by what a step of it has shown (waveform Newton). A bench is causal, so after as many rounds as the window
    has samples they stay. A window is as long as a few rounds allow.

    Args:
        case: what is hidden.
        controller: asked at every sample.
        reference: set-points, for the record.
        rate_Hz: samples per second.
        duration_s: of the loop.
        seed: of the noise that the controller sees, None for none.
    """
    bench, count = Bench(case), max(2, round(duration_s * rate_Hz))
    time_s = np.arange(count + 1) / rate_Hz
    volts, tips = np.zeros(count + 1), np.full(count, np.nan)
    noise = noise_um(case, seed, count)
    state, begin, window = controller.rest(), 0, WINDOW_ROWS
    answers = _answers_um_per_V(case, rate_Hz)
    while begin < count:
        end, after, rounds = min(begin + window, count), state, 0
        while rounds <= window:
            rounds += 1
            tips[begin:end] = bench.clean(Excitation(case.sensor, time_s[: end + 1], volts[: end + 1]))[begin:end]
            before, after, moved = volts[begin:end].copy(), state, np.zeros(end - begin)
            for k in range(begin, end):
                reading_um = float(tips[k] + noise[k] + moved[k - begin])
                after, volts[k] = controller.step(after, float(time_s[k]), reading_um)
                moved[k - begin + 1 :] += answers[: end - k - 1] * (volts[k] - before[k - begin])
            volts[end:] = volts[end - 1]
            if np.allclose(volts[begin:end], before, rtol=0.0, atol=AGREE_V):
                break
        state, begin = after, end
        if rounds <= FEW_ROUNDS:
            window = min(2 * window, MOST_ROWS)
        elif rounds >= MANY_ROUNDS:
            window = max(window // 2, 1)
    rows = slice(0, count)
    return Record(time_s[rows], volts[rows], tips, setpoint_um=reference.sample(time_s[rows]))


def _answers_um_per_V(case: Case, rate_Hz: float) -> Array:
    """Return by how much the next readings answer a command that stands for one sample, from a step of the bench."""
    bench, time_s = Bench(case), np.arange(2 * MOST_ROWS + 2) / rate_Hz
    held = np.full(time_s.size, _FROM_V)
    stepped = np.where(np.arange(time_s.size) < MOST_ROWS, _FROM_V, _FROM_V + _STEP_V)
    low, high = (bench.clean(Excitation(case.sensor, time_s, x)) for x in (held, stepped))
    return np.diff((high - low)[MOST_ROWS : 2 * MOST_ROWS + 1]) / _STEP_V


def noise_um(case: Case, seed: int | None, count: int) -> Array:
    """Return the noise of the readings of a run, zeros without a seed."""
    return np.zeros(count) if seed is None else np.random.default_rng(seed).normal(0.0, NOISE_UM[case.sensor], count)


def rms_um(record: Record, from_s: float = 0.0) -> float:
    """Return the rms of the true displacement from the set-point, from an instant on."""
    if record.setpoint_um is None:
        raise ValueError("setpoint_um must be there, found None")
    error: Array = (record.displacement_um - record.setpoint_um)[record.time_s >= from_s]
    return float(np.sqrt(np.mean(error**2)))
