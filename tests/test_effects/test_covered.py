"""What an effect calls covered, the search reaches: by the bounds of its forms, and by fits at both ends."""

import contextlib
import itertools
from typing import Any

import numpy as np
import pytest
from few import few_rows
from reported_diagnosis import FRAME_S, levels

from bender_compiled.simulation import Drive, Simulator
from bender_effects.catalogue import EFFECTS, Effect, Sizes
from bender_effects.form import Form
from bender_inference.candidates import candidate_forms
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import fit
from bender_inference.fitting.scans.chosen import scan_any
from bender_inference.records.digits import lattice_step_um
from bender_inference.records.observations import observe
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model
from bender_plant.parameter import ModelError, meanings

PAPER = load_model("paper")
SOUGHT = [effect for effect in EFFECTS.values() if not effect.found_by]
LAGGING = PAPER.with_block("plant_lag", time_constant_s=0.1, second_time_constant_s=0.04)
"""Some effects take over one lag of the model, or both."""
BENCHES = [
    Sizes(50.0, 23.1, 60.0, 104.4),
    Sizes(5.0, 2.0, 20.0, 104.4),
    Sizes(10.0, 3e4, 300.0, 5.0, piezo_bender=False),
    Sizes(500.0, 0.5, 2.0, 2000.0, piezo_bender=False),
]


def reached(effect: Effect, forms: tuple[Form, ...], name: str) -> tuple[float, float]:
    """The smallest and the largest size of a parameter of the block that the free numbers of the forms can give it."""
    sizes: list[float] = []
    for form in forms:
        ends = [(x.low, x.high, *((0.0,) if x.low < 0.0 < x.high else ())) for x in form.free]
        # of a form with many numbers, all at the same end, and each of the others at every end of its own
        choices = itertools.product(*ends) if len(form.free) <= 4 else [[x[k] for x in ends] for k in (0, 1, -1)]
        for values in choices:
            with contextlib.suppress(ModelError):
                value = getattr(block_of(form.apply(LAGGING, tuple(values)), effect.block.id), name)
                sizes += [abs(x) for x in (value if isinstance(value, tuple) else (value,))]
    return min(sizes), max(sizes)


def block_of(model: Model, block_id: str) -> Any:
    return next(x.parameters for x in model.blocks if x.id == block_id)


@pytest.mark.parametrize("bench", BENCHES, ids=["paper", "small", "metres", "nanometres"])
@pytest.mark.parametrize("effect", SOUGHT, ids=[effect.id for effect in SOUGHT])
def test_the_bounds_of_the_forms_contain_what_is_covered(effect: Effect, bench: Sizes):
    forms = effect.forms(bench)
    assert forms
    assert effect.covered
    for name in effect.covered:
        covered = effect.covered_range(name, bench.span_V, bench.stroke_um, piezo_bender=bench.piezo_bender)
        assert covered is not None
        low, high = reached(effect, forms, name)
        # a record shows that something is periodic once it has come back
        least = max(covered[0], 1.0 / bench.duration_s) if name == "frequency_Hz" else covered[0]
        assert low <= least * (1 + 1e-9), name
        assert high >= covered[1] * (1 - 1e-9), name


@pytest.mark.parametrize("effect", SOUGHT, ids=[effect.id for effect in SOUGHT])
@pytest.mark.parametrize("bench", BENCHES, ids=["paper", "small", "metres", "nanometres"])
def test_starts_and_bounds_are_values_that_the_block_takes(effect: Effect, bench: Sizes):
    for form in effect.forms(bench):
        assert form.effect == effect.id
        for free in form.free:
            assert free.low < free.high
            assert all(free.low <= start <= free.high for start in free.starts)
            if free.name in meanings(effect.block.parameters):
                bounds = meanings(effect.block.parameters)[free.name]
                assert bounds.low <= free.low < free.high <= bounds.high
        form.apply(LAGGING, tuple(free.starts[0] if free.starts else free.high for free in form.free))


def record_of(volts: np.ndarray, step_s: float, effect_id: str, parameters: dict[str, Any]) -> Record:
    time_s = step_s * np.arange(volts.size, dtype=np.float64)
    model = PAPER.with_block(effect_id, **parameters)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(model).reading_um
    return Record(time_s, volts, reading_um + 0.002 * np.random.default_rng(5).standard_normal(volts.size))


