"""Measurements by others."""

from pathlib import Path

import numpy as np
import pytest

from bender_identify.identification import identify
from bender_identify.identification_result import Identification
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_loop.records.record import read_record
from bender_plant.model import load_model


@pytest.fixture(scope="module")
def stack(measured_data: Path) -> Identification:
    settings = Settings(library="paper", ensemble=0, held_out_share=0.5)
    experiment = experiment_of(read_record(measured_data / "piezo_stack_1Hz.csv"), "piezo_stack_1Hz.csv", settings)
    return identify([experiment], load_model("paper"), settings, np.random.default_rng(0))


@pytest.mark.slow
def test_a_piezo_stack_is_met_by_an_operator(stack: Identification) -> None:
    rows = {row.candidate.id: row for row in stack.rows}
    assert rows["prandtl_ishlinskii"].held_out.error_percent <= 2.5
    assert rows["prandtl_ishlinskii"].remanent
    assert 0.2 < stack.floor_percent < rows["prandtl_ishlinskii"].held_out.error_percent
    assert rows["prandtl_ishlinskii"].held_out.rms_um < rows["first_order_lag"].held_out.rms_um


def test_the_first_cycle_is_set_aside_and_the_offset_found(stack: Identification) -> None:
    experiment = stack.experiments[0]
    assert np.flatnonzero(experiment.fitted)[1] == pytest.approx(200, abs=2)
    assert not experiment.in_motion
    assert stack.written.candidate.fit.offset_um == pytest.approx(-123.0, abs=7.0)


def test_one_frequency_cannot_separate_relaxation_from_hysteresis(stack: Identification) -> None:
    assert any("one frequency (1 Hz) at one amplitude" in x and "hysteresis" in x for x in stack.findings)
    assert any(x.startswith("collinear: in these records |w| does what w does") for x in stack.findings)


def test_the_papers_own_actuator_has_no_times(measured_data: Path) -> None:
    settings = Settings(ensemble=0, held_out_share=0.2)
    record = read_record(measured_data / "paper_fig8.csv")
    experiment = experiment_of(record, "paper_fig8.csv", settings, untimed=True)
    outcome = identify([experiment], load_model("paper"), settings, np.random.default_rng(0))
    assert "first_order_lag" not in {row.candidate.id for row in outcome.rows}
    assert all("'" in term for term in outcome.learned.terms)
    assert outcome.written.fitted.error_percent < 6.0
