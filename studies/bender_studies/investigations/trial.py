"""One bench investigated in a process of its own, held to the truth.

The investigation sees the bench through its port alone. What it says is held to the case afterwards, and both sets of
gains to the bench without noise.
"""

import math
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from bender_proving import Case

MODEL = "paper"
MATTERS = 0.05
"""New gains that save this part of the cost on the bench without noise: the effect matters to the loop."""


@dataclass(frozen=True, slots=True)
class InvestigationTrial:
    """What came of one bench.

    Attributes:
        id, kind, truth, sensor: of the case.
        verdict, effects, complete, ended: of the investigation; verdict "error" where it failed.
        bench_s, total_s: bench time until the verdict and in all.
        plays: until the verdict.
        judgement: of the new gains; "" where they were not played.
        no_comparison: why not.
        saved: part of the old cost that the new gains save on the bench without noise; nan where none were tuned.
        beyond: what went beyond the limits.
        seconds: of wall time.
        error: what went wrong.
    """

    id: str
    kind: str
    truth: tuple[str, ...]
    sensor: str
    verdict: str = "error"
    effects: tuple[str, ...] = ()
    complete: bool = False
    ended: str = ""
    bench_s: float = math.nan
    total_s: float = math.nan
    plays: int = 0
    judgement: str = ""
    no_comparison: str = ""
    saved: float = math.nan
    beyond: tuple[str, ...] = field(default_factory=tuple)
    seconds: float = 0.0
    error: str = ""

    @property
    def is_right(self) -> bool:
        """Whether the verdict is the one that the kind of case asks for."""
        if self.kind == "nothing":
            return self.verdict in ("no_gap", "recalibrated") and not self.effects
        return self.verdict == "named" and set(self.effects) == set(self.truth)

    @property
    def matters(self) -> bool:
        """Whether new gains save something on the bench without noise."""
        return self.saved > MATTERS

    @property
    def is_false_praise(self) -> bool:
        """Whether gains were called better that are not."""
        return self.judgement == "better" and not self.saved > 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return it for a file, with what is judged."""
        return {**asdict(self), "right": self.is_right, "matters": self.matters}


def run_trial(case: Case, folder: Path, budget_s: float, old_gains: Path) -> InvestigationTrial:
    """Investigate one bench; what goes wrong is an answer too."""
    begin = time.perf_counter()
    found: dict[str, Any] = {"id": case.id, "kind": case.kind, "truth": case.effect_ids, "sensor": case.sensor}
    try:
        found |= _investigated(case, folder, budget_s, old_gains)
    except Exception as error:
        found["error"] = f"{type(error).__name__}: {error}"
    return InvestigationTrial(**found, seconds=time.perf_counter() - begin)


def _investigated(case: Case, folder: Path, budget_s: float, old_gains: Path) -> dict[str, Any]:
    from bender_inference.records.checks import read_model
    from bender_investigate.investigation import Investigation
    from bender_investigate.settings import InvestigationSettings
    from bender_proving import Bench
    from bender_studies.investigations.virtual_bench import VirtualBench
    from bender_tuner.results.gains_file import read_gains

    folder.mkdir(parents=True, exist_ok=True)
    bench = VirtualBench(case, case.seed)
    old = read_gains(old_gains)[0]
    given = ()
    if case.kind == "weak":
        hidden = Bench(case)
        given = (hidden.record(hidden.excitation(), hidden.noise()),)
    settings = InvestigationSettings(budget_s=budget_s)
    outcome = Investigation(bench, read_model(MODEL), old, folder, settings, lambda _: None, given).run()
    return {
        "verdict": outcome.verdict or "none",
        "effects": outcome.effects,
        "complete": outcome.complete,
        "ended": outcome.ended,
        "bench_s": outcome.bench_s,
        "total_s": outcome.total_s,
        "plays": outcome.plays,
        "judgement": "" if outcome.comparison is None else outcome.comparison.judgement,
        "no_comparison": outcome.no_comparison or "",
        "saved": _saved(bench, folder, old),
        "beyond": tuple(bench.beyond),
    }


def _saved(bench: Any, folder: Path, old: Any) -> float:
    """Return what the new gains save on the bench without noise, as a part of the old cost; nan where none are there.

    A loop that has to be ended has an infinite cost: the gains that keep it going save all of it.
    """
    import json

    from bender_investigate.bench_port import Controller
    from bender_investigate.investigation import TUNED
    from bender_investigate.journal import JOURNAL
    from bender_investigate.proof import Task, cost_of
    from bender_investigate.retuning import GAINS
    from bender_tuner.results.gains_file import read_controller

    tuned = [json.loads(x) for x in (folder / JOURNAL).read_text().splitlines()]
    found = next((x for x in reversed(tuned) if x["kind"] == "tuned"), None)
    if found is None:
        return math.nan
    task = Task(**found["task"])
    costs = []
    gains, _, _, model = read_controller(folder / TUNED / GAINS)
    new = Controller(gains, model, None if model is None else folder / TUNED / model.fmu)
    for controller in (Controller(old), new):
        record, trip = bench.looped(task.reference, controller, task.duration_s, None)
        costs.append(math.inf if trip else cost_of(record, task))
    if math.isinf(costs[0]):
        return 0.0 if math.isinf(costs[1]) else 1.0
    return 1.0 - costs[1] / costs[0]
