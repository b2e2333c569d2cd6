"""Do runs go on to the last bit from saved and from serialised states? As a script, over many FMUs in one process.

It reads `{"fmus": [path, ...], "seed": n, "points": k}` from standard input and writes a list of complaints.
"""

import json
import random
import sys
from pathlib import Path

from running_fmu import RunningFmu

START_S = 0.37


def moves(random_numbers: random.Random, count: int) -> list[tuple[float, float]]:
    return [
        (random_numbers.uniform(-20.0, 20.0), random_numbers.choice((1e-4, 0.003, 0.01, 0.12))) for _ in range(count)
    ]


def run(fmu: RunningFmu, steps: list[tuple[float, float]]) -> list[list[float]]:
    return [fmu.step(step_s, voltage=voltage_V) for voltage_V, step_s in steps]


def complaints(path: Path, seed: int, points: int) -> list[str]:
    found: list[str] = []
    random_numbers = random.Random(f"{path.name} {seed}")
    with RunningFmu(path, start_s=START_S) as fmu, RunningFmu(path, start_s=-1.0) as other:
        for _ in range(points):
            run(fmu, moves(random_numbers, random_numbers.randrange(6)))
            live, data, time_s = fmu.slave.getFMUState(), fmu.saved(), fmu.time_s
            steps = moves(random_numbers, 6)
            expected = run(fmu, steps)
            fmu.slave.setFMUState(live)
            fmu.slave.freeFMUState(live)
            fmu.time_s = time_s
            if run(fmu, steps) != expected:
                found.append(f"{path.name}: the restored state goes on otherwise")
            run(other, moves(random_numbers, 2))
            other.restore(data)
            other.time_s = time_s
            if run(other, steps) != expected:
                found.append(f"{path.name}: the deserialised state goes on otherwise in another instance")
    return found


def main() -> None:
    job = json.load(sys.stdin)
    found = [text for path in job["fmus"] for text in complaints(Path(path), job["seed"], job["points"])]
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
