"""The one way through an investigation, from the noise at rest to gains that the bench has judged.

Rest and probe; a first excitation within what the probe has shown; diagnose; play what the diagnosis asks for, after it
was simulated on every rival; diagnose all records together; and so on until a verdict stands, the experiments are used
up or the budget is. Then the corrected model, gains for it, and old and new ones on the bench in alternation.

Everything follows from the records and the seed: taken up again, an investigation comes to the same decisions and reads
back what was played.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.diagnosis_json import FMU, is_written
from bender_discrepancy.conclusion.measurement.corrected_model import corrected
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.output_folder import all_or_no_files
from bender_discrepancy.workflow import diagnose
from bender_hil.runner.voltages import Voltages
from bender_inference.settings import Settings
from bender_investigate import excitation
from bender_investigate.bench_port import BenchPort, Controller
from bender_investigate.journal import JOURNAL, DecisionJournal
from bender_investigate.outcome import Outcome
from bender_investigate.proof import Comparison, Task, compare_costs, cost_of, order
from bender_investigate.retuning import GAINS, LOOP_HZ, retune, tune_settings
from bender_investigate.safety import TRAVEL_SHARE, reached_um, refusal, rows_of, scaled
from bender_investigate.settings import InvestigationSettings
from bender_investigate.stage import BudgetSpentError, Stage, Tell
from bender_loop.control.pid import Gains
from bender_loop.errors import InputError, RunError
from bender_loop.records.record import Record
from bender_loop.shell.files import prepare_directory
from bender_plant.model import Model

CERTAIN = ("named", "recalibrated", "no_gap")
UNKNOWN_MARGIN = 1.3
"""By so much the tip may go further than the model scaled to the probe says."""
SHRINK = 0.8
"""A refused profile is tried so much smaller, down to the voltages that the records have been up to."""
LEAST_NOISE_UM = 1e-4
FASTEST_S = 8.0
"""An excitation is not made shorter than this for the budget's sake."""
EXCITATION_SHARE = 0.4
"""Of the budget, at most, for the first excitation."""
PROBE_DONE = 0.95
"""A probe that has not come to this part of its highest hold shows nothing to go on with."""
LEFT_SHARE = 0.95
"""Share of the remaining budget for another excitation, whose parts are rounded up to whole rows."""
STROKE_S = 5.0
TUNED = "tuned"


class Probed(NamedTuple):
    """What rest and probe have shown: noise, stroke per stroke of the model, and the highest voltage to use."""

    noise_um: float
    ratio: float
    top_V: float
    small_V: float
    records: tuple[Record, ...]


@dataclass(slots=True)
class _State:
    records: list[Record] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    diagnosis: Diagnosis | None = None
    diagnoses: int = 0
    plays: int = 0
    ended: str = ""
    why: str = ""
    varied: bool = False


