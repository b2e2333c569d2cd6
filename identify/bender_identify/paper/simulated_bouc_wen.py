"""The paper's simulated Bouc-Wen model, learned back: the figure to reach.

    w' = alpha u' - beta |u'| w - gamma u' |w|,    alpha = 10, beta = 0.75, gamma = 0.5, u = sin t

Errors are those of a re-simulation, on the input that was trained on and on one that was not.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bender_compiled.simulation import Simulator
from bender_identify.fitting.candidate import Candidate
from bender_identify.records.experiment import experiment_of
from bender_identify.records.voltage_path import drive_of, even_times
from bender_identify.regression.equation_search import learn
from bender_identify.settings import Settings
from bender_loop.records.record import Record
from bender_plant.blocks import BLOCKS
from bender_plant.kernels.bouc_wen import along
from bender_plant.model import BlockSettings, Model

Array = NDArray[np.float64]
Voltage = Callable[[Array], Array]

ALPHA, BETA, GAMMA = 10.0, 0.75, 0.5
DURATION_S = 30.0


def one_tone(time_s: Array) -> Array:
    """The training input, sin t."""
    return np.sin(time_s)


def two_tones(time_s: Array) -> Array:
    """An input that is never trained on, 2 sin 0.3 t + sin 1.7 t."""
    return 2.0 * np.sin(0.3 * time_s) + np.sin(1.7 * time_s)


def three_tones(time_s: Array) -> Array:
    """A training input for noisy readings: three tones that share no period."""
    return 1.2 * np.sin(0.5 * time_s) + 0.7 * np.sin(1.3 * time_s) + 0.4 * np.sin(2.9 * time_s)


def growing_tone(time_s: Array) -> Array:
    """A training input for noisy readings: one tone whose amplitude grows to 2 V in a minute."""
    return np.sin(time_s) * time_s / 30.0


def two_tones_rate(time_s: Array) -> Array:
    """The derivative of `two_tones`."""
    return 0.6 * np.cos(0.3 * time_s) + 1.7 * np.cos(1.7 * time_s)


def truth(voltage: Voltage, time_s: Array) -> Array:
    """Return w (n,) at rows: the closed form along every monotone stretch, cut at the turning points of the voltage."""
    instants = np.union1d(time_s, _turning_points(voltage, time_s))
    u = voltage(instants)
    w = np.zeros_like(u)
    for k in range(1, len(u)):
        w[k] = along(float(w[k - 1]), float(u[k] - u[k - 1]), ALPHA, BETA, GAMMA, 1.0)
    return w[np.searchsorted(instants, time_s)]


def _turning_points(voltage: Voltage, time_s: Array) -> Array:
    """Return where the voltage turns, by golden sections around the extremes of a dense grid."""
    from scipy.optimize import minimize_scalar

    dense = np.linspace(time_s[0], time_s[-1], 20 * len(time_s) + 1)
    steps = np.diff(voltage(dense))
    found = []
    for k in np.flatnonzero(steps[1:] * steps[:-1] < 0.0):
        sign = math.copysign(1.0, steps[k])
        solution = minimize_scalar(
            lambda t, sign=sign: -sign * float(voltage(np.array([t]))[0]),
            bounds=(dense[k], dense[k + 2]), method="bounded", options={"xatol": 1e-13},
        )  # fmt: skip
        found.append(float(solution.x))
    return np.array(found)


def equation_29_percent(truth_um: Array, simulated_um: Array) -> float:
    """Return the paper's (29), the ratio of the norms."""
    return 100.0 * float(np.linalg.norm(truth_um - simulated_um) / np.linalg.norm(truth_um))


def squared_percent(truth_um: Array, simulated_um: Array) -> float:
    """Return the ratio of the mean squares, which is what the paper's number is."""
    return 100.0 * float(np.mean((truth_um - simulated_um) ** 2) / np.mean(truth_um**2))


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of a re-simulation, in percent.

    Attributes:
        squared: mean square over mean square, on the training input.
        trained: (29) on the training input.
        unseen: (29) on two tones that were never trained on.
    """

    squared: float
    trained: float
    unseen: float


def nothing_else() -> Model:
    """Return a base model with nothing but a transducer."""
    return Model("simulated", None, (BlockSettings("sparse_equation", BLOCKS["sparse_equation"].parameters()),))


@threadpool_limits.wrap(limits=1)
def learn_bouc_wen(
    row_s: float,
    noise_percent: float,
    rng: np.random.Generator,
    voltages: Sequence[Voltage] = (one_tone,),
    duration_s: float = DURATION_S,
) -> tuple[Errors, Candidate]:
    """Learn from simulated rows with the Bouc-Wen library and refine by simulation.

    Args:
        row_s: distance of the rows.
        noise_percent: rms of white noise on the readings, over their rms.
        rng: draws the noise.
        voltages: what is trained on, one record each.
        duration_s: length of each training record.

    Returns:
        the errors against the truth without noise, and the model.
    """
    time_s = even_times(row_s, round(duration_s / row_s) + 1)
    settings = Settings(library="bouc_wen", ensemble=0)
    records = noisy_records(time_s, noise_percent, rng, voltages)
    experiments = [
        experiment_of(record, voltage.__name__, settings, "smooth").fitting_all()
        for record, voltage in zip(records, voltages, strict=True)
    ]
    truths = [truth(voltage, time_s) for voltage in voltages]
    candidate = learn(experiments, nothing_else(), settings, rng).candidate
    w = np.concatenate(truths)
    trained = np.concatenate([simulated(candidate.model, voltage, time_s) for voltage in voltages])
    unseen_s = even_times(row_s, round(DURATION_S / row_s) + 1)
    unseen = simulated(candidate.model, two_tones, unseen_s)
    return Errors(
        squared_percent(w, trained),
        equation_29_percent(w, trained),
        equation_29_percent(truth(two_tones, unseen_s), unseen),
    ), candidate


def noisy_records(
    time_s: Array, noise_percent: float, rng: np.random.Generator, voltages: Sequence[Voltage]
) -> list[Record]:
    """Return one record for each voltage, with white noise of this part of the rms of its readings."""
    records = []
    for voltage in voltages:
        w = truth(voltage, time_s)
        noise = 0.01 * noise_percent * float(np.sqrt(np.mean(w * w))) * rng.standard_normal(len(w))
        records.append(Record(time_s, voltage(time_s), w + noise))
    return records


def simulated(model: Model, voltage: Voltage, time_s: Array) -> Array:
    """Return the readings (n,) of a model under a smooth voltage, from rest."""
    record = Record(time_s, voltage(time_s), np.zeros_like(time_s))
    drive, _ = drive_of(record, "smooth", None, False)
    return Simulator(drive).run(model).reading_um
