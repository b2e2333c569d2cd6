"""What a tuning starts from, and what it refuses to write."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_loop.errors import InputError
from bender_tuner.model.linear_model import settle
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.model.reduced_model import reduce_model
from bender_tuner.model.sampled_model import model_from_step
from bender_tuner.model.scaled_plant import ScaledPlant
from bender_tuner.results.tuning_file import FmuFacts
from bender_tuner.task.problem import pose_problem
from bender_tuner.task.session import run_session, write_results
from bender_tuner.task.settings import make_settings
from bender_tuner.task.tuning import Ended


class Late:
    """A static gain that rings and creeps behind a dead time, each part a closed form of the time since a change."""

    def __init__(self, delay_s: float, creep: float = 0.0, ringing: float = 0.0, offset_um: float = 0.0) -> None:
        self.delay_s, self.creep, self.ringing, self.offset_um = delay_s, creep, ringing, offset_um
        self.reset()

    def set_parameters(self, parameters: object, /) -> None:
        del parameters

    def reset(self) -> None:
        self.time_s, self.changes, self.last_V = 0.0, [], 0.0

    def read(self) -> float:
        return self.offset_um + sum(change * self._answer(self.time_s - at) for at, change in self.changes)

    def step(self, voltage_V: float, step_s: float) -> float:
        if voltage_V != self.last_V:
            self.changes.append((self.time_s, voltage_V - self.last_V))
            self.last_V = voltage_V
        self.time_s += step_s
        return self.read()

    def close(self) -> None:
        pass

    def _answer(self, since_s: float) -> float:
        t = since_s - self.delay_s
        if t <= 0.0:
            return 0.0
        rings = self.ringing * math.exp(-13.0 * t) * math.cos(655.0 * t)
        return 1.0 - rings + self.creep * -math.expm1(-t / 20.0)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 0.2), st.floats(0.0, 0.5), st.sampled_from([30.0, 100.0, 300.0]))
def test_the_dead_time_is_that_of_the_first_answer_whatever_creeps_behind_it(delay_s: float, creep: float, rate: float):
    plant, period = Late(delay_s, creep), 1.0 / rate
    plant.reset()
    response = [0.0, *(plant.step(1.0, period) for _ in range(round(10.0 * rate)))]
    found = reduce_model(model_from_step(period, np.array(response)), 1)
    assert found.delay_s == pytest.approx(2.5 * period + delay_s, abs=1.1 * period)


def test_a_plant_in_its_dead_time_is_not_at_rest():
    sampling = make_settings(rate_Hz=100.0, exposure_s=0.0).sampling
    for delay_s in (0.5, 3.0):
        assert settle(Late(delay_s), 10.0, sampling).displacement_um == pytest.approx(10.0)


def test_out_of_reach_says_whether_a_plant_still_moves_or_does_not_answer_at_all():
    given = make_settings(rate_Hz=10.0, exposure_s=0.0, setpoint_um=90.0, duration_s=2.0)
    with pytest.raises(InputError, match=r"out of reach within 10 s: .* between 0 and 6\d.\d+ µm and still moves"):
        pose_problem(Late(0.0, creep=1.0), given)
    with pytest.raises(InputError, match=r"does not answer within 10 s; check the names"):
        pose_problem(Late(30.0), given)


def test_what_a_plant_reads_at_rest_is_no_part_of_its_gain():
    scaled = ScaledPlant(Late(0.0, offset_um=20.0), 1.3)
    scaled.reset()
    assert scaled.read() == 20.0
    assert scaled.step(10.0, 0.1) == pytest.approx(20.0 + 1.3 * 10.0)


def test_a_search_starts_where_every_case_of_the_ensemble_holds():
    problem = pose_problem(Late(0.045, creep=0.2, ringing=0.9), make_settings(exposure_s=0.0, evaluations=1))
    peaks = [sensitivity_peak(problem.first_guess, case.delayed) for case in problem.ensemble.cases]
    assert max(peaks) < 2.0 * problem.settings.max_ms


def test_gains_that_break_their_bounds_are_not_written(tmp_path: Path):
    wanted = make_settings(
        exposure_s=0.0, max_ms=1.05, max_overshoot_percent=0.01, settle_within_s=0.05, evaluations=3, duration_s=1.0
    )
    plant = Late(0.045)
    facts = FmuFacts("late.fmu", "late", "", "", "voltage", "displacement", ())
    session = run_session(plant, facts, pose_problem(plant, wanted))  # pyright: ignore[reportArgumentType]
    assert session.ended is Ended.REFUSED
    assert len(session.searches[0].history) > wanted.evaluations, "the box has grown before"
    write_results(session, facts, tmp_path)
    assert not (tmp_path / "gains.toml").exists()
    assert (tmp_path / "tuning.json").exists()
