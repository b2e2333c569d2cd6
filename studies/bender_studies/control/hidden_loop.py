"""A bench of `bender_proving` in a closed loop, in virtual time, with any controller."""

from typing import Any, Protocol

import numpy as np

from bender_loop.control.plant import SavablePlant, restart
from bender_loop.control.references import Reference
from bender_loop.records.record import Array, Record
from bender_proving import NOISE_UM, Bench, Case
from bender_proving.records.excitation import Excitation

WINDOW_ROWS, MOST_ROWS = 15, 240
"""So many samples are brought to agree at a time: at first, and at most where they do in a few rounds."""
FEW_ROUNDS, MANY_ROUNDS = 7, 12
AGREE_V = 1e-5


class Controller(Protocol):
    """A controller as a pure step."""

    def rest(self) -> Any:
        """Return the state before the first sample."""
        ...

    def step(self, state: Any, time_s: float, reading_um: float) -> tuple[Any, float]:
        """Return the state after a sample, and the command in V."""
        ...


def run_hidden(
    case: Case,
    controller: Controller,
    reference: Reference,
    rate_Hz: float,
    duration_s: float,
    seed: int | None,
    like: SavablePlant,
) -> Record:
    """Run the loop from rest; the displacement of the record is the true one, without noise.

    The bench has no state to step on from: it computes a whole record from rest. So the commands of a window are
    guessed, the bench answers them, the controller answers the bench, and this is repeated until the commands of the
    window stay what they are (waveform relaxation: E. Lelarasmee, A. Ruehli and A. Sangiovanni-Vincentelli, IEEE
    Transactions on Computer-Aided Design 1 (1982) 131-145). While a round changes commands, the answer of the bench is
    moved by as much as that of a plant that can be stepped on, which a play, hysteresis or a limit of the bench makes
    do as it does itself (deferred correction: V. Pereyra, Numerische Mathematik 10 (1967) 316-323). Once the commands
    stay, that moves nothing: how near the plant is to the bench decides how many rounds it takes and nothing else. A
    bench is causal, so after as many rounds as the window has samples they stay whatever the plant is. A window is as
    long as a few rounds allow.

    Args:
        case: what is hidden.
        controller: asked at every sample.
        reference: set-points, for the record.
        rate_Hz: samples per second.
        duration_s: of the loop.
        seed: of the noise that the controller sees, None for none.
        like: a model of the bench; left anywhere.
    """
    bench, count = Bench(case), max(2, round(duration_s * rate_Hz))
    time_s = np.arange(count + 1) / rate_Hz
    volts, tips = np.zeros(count + 1), np.full(count, np.nan)
    noise = noise_um(case, seed, count)
    restart(like)
    state, begin, window, begun = controller.rest(), 0, WINDOW_ROWS, like.save()
    while begin < count:
        end, after, rounds = min(begin + window, count), state, 0
        answered = _answers_um(like, begun, volts[begin:end], 1.0 / rate_Hz)
        while rounds <= window:
            rounds += 1
            tips[begin:end] = bench.clean(Excitation(case.sensor, time_s[: end + 1], volts[: end + 1]))[begin:end]
            before, after, beyond = volts[begin:end].copy(), state, tips[begin:end] - answered
            like.restore(begun)
            answered = np.empty(end - begin)
            for k in range(begin, end):
                answered[k - begin] = like.read() if k == begin else like.step(float(volts[k - 1]), 1.0 / rate_Hz)
                reading_um = float(beyond[k - begin] + answered[k - begin] + noise[k])
                after, volts[k] = controller.step(after, float(time_s[k]), reading_um)
            volts[end:] = volts[end - 1]
            if np.allclose(volts[begin:end], before, rtol=0.0, atol=AGREE_V):
                break
        like.step(float(volts[end - 1]), 1.0 / rate_Hz)
        state, begin, begun = after, end, like.save()
        if rounds <= FEW_ROUNDS:
            window = min(2 * window, MOST_ROWS)
        elif rounds >= MANY_ROUNDS:
            window = max(window // 2, 1)
    rows = slice(0, count)
    return Record(time_s[rows], volts[rows], tips, setpoint_um=reference.sample(time_s[rows]))


def _answers_um(like: SavablePlant, begun: object, volts: Array, period_s: float) -> Array:
    """Return what a plant reads at each sample of a window before the command of that sample acts."""
    like.restore(begun)
    return np.array([like.read(), *(like.step(float(x), period_s) for x in volts[:-1])])


def noise_um(case: Case, seed: int | None, count: int) -> Array:
    """Return the noise of the readings of a run, zeros without a seed."""
    return np.zeros(count) if seed is None else np.random.default_rng(seed).normal(0.0, NOISE_UM[case.sensor], count)


def rms_um(record: Record, from_s: float = 0.0) -> float:
    """Return the rms of the true displacement from the set-point, from an instant on."""
    if record.setpoint_um is None:
        raise ValueError("setpoint_um must be there, found None")
    error: Array = (record.displacement_um - record.setpoint_um)[record.time_s >= from_s]
    return float(np.sqrt(np.mean(error**2)))
