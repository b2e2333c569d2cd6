"""`python -m bench_trials supply process camera pairs kills`, in `tests/`: whole matrices of faults, for hours."""

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from itertools import product
from pathlib import Path

from bench_trials.camera_faults import CAMERA_FAULTS, CAMERA_STATES, run_camera_cell
from bench_trials.fault_matrix import Cell, cells, run_cell
from bench_trials.kills import SCENARIOS, Chain, Kill, run_chain
from bench_trials.matrix import run_matrix
from bench_trials.pair_faults import PAIRS, PairCell, faults_of, pair_bench, run_pair_cell
from bench_trials.process_faults import process_faults, run_process_cell
from bender_export.build import ensure_plant_fmu
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_loop.shell.files import finite, unused, write_atomically
from bender_native.ready import ready_plant_fmu


def _supply(fmu: Path, folder: Path) -> Iterator[Cell]:
    yield from run_matrix(cells(), run_cell, fmu, folder)


def _process(fmu: Path, folder: Path) -> Iterator[Cell]:
    yield from run_matrix(process_faults(), run_process_cell, fmu, folder)


def _camera(fmu: Path, folder: Path) -> Iterator[Cell]:
    with EmulatedBench(EmulationSettings(), fmu, 30.0) as bench:
        for fault, state in product(CAMERA_FAULTS, CAMERA_STATES):
            yield run_camera_cell(bench, fault, state, folder / f"{fault}-{state}")


def _pairs(fmu: Path, folder: Path) -> Iterator[PairCell]:
    for source, sensor in PAIRS:
        with pair_bench(source, sensor, fmu) as bench:
            for number, fault in enumerate(faults_of(sensor)):
                yield run_pair_cell(bench, source, sensor, fault, folder / source / sensor / str(number))


def _kills(_: Path, folder: Path) -> Iterator[Chain | Kill]:
    for scenario in SCENARIOS:
        place = folder / scenario.name.replace(" ", "-")
        place.mkdir(parents=True)
        chain = run_chain(scenario, ready_plant_fmu("bench"), place, print)
        yield from (*chain.kills, chain)


PARTS = {"supply": _supply, "process": _process, "camera": _camera, "pairs": _pairs, "kills": _kills}


def main() -> int:
    """Print what is broken and the counts, write trials.json; return 1 where something is broken."""
    parser = argparse.ArgumentParser(prog="python -m bench_trials", description=__doc__)
    parser.add_argument("parts", nargs="+", choices=PARTS)
    parser.add_argument("--out", type=Path, default=Path("results/bench-trials"))
    asked = parser.parse_args()
    out, fmu = unused(asked.out), ensure_plant_fmu("bench")
    out.mkdir(parents=True)
    told: dict[str, list[object]] = {}
    broken = 0
    for part in asked.parts:
        found = list(PARTS[part](fmu, out / part))
        told[part] = [asdict(x) for x in found]
        write_atomically(out / "trials.json", json.dumps(finite(told), indent=1) + "\n")
        sys.stdout.writelines(f"BROKEN: {x}\n" for x in found if x.broken)
        seconds = [x.seconds for x in found if not isinstance(x, Chain) and x.seconds is not None]
        counts = f"{len(found)} trials, {sum(bool(x.broken) for x in found)} broken"
        sys.stdout.write(f"{part}: {counts}; off or alarm within {max(seconds, default=0.0):.2f} s\n")
        broken += sum(bool(x.broken) for x in found)
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
