"""`kill -9` of every process of an investigation in every phase: one investigation, killed and resumed over and over.

`bender investigate --watch` drives a bench that stands beside it, in real time. Each sitting goes on until a phase
comes in which somebody is still to be killed; then the output is watched behind the terminals of the supply, and the
next sitting resumes. At the end, what was played is held to the journals and to the log of the supply. POSIX only.
"""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from bench_trials.played_rows import PlayedRows, played_rows
from bench_trials.processes import children_of, is_there, words_of
from bench_trials.standing_bench import FRAMES_PER_S, StandingBench

from bender_export.build import build_plant_fmu
from bender_hil.emulated import EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.live.session import BUTTON_GONE
from bender_hil.log.read_run import GUARD, RUN
from bender_investigate.excitation import first_excitation
from bender_investigate.journal import JOURNAL, read_decisions
from bender_investigate.safety import Allowed, rows_of
from bender_investigate.stage import MISHAPS
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record, write_record
from bender_loop.shell.last_word import UNKNOWN
from bender_plant.model import load_model

BESIDE = ("page server", "STOP button")
"""They are no part of a run: it goes on without them, and says that STOP has gone."""
ON_BENCH = ("rest", "excitation", "experiment", "old gains", "new gains")
OFF_BENCH = ("diagnosis", "tuning", "outcome")
ATTEMPTS: Mapping[str, tuple[tuple[str, ...], ...]] = {
    **dict.fromkeys(ON_BENCH, ((*BESIDE, "investigation"), ("guard",), ("microscope",), ("supply",))),
    **dict.fromkeys(OFF_BENCH, ((*BESIDE, "investigation"),)),
    "outcome": (("investigation",),),
}
"""Who is killed in one sitting, in this order; the last of them ends it."""
FOLDERS = {
    "rest": r"rest(-rest)*",
    "excitation": r"excitation(-rest)*",
    "experiment": r"experiment-\d+(-rest)*",
    "old gains": r"old-\d+",
    "new gains": r"new-\d+",
}
GUARD_LINES = "heartbeat_s = 1.0\nframe_age_s = 1.0\n"
"""The machine may be busy, and a late frame would end a play that is to be ended by a kill."""
WITHIN_S = 1.0 + 6.0 + 1.0
"""To the output off or the alarm: `frame_age_s`, then `shutdown_limit_s`, and a second."""
FIRST_TICKS, STEP_TICKS = 66, 8
"""So many ticks into a play, and later by so many in every further attempt."""
GIVEN, GIVEN_S, GIVEN_NOISE_UM = "given.csv", 30.0, 0.03
HIDDEN_LAG_S = 0.25
"""It is named, late ticks or not, and so the investigation comes to tune."""
GAINS = "[parallel]\nproportional_V_per_um = 0.2\nintegral_V_per_um_s = 2.0\nderivative_V_s_per_um = 0.0\n"
MOST_MISHAPS, MOST_MISSES = 5, 3
LOOK_S = 0.05
_LONGEST_S = 900.0
_MODULES = {"guard": b"bender_hil.guard\0", "page server": b"live.page_server", "STOP button": b"live.stop_button"}


@dataclass(frozen=True, slots=True)
class Scenario:
    """One investigation.

    Attributes:
        name: of it.
        parameters: of the emulated bench, unknown to the model.
        budget_s: of bench time.
        pairs: of plays with old and new gains.
        phases: in which somebody is killed.
        hidden_lag_s: of a sensor that the bench has and the model lacks.
        given: parameters of the emulated bench of a record that takes the place of the first excitation, computed
            without it; None for no such record. Where it is of another bench, the records are explained together by
            nothing, and an experiment is played.
    """

    name: str
    parameters: Mapping[str, float]
    budget_s: float
    pairs: int
    phases: tuple[str, ...]
    hidden_lag_s: float = 0.0
    given: Mapping[str, float] | None = None


