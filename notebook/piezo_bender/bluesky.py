"""The bench in bluesky: an ophyd-async device without EPICS, and plans of one run each (extra `bluesky`).

    from bluesky import RunEngine
    from piezo_bender.bluesky import Bench, investigate, play

    engine = RunEngine()
    engine.subscribe(print)
    bench = Bench("bench.toml")
    engine(play(bench, profile="staircase"))
    engine(investigate(bench, budget_s=300))

The loop of the bench is its own and keeps its own time: bluesky starts a run, waits for its end and takes its rows, as
from any device that flies. A run is one start document with the metadata of the bench file, one stream of events, a row
each, and one stop document. Aborting the plan says STOP to the guard; bluesky never owns the source.
"""

import asyncio
import secrets
import time
from collections.abc import AsyncIterator, Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import bluesky.plan_stubs as bps  # pyright: ignore[reportMissingImports]
import bluesky.preprocessors as bpp  # pyright: ignore[reportMissingImports]
from bluesky.utils import MsgGenerator  # pyright: ignore[reportMissingImports]
from ophyd_async.core import AsyncStatus, Device  # pyright: ignore[reportMissingImports]

from bender_hil.bench_file import emulated_bench, read_bench
from bender_hil.guard.stop_ear import say_stop
from bender_hil.runner.tip_camera import Sight
from bender_loop.errors import RunError
from bender_loop.shell.files import unused
from piezo_bender.bench_runs import run_bench

_UNITS = {"s": "s", "V": "V", "um": "um", "A": "A", "C": "degC"}
_STOP_TRIALS = 40

Row = dict[str, Any]


class _Stop:
    """Says STOP to the guard of the run that goes on, and to no later one."""

    def __init__(self) -> None:
        self.token = secrets.token_hex(16)
        self.stop_asked = False
        self._port: int | None = None

    def armed(self, port: int | None) -> None:
        self._port = port

    def see(self, sight: Sight) -> None:
        """Nobody looks on."""

    def press(self) -> None:
        self.stop_asked = True
        for _ in range(_STOP_TRIALS):
            if self._port is None or say_stop(self._port, self.token):
                return


