"""Cadence: a run of some length on the emulated bench, timed from outside.

The light's time comes from the stamp that the emulated microscope draws into a corner of each frame, the command's
from the emulated supply's own clock when it took the setting: neither end knows of the loop between them.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bender_emulator.microscope.control import ask_microscope
from bender_emulator.microscope.stamp import read_stamp
from bender_hil.bench_file import BenchFile, CameraTable, ControllerTable
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_hil.guard.spares import Ended
from bender_hil.log.journal import Entry
from bender_hil.log.read_run import read_run
from bender_hil.runner.program import Program
from bender_hil.runner.run import run
from bender_hil.runner.tip_camera import Sight


@dataclass(frozen=True, slots=True)
class Cadence:
    """What a run kept up.

    Attributes:
        ended: how it ended.
        ticks: frames that led to a command.
        rate_Hz: their mean rate.
        skipped: frames that arrived and that the loop did not look at.
        unsent: frames that the emulated camera could not get rid of, because nobody read them.
        late_frames: frames that the emulated camera itself drew too late.
        late: ticks whose command was on the wire later than one period after the frame, or that was overtaken.
        photon_to_command_ms: median, 99th percentile, maximum.
        photon_to_frame_ms: median and 99th percentile from the light to the grabbed frame.
        tip_error_um: rms of what was seen against the truth in the frame, its mean taken off.
    """

    ended: Ended
    ticks: int
    rate_Hz: float
    skipped: int
    unsent: int
    late_frames: int
    late: int
    photon_to_command_ms: tuple[float, float, float]
    photon_to_frame_ms: tuple[float, float]
    tip_error_um: float


def measure_cadence(
    program: Program,
    emulation: EmulationSettings,
    frames_per_s: float,
    fmu: Path,
    out: Path,
    *,
    realtime: bool = False,
) -> Cadence:
    """Run `program` on an emulated bench into the directory `out`.

    Args:
        program: what to do.
        emulation: the bench.
        frames_per_s: of its camera.
        fmu: its plant.
        out: where the run goes.
        realtime: whether the run has priority over what else the machine does.
    """
    emulator = replace(emulation, fmu=str(fmu.resolve()))
    camera, controller = CameraTable(frames_per_s=frames_per_s), ControllerTable(realtime=realtime)
    bench = BenchFile(emulator=emulator, camera=camera, controller=controller)
    watch = _Watch()
    result = run(bench, program, out, witness=watch.see, started=watch.start, finished=watch.finish)
    log = read_run(out)
    taken_s = {number: stamp_s for number, _, stamp_s, _, _ in watch.seen}
    delays = [
        1e3 * (watch.arrived_s[place] - taken_s[tick["frame"]])
        for place, tick in _commands_in_order(log.guard, log.ticks)
        if place < len(watch.arrived_s) and tick["frame"] in taken_s
    ]
    seen = np.array([(grabbed, stamp, tip, truth) for _, grabbed, stamp, tip, truth in watch.seen])
    times = [tick["grabbed_s"] for tick in log.ticks]
    error = seen[:, 2] - seen[:, 3]
    to_frame = 1e3 * (seen[:, 0] - seen[:, 1])
    summary = result.summary
    return Cadence(
        result.ended,
        summary.ticks,
        (len(times) - 1) / (times[-1] - times[0]),
        summary.skipped,
        watch.unsent,
        watch.late_frames,
        summary.late,
        (float(np.median(delays)), float(np.percentile(delays, 99.0)), float(np.max(delays))),
        (float(np.median(to_frame)), float(np.percentile(to_frame, 99.0))),
        float(np.nanstd(error)),
    )


def _commands_in_order(guard: tuple[Entry, ...], ticks: tuple[Entry, ...]) -> list[tuple[int, Entry]]:
    """For each tick whose command was sent whole, its place among all commands of the run."""
    by_sequence = {tick["sequence"]: tick for tick in ticks}
    applied = [entry for entry in guard if entry["kind"] == "applied"]
    return [(place, by_sequence[entry["sequence"]]) for place, entry in enumerate(applied) if entry["whole"]]


class _Watch:
    """Looks on from outside: stamps of frames, arrivals at the supply, counts of the camera."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, float, float, float, float]] = []
        self.arrived_s: list[float] = []
        self.unsent = self.late_frames = 0
        self._bench: EmulatedBench | None = None
        self._before: dict[str, int] = {}

    def see(self, sight: Sight) -> None:
        stamp = None if sight.image is None else read_stamp(sight.image)
        if stamp is not None:
            tip_um = np.nan if sight.tip_um is None else sight.tip_um
            row = sight.number, sight.grabbed_s, 1e-9 * stamp.taken_ns, tip_um, 1e-3 * stamp.tip_nm
            self.seen.append(row)

    def start(self, bench: EmulatedBench | None) -> None:
        self._bench = bench
        self._before = self._counts()

    def finish(self) -> None:
        """The first arrival is the 0 V of the arming; those after the run are the way down."""
        if self._bench is None:
            return
        self.arrived_s = [when_s for when_s, _ in self._bench.supply.console.ask({"do": "arrivals"})["arrivals"]][1:]
        after = self._counts()
        self.unsent = after["unsent"] - self._before["unsent"]
        self.late_frames = after["late"] - self._before["late"]

    def _counts(self) -> dict[str, int]:
        if self._bench is None:
            return {"unsent": 0, "late": 0}
        return json.loads(ask_microscope(self._bench.control_port, "status"))
