"""The forms of effects that a model can have, sized to what records span."""

from collections.abc import Sequence

import numpy as np

from bender_effects.catalogue import EFFECTS, forms
from bender_effects.effect import FULL_VOLTAGE_V, FULL_STROKE_um, Sizes
from bender_effects.form import Form
from bender_effects.rigs import is_piezo_bender
from bender_inference.fitting.fit_problem import COARSER, MOST_SUBSTEPS
from bender_inference.records.excitation import lowest_Hz
from bender_inference.records.observations import Observations
from bender_inference.records.ringing import first_resonance
from bender_inference.records.spectrum import bin_s
from bender_inference.settings import Settings
from bender_loop.records.sizes import LEAST_SPAN
from bender_plant.blocks.periodic_disturbance import Parameters as Swing
from bender_plant.blocks.periodic_disturbance import ringing_step_s
from bender_plant.model import Model
from bender_plant.parameter import ModelError
from bender_plant.plant import sub_step_bounds_s

# what an effect of the ringing is sized by in a model that has none
WITHOUT_MODES_Hz, USUAL_S = 100.0, 50.0


def eligible(candidates: Sequence[Form], settings: Settings) -> tuple[Form, ...]:
    """Return the forms whose names the records can support."""
    return tuple(form for form in candidates if not (settings.untimed and form.timed))


def affordable(base: Model, candidates: Sequence[Form], observations: Sequence[Observations]) -> tuple[Form, ...]:
    """Return the forms that can be simulated over the records: one that needs the ringing in full may not be."""
    duration = sum(float(np.ptp(x.time_s)) for x in observations)
    return tuple(x for x in candidates if duration < COARSER * MOST_SUBSTEPS * _longest_step_s(base, x))


def too_long(base: Model, observations: Sequence[Observations]) -> str:
    """Return the refusal of records that last longer than any form can be simulated."""
    step_s = sub_step_bounds_s(base)[1]
    duration_s = sum(float(np.ptp(x.time_s)) for x in observations)
    return (
        f"records: found {duration_s:.4g} s to search, in sub-steps of {step_s:.2g} s as the model {base.name} needs, "
        f"expected less than {COARSER * MOST_SUBSTEPS * step_s:.2g} s; give a part of them, or a model without such a "
        "quick memory, or say --untimed where every row is a settled pair"
    )


def _fits(base: Model, form: Form) -> bool:
    """Return whether the model can have the form: what changes the ringing needs a model that rings."""
    try:
        _longest_step_s(base, form)
    except ModelError:
        return False
    return True


def _longest_step_s(base: Model, form: Form) -> float:
    values = tuple(free.starts[0] if free.starts else free.high for free in form.free)
    return sub_step_bounds_s(form.apply(base, form.of_record(values, 0)))[1]


def candidate_forms(base: Model, observations: Sequence[Observations]) -> tuple[Form, ...]:
    """Return the forms, sized to what the records span until their last row."""
    span = max(float(np.max(np.abs(x.drive.voltage_V))) for x in observations)
    stroke = _stroke_um(observations)
    duration = max(float(x.time_s[-1]) for x in observations)
    highest_Hz = max(0.5 / float(np.median(np.diff(x.time_s))) for x in observations)
    first_Hz, damping_ratio = first_resonance(base) or (WITHOUT_MODES_Hz, 0.0)
    lowest = min(_lowest_Hz(x) for x in observations)
    line_Hz = _quickest_line_Hz(observations, highest_Hz)
    ends = [y for x in observations for y in (float(np.min(x.command_V)), float(np.max(x.command_V)))]
    furthest = max(ends, key=abs)
    film = is_piezo_bender(base)
    sizes = Sizes(span, stroke, duration, first_Hz, film, highest_Hz, damping_ratio, lowest, line_Hz, furthest)
    own = len(observations)
    found = forms_for(base, sizes)
    return tuple(x.for_each_of(own) if EFFECTS[x.effect].stage == "surroundings" else x for x in found)


def _stroke_um(observations: Sequence[Observations]) -> float:
    """Return how far the readings go that count; of those that stand still there, how far all go, and never nought."""
    counted = max(float(np.ptp(x.measured_um[x.usable])) for x in observations)
    every = max(float(np.ptp(x.measured_um[np.isfinite(x.measured_um)])) for x in observations)
    return next((x for x in (counted, every) if x >= LEAST_SPAN), FULL_STROKE_um)


def _quickest_line_Hz(observations: Sequence[Observations], highest_Hz: float) -> float:
    """Return the frequency of the quickest disturbance that the rows show and that a sensor that lags can follow."""
    shown_Hz = max(0.5 / bin_s(x.time_s) for x in observations)
    of_one_Hz_s = ringing_step_s(Swing(sine_um=1.0, frequency_Hz=1.0), None)
    # half of what may be simulated: the steps that every jump of the command needs come on top
    most_steps = 0.5 * COARSER * MOST_SUBSTEPS
    followed_Hz = most_steps * of_one_Hz_s / sum(float(np.ptp(x.time_s)) for x in observations)
    return max(highest_Hz, min(shown_Hz, followed_Hz))


def _lowest_Hz(x: Observations) -> float:
    command_V = x.command_V
    before_V = 0.0 if x.start == "rest" else x.rest_before_V
    return lowest_Hz(x.drive.command_time_s[-command_V.size :], command_V, before_V)


def forms_for(base: Model, sizes: Sizes) -> list[Form]:
    """Return the forms that a model can have, sized so."""
    present = {settings.id for settings in base.blocks} - {"bending_modes", "calibration"}
    found = [x for x in forms(sizes) if x.effect not in present and _fits(base, x)]
    if "linear_transduction" in present:
        # beside a linear actuator a linear part of an effect is a gain once more
        found = [x.holding("reversible_linear_um_per_V", 0.0) for x in found]
    return found


def tried_first(base: Model) -> list[Model]:
    """Return the model, and with each form in it: their kernels are the same for records of any size."""
    first_Hz, damping_ratio = first_resonance(base) or (WITHOUT_MODES_Hz, 0.0)
    sizes = Sizes(FULL_VOLTAGE_V, FULL_STROKE_um, USUAL_S, first_Hz, is_piezo_bender(base), damping_ratio=damping_ratio)
    forms = forms_for(base, sizes)
    starts = ([free.starts[0] if free.starts else free.high for free in x.free] for x in forms)
    return [base, *(x.apply(base, tuple(y)) for x, y in zip(forms, starts, strict=True))]