SCENARIOS = (
    Scenario(
        "from rest to a verdict", {"source_resistance.time_constant": 0.25}, 60.0, 2,
        ("rest", "excitation", "diagnosis"),
    ),
    Scenario(
        "from a record of another bench to an experiment", {}, 120.0, 2, ("experiment",),
        given={"calibration.gain": 0.8},
    ),
    Scenario(
        "from a record to gains", {}, 80.0, 5, ("tuning", "old gains", "new gains", "outcome"),
        HIDDEN_LAG_S, given={},
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Kill:
    """One process killed in one phase.

    Attributes:
        phase, who: as in `ATTEMPTS`.
        outcome: "off", "alarm", "goes on", "nothing was on", or what is wrong.
        seconds: to the output off or to the alarm, None where there is nothing to wait for.
        status: of the investigation, None for one that was killed or goes on.
        broken: what is not as it should be, empty where all is.
    """

    phase: str
    who: str
    outcome: str
    seconds: float | None
    status: int | None
    broken: str


@dataclass(frozen=True, slots=True)
class Chain:
    """What came of one scenario.

    Attributes:
        name: of the scenario.
        kills: in the order in which they happened.
        sittings: in all.
        mishaps: sittings that ended because the machine was too busy, before anybody was killed in them.
        verdict: at the end, None for none.
        ended: why the investigation went no further.
        played: by the journals and the log of the supply.
        missed: phase and process that no sitting has come to.
        broken: what is not as it should be about the end.
    """

    name: str
    kills: tuple[Kill, ...]
    sittings: int
    mishaps: int
    verdict: str | None
    ended: str
    played: PlayedRows
    missed: tuple[tuple[str, str], ...]
    broken: str


def run_chain(scenario: Scenario, fmu: Path, folder: Path) -> Chain:
    """Kill and resume one investigation until nobody is left to be killed, then let it end.

    Args:
        scenario: the investigation.
        fmu: of the emulated bench where no lag is hidden.
        folder: an empty one, for everything.

    Raises:
        RunError: a sitting hangs, or the emulated bench does not come back.
    """
    emulation = EmulationSettings(parameters=dict(scenario.parameters))
    if scenario.hidden_lag_s:
        hidden = load_model("bench").with_block("sensor_lag", time_constant_s=scenario.hidden_lag_s)
        fmu = build_plant_fmu(hidden, folder / "hidden.fmu")
    with StandingBench(emulation, fmu) as bench:
        bench.write_bench_file(folder / "bench.toml", GUARD_LINES)
        (folder / "gains.toml").write_text(f"sampling_period_s = {1.0 / FRAMES_PER_S!r}\n\n{GAINS}"
            "filter_time_s = 0.06\nderivative_on_error = false\n\n"
            "[limits]\nlower_V = 0.0\nupper_V = 50.0\ntracking_time_s = 0.0\n")  # fmt: skip
        if scenario.given is not None:
            _write_given(folder / GIVEN, fmu, scenario.given)
        return _Chain(scenario, bench, folder).run()


@dataclass(slots=True)
class _Chain:
    scenario: Scenario
    bench: StandingBench
    folder: Path
    kills: list[Kill] = field(default_factory=list)
    sittings: int = 0
    mishaps: int = 0
    misses: int = 0

    def run(self) -> Chain:
        pending = {x: list(ATTEMPTS[x]) for x in self.scenario.phases}
        last = None
        while last is None:
            last = self._sitting(pending)
            if last == 1 and self.mishaps < MOST_MISHAPS and any(x in self._complaint() for x in MISHAPS):
                self.mishaps += 1
                last = None
        self.bench.note_arrivals()
        out = self.folder / "found"
        played = played_rows(out, FRAMES_PER_S, self.bench.arrivals)
        told = json.loads((out / "investigation.json").read_text()) if (out / "investigation.json").exists() else {}
        faults = [*played.twice]
        if last != 0:
            faults.append(f"the last sitting ended with status {last}: {self._complaint()}")
        if not told:
            faults.append("there is no investigation.json")
        if played.unknown:
            faults.append(f"the supply took {played.unknown} levels that no journal knows")
        if self.bench.is_on():
            faults.append("the output is on at the end")
        missed = tuple((phase, who) for phase, rest in pending.items() for group in rest for who in group)
        ended = str(told.get("ended", {}).get("why", ""))
        return Chain(
            self.scenario.name, tuple(self.kills), self.sittings, self.mishaps, told.get("verdict"), ended, played,
            missed, "; ".join(faults),
        )  # fmt: skip

    def _sitting(self, pending: dict[str, list[tuple[str, ...]]]) -> int | None:
        """Go on until somebody is killed; returns the exit status of a sitting in which nobody was."""
        with _Sitting(self.scenario, self.folder, self.sittings) as sitting:
            self.sittings += 1
            ticks = FIRST_TICKS + STEP_TICKS * (self.sittings % 5)
            phase = sitting.wait_for([x for x, rest in pending.items() if rest], ticks)
            if phase is None:
                return sitting.process.returncode
            group = pending[phase].pop(0)
            for who in group:
                kill = self._kill(sitting, phase, who)
                if phase == "outcome" and sitting.is_done() and self.misses < MOST_MISSES:
                    # the last words take milliseconds; a kill that came after them is tried again
                    self.misses += 1
                    pending[phase].append(group)
                    continue
                self.kills.append(kill)
        return None

    def _kill(self, sitting: "_Sitting", phase: str, who: str) -> Kill:
        bench = self.bench
        was_on = bench.is_on()
        bench.note_arrivals()
        pid = bench.process(who) if who in ("microscope", "supply") else sitting.pid(who)
        family = sitting.family()
        event_s = time.perf_counter()
        os.kill(pid, signal.SIGKILL)
        if who in BESIDE:
            broken = sitting.goes_on(phase, who)
            return Kill(phase, who, "goes on", None, None, broken)
        outcome, seconds = self._safe(sitting, event_s, was_on, supply_is_lost=who == "supply")
        status = None if who == "investigation" else sitting.wait_end()
        faults = []
        if outcome == "on":
            faults.append(f"the output is on after {WITHIN_S:g} s, and nobody says so")
        if phase == "outcome" and sitting.is_done():
            faults.append("the outcome was written before the kill")
        if phase in OFF_BENCH and was_on:
            faults.append("the output was on")
        if phase in ON_BENCH and not was_on:
            faults.append("the output was off before")
        if left := _left(family):
            faults.append(f"left behind: {', '.join(left)}")
        if who in ("microscope", "supply"):
            bench.revive()
        return Kill(phase, who, outcome, seconds, status, "; ".join(faults))

    def _safe(
        self, sitting: "_Sitting", event_s: float, was_on: bool, *, supply_is_lost: bool
    ) -> tuple[str, float | None]:
        """Wait for the alarm, or for the output to be off; a supply that has gone gives nothing, and only says so."""
        if not was_on:
            return "nothing was on", None
        while (passed_s := time.perf_counter() - event_s) < WITHIN_S:
            if UNKNOWN in sitting.complaints():
                return "alarm", passed_s
            if not supply_is_lost and not self.bench.is_on():
                return "off", passed_s
            time.sleep(0.005)
        return "on", None

    def _complaint(self) -> str:
        path = self.folder / f"sitting-{self.sittings - 1}.err"
        lines = path.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else "no word"


class _Sitting:
    """One `bender investigate`, and what is seen of it from outside."""

    def __init__(self, scenario: Scenario, folder: Path, number: int) -> None:
        self._out = folder / "found"
        self._said, self._complained = folder / f"sitting-{number}.out", folder / f"sitting-{number}.err"
        words = [sys.executable, "-P", "-m", "bender_cli", "investigate", "--bench", "bench.toml"]
        words += ["--gains", "gains.toml"]
        words += ["--budget-s", repr(scenario.budget_s), "--pairs", str(scenario.pairs), "--watch", "--out", "found"]
        words += ["--record", GIVEN] if scenario.given is not None else []
        words += ["--resume"] if (self._out / JOURNAL).exists() else []
        self._earlier = {x.name for x in self._out.glob("[0-9][0-9]-*") if (x / RUN).exists()}
        self._decisions = len(read_decisions(self._out / JOURNAL)) if (self._out / JOURNAL).exists() else 0
        # NiceGUI would take a run under pytest for a test of its own
        outside = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
        with self._said.open("wb") as said, self._complained.open("wb") as complained:
            self.process = subprocess.Popen(words, cwd=folder, env=outside, stdout=said, stderr=complained)

    def __enter__(self) -> "_Sitting":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(30.0)
            self.process.kill()
        self.process.wait()

    def wait_for(self, phases: Sequence[str], ticks: int) -> str | None:
        """Wait until one of the phases is well under way; returns it, None where the sitting has ended before.

        Raises:
            RunError: it does not end.
        """
        end_s = time.perf_counter() + _LONGEST_S
        while self.process.poll() is None:
            if (phase := next((x for x in phases if self._is_in(x, ticks)), None)) is not None:
                return phase
            if time.perf_counter() > end_s:
                raise RunError(f"{self._said}: the sitting goes on for more than {_LONGEST_S:g} s")
            if list(phases) == ["outcome"]:
                self._step()
            else:
                time.sleep(0.05)
        return None

    def wait_end(self) -> int | None:
        """Return the exit status, None for a sitting that does not end."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(40.0)
        return None

    def complaints(self) -> str:
        """Return the standard error so far."""
        return self._complained.read_text(errors="replace")

    def pid(self, who: str) -> int:
        """Return the process id of one of the family; RunError when it is not there."""
        if who == "investigation":
            return self.process.pid
        for pid in self.family():
            if _MODULES[who] in words_of(pid):
                return pid
        raise RunError(f"found no process of the {who} below process {self.process.pid}")

    def family(self) -> list[int]:
        """Return the process ids of the investigation and of everybody whom it started."""
        found = [self.process.pid]
        for pid in found:
            found += children_of(pid)
        return found

    def goes_on(self, phase: str, who: str) -> str:
        """Return what is wrong a second after somebody was lost who is no part of the run."""
        before = self._ticks(self._play(phase)) if phase in ON_BENCH else 0
        time.sleep(1.0)
        faults = []
        if self.process.poll() is not None:
            faults.append("the investigation has ended")
        elif phase in ON_BENCH and self._ticks(self._play(phase)) <= before:
            faults.append("the run stands still")
        if who == "STOP button" and BUTTON_GONE not in self.complaints():
            faults.append("nobody says that STOP has gone")
        return "; ".join(faults)

    def _is_in(self, phase: str, ticks: int) -> bool:
        if phase in ON_BENCH:
            return self._ticks(self._play(phase)) >= ticks
        said = self._said.read_bytes()
        if phase == "diagnosis":
            return b"\nstep 1:" in said
        if phase == "tuning":
            return b"tuning on the corrected model" in said
        return any(x["kind"] == "gains" for x in self._new_decisions())

    def _step(self) -> None:
        """Stop the process at its next decision, look at that while it stands still, and let it go on.

        It stays where it is after the decision about the gains: the next thing that it does is to write its outcome.
        """
        path = self._out / JOURNAL
        before, end_s = _size(path), time.perf_counter() + LOOK_S
        while _size(path) == before:
            if time.perf_counter() > end_s:
                return
            time.sleep(1e-4)
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.process.pid, signal.SIGSTOP)
            kinds = [x["kind"] for x in self._new_decisions()]
            if "gains" not in kinds or "done" in kinds:
                os.kill(self.process.pid, signal.SIGCONT)

    def is_done(self) -> bool:
        """Return whether the investigation has come to its last word."""
        return any(x["kind"] == "done" for x in self._new_decisions())

    def _new_decisions(self) -> list[dict[str, Any]]:
        path = self._out / JOURNAL
        return read_decisions(path)[self._decisions :] if path.exists() else []

    def _play(self, phase: str) -> Path | None:
        """Return the folder of the play that this sitting is at, None where it belongs to another phase."""
        new = [x for x in sorted(self._out.glob("[0-9][0-9]-*")) if x.name not in self._earlier and (x / RUN).exists()]
        return new[-1] if new and re.fullmatch(r"\d+-" + FOLDERS[phase], new[-1].name) else None

    def _ticks(self, folder: Path | None) -> int:
        """Return how many ticks the supply has been told, 0 after the guard's last word."""
        if folder is None or not (folder / GUARD).exists() or b'"kind": "ramp"' in (folder / GUARD).read_bytes():
            return 0
        return (folder / RUN).read_bytes().count(b'"kind": "tick"')


def _write_given(path: Path, fmu: Path, parameters: Mapping[str, float]) -> None:
    """Write a record of a first excitation of the emulated plant, computed in no time."""
    rng = np.random.default_rng(1)
    time_s, levels_V = _whole_excitation(rng)
    tip_um = np.zeros(time_s.size)
    with FmuPlant(fmu, output_name="displacement", parameters=dict(parameters)) as plant:
        plant.reset()
        for k in range(1, time_s.size):
            tip_um[k] = plant.step(float(levels_V[k - 1]), 1.0 / FRAMES_PER_S)
    tip_um += GIVEN_NOISE_UM * rng.standard_normal(tip_um.size)
    write_record(path, Record(time_s, levels_V, tip_um))


def _whole_excitation(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    guard = GuardSettings()
    travel_um = guard.travel_um[0], guard.travel_um[1]
    allowed = Allowed(0.0, guard.maximum_V, guard.slew_V_per_s, guard.burst_s, travel_um, FRAMES_PER_S)
    return rows_of(first_excitation(allowed, 35.0, 1.0, GIVEN_S, rng), FRAMES_PER_S)


def _size(path: Path) -> int:
    with contextlib.suppress(OSError):
        return path.stat().st_size
    return 0


def _left(family: Sequence[int]) -> list[str]:
    """Return who of a family still is there after ten seconds."""
    end_s = time.perf_counter() + 10.0
    while True:
        there = [x for x in family if is_there(x)]
        if not there or time.perf_counter() > end_s:
            return [words_of(x).replace(b"\0", b" ").decode(errors="replace")[-60:] for x in there]
        time.sleep(0.05)
