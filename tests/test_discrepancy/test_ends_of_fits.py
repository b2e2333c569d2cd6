"""When a fit ends: of many numbers that leave structure no choice looks closely, where noise is left each counts."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from reported_diagnosis import levels, record_of

from bender_discrepancy.fitting.fit_problem import FitProblem, problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import WORTH, _is_structure, fit
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import candidate_forms
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
LOOP = {"form": "plays", "thresholds_V": (1.0, 3.0, 6.0), "weights_um_per_V": (0.2, 0.12, 0.06)}
FEW_NUMBERS, MANY_NUMBERS = "Bouc-Wen", "10 plays"


def looping(beside_um: float, form: str) -> tuple[FitProblem, Hypothesis]:
    """A loop, a slow swing beside it that no loop explains, and a form of hysteresis to fit."""
    plain = record_of(effects={"rate_independent_hysteresis": LOOP}, voltage_V=levels(60.0))
    swing_um = beside_um * np.sin(2.0 * np.pi * plain.time_s / 9.0)
    observations = (observe(Record(plain.time_s, plain.voltage_V, plain.displacement_um + swing_um)),)
    found = next(x for x in candidate_forms(PAPER, observations) if x.name == form)
    return problem_of(PAPER, observations), Hypothesis().plus(found, tuple(x.starts[0] for x in found.free))


def test_the_end_of_a_fit_is_no_worse_and_hardly_better() -> None:
    soon, late = (fit(*looping(3.0, MANY_NUMBERS), most_evaluations=60, closely=x) for x in (False, True))
    assert soon is not None
    assert late is not None
    assert (1.0 - 4.0 * WORTH) * soon.training_square <= late.training_square <= soon.training_square


@given(st.integers(0, 1000), st.floats(0.0, 0.95))
def test_structure_is_what_goes_from_one_row_to_the_next(seed: int, memory: float) -> None:
    """A residual whose rows depend on each other by a factor: half of its square goes on from one half."""
    rng = np.random.default_rng(seed)
    problem = cast("Any", SimpleNamespace(observations=[SimpleNamespace(training=np.ones(4000, bool))]))
    residual = np.zeros(4000)
    for k in range(1, 4000):
        residual[k] = memory * residual[k - 1] + rng.standard_normal()
    if abs(memory - 0.5) > 0.1:
        assert _is_structure(problem, residual) is (memory > 0.5)