# parameter, further parameters, and the time between rows at the least and at the largest size
ENDS: list[tuple[str, str, list[dict[str, Any]], tuple[float, float]]] = [
    ("transport_delay", "delay_s", [{}, {}], (0.002, 0.02)),
    ("slew_limit", "slew_rate_V_per_s", [{}, {}], (FRAME_S, 0.0005)),
    ("supply_fall_lag", "time_constant_s", [{}, {}], (0.002, FRAME_S)),
    ("source_resistance", "time_constant_s", [{}, {}], (0.001, FRAME_S)),
    ("dead_zone", "threshold_V", [{}, {}], (FRAME_S, FRAME_S)),
    # 1 % of loss at full voltage is that of the rational form
    ("saturation", "scale_V", [{}, {"form": "rational"}], (FRAME_S, FRAME_S)),
    ("electrostriction", "coefficient_um_per_V2", [{}, {}], (FRAME_S, FRAME_S)),
    ("stiffening", "cubic_1_per_um2", [{}, {}], (FRAME_S, FRAME_S)),
    ("structural_damping", "damping_ratio", [{}, {}], (0.001, 0.001)),
    ("backlash", "half_width_um", [{}, {}], (FRAME_S, FRAME_S)),
    ("sensor_lag", "time_constant_s", [{}, {}], (0.001, FRAME_S)),
    ("lens_distortion", "quadratic_1_per_um", [{}, {}], (FRAME_S, FRAME_S)),
]
VOLTS = levels(20.0)


@pytest.mark.parametrize("end", [0, 1], ids=["least", "most"])
@pytest.mark.parametrize(("effect_id", "name", "further", "steps_s"), few_rows(ENDS, 0, 4, 8), ids=[x[0] for x in ENDS])
def test_a_fit_finds_both_ends_of_what_is_covered(
    effect_id: str, name: str, further: list[dict[str, Any]], steps_s: tuple[float, float], end: int
):
    size = EFFECTS[effect_id].covered[name][end]
    record = record_of(VOLTS, steps_s[end], effect_id, {name: size, **further[end]})
    bench = problem_of(PAPER, (observe(record),))
    forms = [x for x in candidate_forms(PAPER, bench.observations) if x.effect == effect_id]
    form = forms[1] if further[end] else forms[0]
    starts = scan_any(bench, Hypothesis(), form, 0.002)
    fits = [fit(bench, Hypothesis().plus(form, start.values)) for start in starts]
    best = min((x for x in fits if x is not None), key=lambda x: x.training_square)
    found = getattr(block_of(best.hypothesis.model(PAPER), effect_id), name)
    assert abs(found) == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize("end", [0, 1], ids=["least", "most"])
def test_the_lattice_of_the_readings_is_found_at_both_ends(end: int):
    step_um = EFFECTS["sensor_quantisation"].covered["step_um"][end]
    record = record_of(VOLTS, FRAME_S, "sensor_quantisation", {})
    assert lattice_step_um(step_um * np.round(record.displacement_um / step_um)) == pytest.approx(step_um, rel=1e-3)


@pytest.mark.parametrize("end", [0, 1], ids=["least", "most"])
@pytest.mark.parametrize("effect_id", ["gain_error", "offset"])
def test_gain_and_offset_are_solved_for_at_both_ends(effect_id: str, end: int):
    ((name, covered),) = EFFECTS[effect_id].covered.items()
    record = record_of(VOLTS, FRAME_S, "calibration", {name: covered[end]})
    bench = problem_of(PAPER, (observe(record),))
    readings = bench.readings(Hypothesis())
    assert readings is not None
    calibration = bench.calibrate(readings)
    found = calibration.gain if name == "gain" else calibration.offsets_um[0]
    assert found == pytest.approx(covered[end], rel=0.02, abs=2e-3)


@pytest.mark.parametrize("lacking_um", [1e-3, 0.3])
def test_a_lattice_is_found_in_readings_that_were_taken_apart_and_put_together(lacking_um: float) -> None:
    rng = np.random.default_rng(3)
    readings = 0.636138341974667 * np.round(rng.uniform(-20.0, 30.0, 4000) / 0.636138341974667)
    lacking = lacking_um * rng.standard_normal(readings.size)
    together = np.round(readings - lacking, 10) + lacking
    assert lattice_step_um(together) == pytest.approx(0.636138341974667, rel=1e-9)
    assert lattice_step_um(together[:3]) == 0.0