class Investigation:
    """One investigation.

    Args:
        bench: that plays.
        base: the model as given.
        old: the gains that the bench has now.
        out: directory, made already; that of an earlier sitting to go on with it.
        settings: of the investigation.
        tell: is told what happens.
        given: records of this bench that are there already; they take the place of the first excitation.
    """

    def __init__(
        self,
        bench: BenchPort,
        base: Model,
        old: Gains,
        out: Path,
        settings: InvestigationSettings,
        tell: Tell,
        given: Sequence[Record] = (),
    ) -> None:
        self.given = tuple(given)
        self.bench, self.base, self.old, self.out, self.settings, self.tell = bench, base, old, out, settings, tell
        self._state = _State()
        self._top = bench.allowed.high_V

    def run(self) -> Outcome:
        """Investigate; returns how it ended, which is written too.

        Raises:
            InputError: the directory belongs to another investigation, or a record will not do.
            RunError: the guard ended a play, or a plant failed.
            KeyboardInterrupt: by the user; what was played and decided is kept.
        """
        journal = DecisionJournal(self.out / JOURNAL)
        try:
            return self._run(journal)
        except KeyboardInterrupt:
            last = journal.decisions[-1]["kind"] if journal.decisions else ""
            if last != "interrupted":
                journal.write("interrupted", "a person asked for the end")
            raise
        finally:
            journal.close()

    def _run(self, journal: DecisionJournal) -> Outcome:
        settings, state = self.settings, self._state
        self._begin(journal)
        stage = Stage(self.bench, self.out, journal, settings.budget_s, self.tell)
        verdict_s = 0.0
        probed: Probed | None = None
        try:
            probed = self._probe(stage)
            if self.given:
                self._take("given", self.given)
                # a weak record may not have been as far as the probe
                self._add("rest", probed.records)
            else:
                self._excite(stage, probed)
            while not state.ended:
                self._diagnose(journal)
                self._next(stage, probed)
        except BudgetSpentError as error:
            state.ended, state.why = "budget", str(error)
        if state.diagnosis is None and state.records:
            self._diagnose(journal)
        verdict_s = stage.spent_s
        plays = stage.count
        journal.write("ended", state.why, by=state.ended, bench_s=verdict_s)
        comparison, reason, gains = self._prove(stage, probed)
        journal.write("gains", comparison.sentence if comparison is not None else str(reason), use=gains)
        outcome = self._outcome(verdict_s, plays, stage.spent_s, comparison, reason, gains)
        outcome.write(self.out)
        journal.write("done", outcome.sentence, verdict=outcome.verdict)
        return outcome

    def _begin(self, journal: DecisionJournal) -> None:
        who = {
            **self.bench.facts(),
            "model": self.base.name,
            "budget_s": self.settings.budget_s,
            "seed": self.settings.seed,
        }
        begun = journal.last("begun")
        if begun is None:
            journal.write("begun", "an investigation of this bench against this model", **who)
            return
        for key, value in who.items():
            if begun.get(key) != value:
                raise InputError(
                    f"{self.out}: was begun with {key} = {begun.get(key)!r}, found {value!r}; --resume "
                    "needs the options that it was begun with, anything else another directory"
                )
        journal.write("resumed", f"{len(journal.all('played'))} plays are there already")

    def _probe(self, stage: Stage) -> Probed:
        """Measure the noise at rest and how far small voltages move the tip; choose the highest voltage."""
        allowed = self.bench.allowed
        profile = excitation.rest_and_probe(allowed)
        why = "the noise at rest, then small holds: how far the tip goes"
        records = stage.play("rest", profile, why)
        highest_V = max(profile.levels_V)
        reached_V = max(float(np.max(x.voltage_V)) for x in records)
        if reached_V < PROBE_DONE * highest_V:
            raise RunError(
                f"the probe was ended at {reached_V:.3g} V, before its last hold of {highest_V:.3g} V, so nobody knows "
                "how far the tip goes; look at the bench and begin anew in another directory"
            )
        # one that was cut off has the rest at 0 V in its first part, and the holds in either
        record = records[0]
        seen = np.isfinite(record.displacement_um)
        moved = np.flatnonzero(record.voltage_V != 0.0)
        rest_s = excitation.REST_S * (0.1 if allowed.rate_Hz >= excitation.FAST_HZ else 1)
        quiet_s = min(0.9 * rest_s, float(record.time_s[moved[0]]) if moved.size else np.inf)
        quiet = seen & (record.time_s < quiet_s)
        if np.count_nonzero(quiet) < 3:
            raise InputError("the tip was found in fewer than 3 frames at rest; look at the picture")
        rest_um = float(np.median(record.displacement_um[quiet]))
        noise_um = max(float(np.std(record.displacement_um[quiet])), LEAST_NOISE_UM)
        found_um = max(float(np.nanmax(np.abs(x.displacement_um - rest_um))) for x in records)
        low_um, high_um = reached_um(self.base, profile, allowed.rate_Hz)
        model_um = max(abs(low_um), abs(high_um))
        ratio = max(found_um - 3.0 * noise_um, noise_um) / model_um
        top_V = self._top_V(ratio, noise_um)
        self._top = top_V
        small_V = min(
            max(0.02 * top_V, excitation.NOISES * noise_um * max(profile.levels_V) / max(found_um, noise_um)),
            0.12 * top_V,
        )
        stage.journal.write(
            "probed",
            f"the noise at rest is {noise_um:.3g} µm; the tip goes {ratio:.3g} times as far as by the model, so the "
            f"bench is excited up to {top_V:.3g} V",
            noise_um=noise_um,
            ratio=ratio,
            top_V=top_V,
            small_V=small_V,
        )
        return Probed(noise_um, ratio, top_V, small_V, tuple(records))

    def _top_V(self, ratio: float, noise_um: float) -> float:
        """Return the highest voltage at which the model, scaled to the probe, keeps the tip within the travel."""
        allowed = self.bench.allowed
        low_um, high_um = (TRAVEL_SHARE * x for x in allowed.travel_um)
        for share in np.linspace(1.0, 0.1, 19):
            top_V = float(share) * allowed.high_V
            least_um, most_um = reached_um(self.base, excitation.up_and_down(allowed, top_V), allowed.rate_Hz)
            margin_um = 5.0 * noise_um
            scale = UNKNOWN_MARGIN * ratio
            if low_um + margin_um <= scale * least_um and scale * most_um <= high_um - margin_um:
                return top_V
        raise InputError(
            f"the tip goes {ratio:.3g} times as far as by the model {self.base.name}: within the travel of "
            f"{allowed.travel_um[0]:g} to {allowed.travel_um[1]:g} µm not even a tenth of {allowed.high_V:g} V could "
            "be played; look at the bench"
        )

    def _excite(self, stage: Stage, probed: Probed) -> None:
        settings = self.settings
        duration_s = max(FASTEST_S, min(settings.excitation_s, EXCITATION_SHARE * settings.budget_s))
        profile = excitation.first_excitation(
            self.bench.allowed, probed.top_V, probed.small_V, duration_s, np.random.default_rng([settings.seed, 1])
        )
        why = f"a first excitation: levels, holds, sines, minor loops up to {probed.top_V:.3g} V"
        self._take("excitation", stage.play("excitation", profile, why))

    def _take(self, name: str, records: Sequence[Record]) -> None:
        self._add(name, records)
        self._state.plays += 1

    def _add(self, name: str, records: Sequence[Record]) -> None:
        for number, record in enumerate(records):
            self._state.records.append(record)
            self._state.names.append(name if number == 0 else f"{name}-{number + 1}")

    def _diagnose(self, journal: DecisionJournal) -> None:
        state, allowed = self._state, self.bench.allowed
        self.tell(f"diagnosing {len(state.records)} record(s)")
        how = Settings(highest_V=self._top, slew_V_per_s=allowed.profile_slew_V_per_s)
        diagnosis = diagnose(self.base, state.records, how, self.tell, state.names)
        state.diagnosis = diagnosis
        state.diagnoses += 1
        folder = self.out / f"diagnosis-{state.diagnoses}"
        with all_or_no_files(folder) as here:
            diagnosis.write(here)
        journal.write(
            "diagnosed",
            diagnosis.sentence,
            verdict=diagnosis.verdict,
            effects=[x.id for x in diagnosis.added],
            complete=diagnosis.is_complete,
            records=state.names,
            folder=folder.name,
        )
        self.tell(f"{diagnosis.verdict}: {diagnosis.sentence}")

    def _next(self, stage: Stage, probed: Probed) -> None:
        """Decide what follows from the last diagnosis, and play it."""
        state = self._state
        diagnosis = state.diagnosis
        assert diagnosis is not None
        if diagnosis.verdict in CERTAIN:
            left = "" if diagnosis.is_complete else ", and says what stays unexplained"
            state.ended, state.why = "verdict", f"the verdict stands{left}"
            return
        if state.plays > self.settings.experiments:
            state.ended, state.why = "experiments", f"{state.plays} excitations did not lead to a verdict"
            return
        name = f"experiment-{state.plays}"
        proposal = diagnosis.next_experiment
        if proposal is not None and proposal.tells_apart:
            profile = Voltages(
                tuple(proposal.time_s.tolist()),
                tuple(proposal.voltage_V.tolist()),
                float(proposal.time_s[-1] + np.median(np.diff(proposal.time_s))),
            )
            safe = self._safe(stage, profile)
            if safe is not None:
                self._take(name, stage.play(name, safe, proposal.why))
                return
        if state.varied:
            state.ended, state.why = "no experiment", "no further experiment would settle it"
            return
        state.varied = True
        remaining_s = max(FASTEST_S, min(0.8 * self.settings.excitation_s, LEFT_SHARE * stage.left_s))
        profile = excitation.another_excitation(
            self.bench.allowed, probed.top_V, remaining_s, np.random.default_rng([self.settings.seed, 2])
        )
        safe = self._safe(stage, profile)
        if safe is None:
            state.ended, state.why = "no experiment", "every further excitation might leave the limits"
            return
        why = (
            f"after the first records the verdict is {diagnosis.verdict}: another excitation, different from the first"
        )
        self._take(name, stage.play(name, safe, why))

    def _safe(self, stage: Stage, profile: Voltages) -> Voltages | None:
        """Return the profile, smaller where a rival would leave the limits; None where every one is refused.

        A rival that was fitted to small voltages may go anywhere at high ones. Where the records have been, it agrees
        with them.
        """
        models = self._rivals()
        lowest_V = excitation.PROBE_SHARES[0] * self.bench.allowed.high_V
        known_V = max(lowest_V, *(float(np.max(x.voltage_V)) for x in self._state.records))
        while True:
            reason = refusal(profile, self.bench.allowed, models)
            if reason is None:
                return profile
            highest_V = max(profile.levels_V)
            stage.journal.write("refused", reason, highest_V=highest_V, rivals=len(models))
            self.tell(f"refused: {reason}")
            if highest_V <= known_V * (1.0 + 1e-9):
                return None
            profile = scaled(profile, max(SHRINK, known_V / highest_V))

    def _rivals(self) -> list[Model]:
        """Return every model that may be true by the last diagnosis, with the calibration of the last record."""
        diagnosis = self._state.diagnosis
        assert diagnosis is not None
        search = diagnosis.findings.search
        last = len(search.records) - 1
        fitted = [*diagnosis.findings.leaders, search.best]
        return [corrected(search.problem.base, x, 0.0, last) for x in fitted]

    def _prove(self, stage: Stage, probed: Probed | None) -> tuple[Comparison | None, str | None, str | None]:
        """Tune on the corrected model and let the bench judge; returns the judgement, why none, the gains to use."""
        state = self._state
        diagnosis = state.diagnosis
        if diagnosis is None or probed is None:
            return None, "there is no verdict, the old gains stay", None
        if diagnosis.verdict == "no_gap":
            return None, "the model is confirmed, so its gains stay", None
        if diagnosis.verdict not in ("named", "recalibrated"):
            return None, why_not_tuned(diagnosis.verdict, self.out / f"diagnosis-{state.diagnoses}"), None
        if not is_written(diagnosis.findings, diagnosis.gap):
            return None, "the corrected model is no better than the recalibrated one, the old gains stay", None
        fmu = self.out / f"diagnosis-{state.diagnoses}" / FMU
        task = Task.of_stroke(self._stroke_um(diagnosis.model, probed.top_V), self.settings.step_s, probed.noise_um)
        allowed, exposure_s = self.bench.allowed, state.records[-1].exposure
        settings = tune_settings(
            allowed, task, probed.noise_um, exposure_s, self.settings.evaluations, self.settings.seed
        )
        self.tell("tuning on the corrected model")
        try:
            found = retune(
                fmu,
                self.old,
                settings,
                task,
                self.bench.loop_travel_um,
                prepare_directory(self.out / TUNED),
                follow_model=allowed.rate_Hz <= LOOP_HZ,
            )
        except (InputError, RunError) as error:
            return None, f"no gains could be found for the corrected model ({error}); the old ones stay", None
        stage.journal.write(
            "tuned",
            found.sentence,
            gains=asdict(found.controller.gains),
            model_following=found.following_note,
            task=asdict(task),
            old_cost_um_s2=found.old_cost,
            new_cost_um_s2=found.new_cost,
        )
        if math.isinf(found.new_cost):
            return None, f"{found.sentence}; the old gains stay", None
        if found.new_cost >= found.old_cost * (1.0 - self.settings.least_gain):
            return None, "by simulation the old gains are as good on the corrected model; they stay", None
        comparison = self._alternate(stage, task, found.controller)
        gains = f"{TUNED}/{GAINS}" if comparison.judgement == "better" else None
        return comparison, None, gains

    def _stroke_um(self, model: Model, top_V: float) -> float:
        """Return where the corrected model settles at the highest voltage, within the travel of the bench."""
        hold = Voltages((0.0,), (top_V,), STROKE_S)
        rate_Hz = min(self.bench.allowed.rate_Hz, 100.0)
        reading_um = Simulator(Drive.of_rows(*rows_of(hold, rate_Hz)), coarser=3.0).run(model).reading_um
        low_um, high_um = self.bench.allowed.travel_um
        return min(max(float(np.median(reading_um[-10:])), 0.5 * low_um), 0.8 * high_um)

    def _alternate(self, stage: Stage, task: Task, new: Controller) -> Comparison:
        costs: dict[str, dict[int, float]] = {"old": {}, "new": {}}
        try:
            for pair, which in order(self.settings.pairs):
                if sum(np.isinf(list(costs["new"].values()))) >= 1 or (
                    sum(np.isinf(list(costs["old"].values()))) >= 2 and len(costs["new"]) >= 2
                ):
                    break
                controller = Controller(self.old) if which == "old" else new
                why = f"set-points {task.high_um:.3g} and {task.low_um:.3g} µm with the {which} gains"
                done = stage.follow(f"{which}-{pair + 1}", task.reference, controller, task.duration_s, why)
                if done.trip is not None:
                    costs[which][pair] = np.inf
                elif done.record is not None:
                    costs[which][pair] = cost_of(done.record, task)
        except BudgetSpentError as error:
            stage.journal.write("budget", str(error))
        if any(np.isinf(x) for half in costs.values() for x in half.values()):
            return self._compared(list(costs["old"].values()), list(costs["new"].values()))
        both = sorted(set(costs["old"]) & set(costs["new"]))
        return self._compared([costs["old"][k] for k in both], [costs["new"][k] for k in both])

    def _compared(self, old: Sequence[float], new: Sequence[float]) -> Comparison:
        return compare_costs(old, new, self.settings.confidence, self.settings.least_gain)

    def _outcome(
        self,
        verdict_s: float,
        plays: int,
        total_s: float,
        comparison: Comparison | None,
        reason: str | None,
        gains: str | None,
    ) -> Outcome:
        state = self._state
        diagnosis = state.diagnosis
        told: dict[str, Any] = {} if diagnosis is None else diagnosis.to_dict()
        lead = told.get("lead")
        return Outcome(
            verdict=None if diagnosis is None else diagnosis.verdict,
            sentence="nothing was measured" if diagnosis is None else diagnosis.sentence,
            effects=() if diagnosis is None else tuple(x.id for x in diagnosis.added),
            complete=diagnosis is not None and diagnosis.is_complete,
            ended=state.ended,
            why=state.why,
            lead=(lead or {}).get("equation") if isinstance(lead, dict) else told.get("no_lead"),
            bench_s=verdict_s,
            total_s=total_s,
            plays=plays,
            comparison=comparison,
            no_comparison=reason,
            diagnosis=f"diagnosis-{state.diagnoses}" if state.diagnoses else None,
            gains=gains,
        )


def why_not_tuned(verdict: str, folder: Path) -> str:
    """Return why an open verdict changes no gains, and what can be done with it.

    Args:
        verdict: neither `named` nor `recalibrated` nor `no_gap`.
        folder: of the diagnosis.
    """
    why = f"a verdict of {verdict} gives no model to tune on, the old gains stay"
    if verdict == "unexplained":
        return f"{why}; {folder / 'report.html'} says where the residual lies"
    return f"{why}; `bender tune --model {folder / 'model.toml'}` tunes on it all the same: try those gains yourself"