class Bench(Device):
    """A device that flies: `prepare` says what to do, `kickoff` begins, `complete` waits, `collect` gives rows.

    Args:
        bench: bench file; None for the emulated bench.
        name: of the device, and of its stream of events.
        folder: where its runs go, a folder for each.
    """

    def __init__(self, bench: Path | str | None = None, *, name: str = "bench", folder: Path | str = "results") -> None:
        self._path = None if bench is None else Path(bench)
        self._bench = emulated_bench() if self._path is None else read_bench(self._path)
        self._folder = Path(folder)
        self._work: Callable[[Path, _Stop], list[Row]] | None = None
        self._task: asyncio.Task[list[Row]] | None = None
        self._rows: list[Row] = []
        self._began_s = 0.0
        self._stop = _Stop()
        self.directory: Path | None = None
        super().__init__(name)

    @property
    def metadata(self) -> dict[str, str]:
        """What the bench file says under `[metadata]`."""
        return dict(self._bench.metadata)

    def play(self, folder: Path, stop: _Stop, words: dict[str, Any]) -> list[Row]:
        """Make one run; returns the rows of its record."""
        found = run_bench(self._path, out=folder, stop=stop, **words)
        columns = found.record.record.columns()
        rows = [dict(zip(columns, map(float, row), strict=True)) for row in zip(*columns.values(), strict=True)]
        if found.result.ended.code is not None:
            raise RunError(f"the run was ended ({found.result.ended.code}): {found.result.ended.sentence}")
        return rows

    def investigate(self, folder: Path, stop: _Stop, words: dict[str, Any]) -> list[Row]:
        """Let the bench find out what its model lacks; returns one row."""
        from bender_hil.command import OWN_GAINS
        from bender_inference.records.checks import read_model
        from bender_investigate.investigation import Investigation
        from bender_investigate.real_bench import RealBench
        from bender_investigate.settings import InvestigationSettings
        from bender_loop.shell.files import prepare_directory
        from bender_native.ready import ready_plant_fmu
        from bender_tuner.results.gains_file import read_gains

        model = read_model(str(words.pop("model", "bench")))
        named = self._bench.controller.gains
        gains = read_gains(OWN_GAINS if named is None else self._bench.resolve(named))[0]
        prepare_directory(folder)
        port = RealBench(self._bench, lambda model: ready_plant_fmu(model), stop)  # pyright: ignore[reportArgumentType]
        outcome = Investigation(port, model, gains, folder, InvestigationSettings(**words), lambda _: None).run()
        return [
            {
                "verdict": outcome.verdict or "",
                "sentence": outcome.sentence,
                "effects": ", ".join(outcome.effects),
                "bench_s": float(outcome.total_s),
                "plays": float(outcome.plays),
            }
        ]

    @AsyncStatus.wrap
    async def prepare(self, value: Callable[[Path, _Stop], list[Row]]) -> None:
        """Take what is to be done next."""
        self._work, self._rows = value, []

    @AsyncStatus.wrap
    async def kickoff(self) -> None:
        """Begin it, in a thread of its own."""
        work = self._work
        if work is None:
            raise RunError("kickoff: nothing was prepared")
        self._stop = stop = _Stop()
        now = datetime.now().astimezone()
        self.directory = folder = unused(self._folder / f"{self.name}-{now:%Y%m%d-%H%M%S}")
        self._began_s = time.time()
        self._task = asyncio.create_task(asyncio.to_thread(work, folder, stop))

    @AsyncStatus.wrap
    async def complete(self) -> None:
        """Wait for its end; a plan that is aborted says STOP and waits for the output to be off."""
        task = self._task
        if task is None:
            raise RunError("complete: nothing was begun")
        try:
            self._rows = await asyncio.shield(task)
        except asyncio.CancelledError:
            await self.stop()
            raise

    async def stop(self, success: bool = True) -> None:  # noqa: ARG002
        """Say STOP to the guard, where a run goes on."""
        if self._task is not None and not self._task.done():
            await asyncio.to_thread(self._stop.press)
            await asyncio.wait([self._task])

    async def describe_collect(self) -> dict[str, dict[str, Any]]:
        """Say what a row holds."""
        first = self._rows[0] if self._rows else {}
        return {self.name: {f"{self.name}-{name}": self._described(name, value) for name, value in first.items()}}

    async def collect(self) -> AsyncIterator[dict[str, Any]]:
        """Give every row."""
        for row in self._rows:
            at_s = self._began_s + float(row.get("time_s", 0.0))
            data = {f"{self.name}-{name}": value for name, value in row.items()}
            yield {"time": at_s, "data": data, "timestamps": dict.fromkeys(data, at_s)}

    def _described(self, name: str, value: object) -> dict[str, Any]:
        place = "emulated" if self._path is None else self._path.name
        if isinstance(value, str):
            return {"source": f"piezo-bender://{place}/{name}", "dtype": "string", "shape": []}
        units = _UNITS.get(name.rpartition("_")[2], "")
        return {"source": f"piezo-bender://{place}/{name}", "dtype": "number", "shape": [], "units": units}


def play(bench: Bench, **words: Any) -> MsgGenerator[str]:
    """Plan of one run: a voltage profile, or a set-point.

    Args:
        bench: the device.
        **words: as of `piezo_bender.run_bench`: `profile`, `setpoint_um`, `duration_s`, `gains`.
    """
    told = {name: str(value) if isinstance(value, Path) else value for name, value in words.items()}
    return (yield from _one_run(bench, "play", told, lambda folder, stop: bench.play(folder, stop, dict(words))))


def investigate(bench: Bench, **words: Any) -> MsgGenerator[str]:
    """Plan of one investigation, whose outcome is one event.

    Args:
        bench: the device.
        **words: `model`, `budget_s`, `pairs`, `seed`, as of `bender investigate`.
    """
    return (
        yield from _one_run(
            bench, "investigate", dict(words), lambda folder, stop: bench.investigate(folder, stop, dict(words))
        )
    )


def _one_run(bench: Bench, plan: str, words: dict[str, Any], work: Callable[[Path, _Stop], list[Row]]) -> Iterator[Any]:
    md = {**bench.metadata, "plan_name": plan, "plan_args": words, "bench": bench.name}
    # whatever ends the plan, the output is off before it has ended
    return (yield from bpp.finalize_wrapper(_flown(bench, md, work), lambda: bps.stop(bench)))


def _flown(bench: Bench, md: dict[str, Any], work: Callable[[Path, _Stop], list[Row]]) -> Iterator[Any]:
    uid = yield from bps.open_run(md)
    yield from bps.prepare(bench, work, wait=True)
    yield from bps.kickoff(bench, wait=True)
    yield from bps.complete(bench, wait=True)
    yield from bps.collect(bench)
    yield from bps.close_run()
    return uid
