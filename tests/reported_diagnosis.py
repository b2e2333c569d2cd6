"""Diagnoses put together by hand, without a search: quick, and told of whatever hypotheses a test wants."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bender_compiled.simulation import Drive, Simulator
from bender_inference.candidates import candidate_forms
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.records.observations import observe
from bender_inference.search.archive import Archive
from bender_inference.search.judgement.grades import grade
from bender_inference.search.judgement.rules import Rules
from bender_inference.search.judgement.verdict import Verdict, Word
from bender_inference.search.result import SearchResult
from bender_inference.search.search import Searched
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model

NOISE_um = 0.06
FRAME_S = 1.0 / 30.0


def levels(duration_s: float = 20.0, seed: int = 1) -> np.ndarray:
    """A staircase up and down, then random levels, at 30 rows a second."""
    stairs = np.concatenate([np.arange(0.0, 51.0, 10.0), np.arange(40.0, -1.0, -10.0)]).repeat(20)
    rows = round(duration_s / FRAME_S)
    rest = np.random.default_rng(seed).uniform(0.0, 50.0, size=rows // 8 + 1).repeat(8)
    return np.concatenate([stairs, rest])[:rows]


def record_of(
    model: Model | str = "paper",
    effects: dict[str, dict[str, Any]] | None = None,
    voltage_V: np.ndarray | None = None,
    seed: int = 7,
    gain: float = 1.0,
    offset_um: float = 0.0,
    linear: bool = False,
) -> Record:
    """What a camera sees of a plant with effects that the model does not have."""
    plant = load_model(model) if isinstance(model, str) else model
    for effect, parameters in (effects or {}).items():
        plant = plant.with_block(effect, **parameters)
    volts = levels() if voltage_V is None else voltage_V
    time_s = FRAME_S * np.arange(volts.size, dtype=np.float64)
    reading_um = Simulator(Drive.of_rows(time_s, volts, linear=linear)).run(plant).reading_um
    noise_um = NOISE_um * np.random.default_rng(seed).standard_normal(volts.size)
    return Record(time_s, volts, gain * reading_um + offset_um + noise_um)


def hypothesis(base: Model, records: Sequence[Record], *parts: tuple[str, tuple[float, ...]]) -> Hypothesis:
    """The forms with these names and values, on top of each other."""
    forms = {form.name: form for form in candidate_forms(base, [observe(record) for record in records])}
    found = Hypothesis()
    for name, values in parts:
        found = found.plus(forms[name], values)
    return found


def told(
    records: Sequence[Record],
    best: Hypothesis | None = None,
    rivals: Sequence[Hypothesis] = (),
    word: Word = "named",
    base: Model | None = None,
    settings: Settings | None = None,
    sensor_step_um: float = 0.0,
    refit: bool = True,
) -> SearchResult:
    """The diagnosis of a search that ended with these hypotheses, each fitted from where it stands."""
    model, how = base or load_model("paper"), settings or Settings()
    observations = tuple(observe(record, how.linear, how.untimed) for record in records)
    observations = tuple(replace(x, half_step_um=sensor_step_um / 2.0) for x in observations)
    bench = problem_of(model, observations)

    def fitted(chosen: Hypothesis) -> Fitted:
        found = fit(bench, chosen) if refit else judge(bench, chosen)
        assert found is not None
        return found

    start = fitted(Hypothesis())
    end = fitted(best) if best else start
    others = [fitted(rival) for rival in rivals]
    archive = Archive(bench, NOISE_um)
    archive.add([start, end, *others])
    found = Searched(archive, start, end)
    grades = grade(found, Rules(confidence=how.confidence))
    return SearchResult(model, tuple(records), found, grades, Verdict(word, "said by hand"), how, sensor_step_um)
