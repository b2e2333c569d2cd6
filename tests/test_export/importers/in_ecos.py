"""ecos runs one FMU, or a system: job file in, result file out.

The job is `{"fmu": path, "voltages": [...], "step_s": ..., "ports": [input, output]}`, the ports those of the plant
where none are named, or `{"ssp": path, "parameter_set": name, "steps": n,
"step_s": ...}`; the result is the displacement in m at the end of every step.
"""

import json
import sys
from pathlib import Path
from typing import Any

from ecospy.EcosSimulation import EcosSimulation
from ecospy.EcosSimulationStructure import EcosSimulationStructure


def alone(job: dict[str, Any]) -> list[float]:
    command, reading = job.get("ports", ["voltage", "displacement"])
    with EcosSimulationStructure() as structure:
        structure.add_model("plant", job["fmu"])
        found = []
        with EcosSimulation(structure=structure, step_size=job["step_s"]) as simulation:
            simulation.init()
            for voltage in job["voltages"]:
                simulation.set_real(f"plant::{command}", voltage)
                simulation.step()
                found.append(simulation.get_real(f"plant::{reading}"))
            simulation.terminate()
    return found


def system(job: dict[str, Any]) -> list[float]:
    found = []
    with EcosSimulation(ssp_path=job["ssp"], step_size=job["step_s"]) as simulation:
        simulation.init(parameter_set=job["parameter_set"])
        for _ in range(job["steps"]):
            simulation.step()
            found.append(simulation.get_real("plant::displacement"))
        simulation.terminate()
    return found


def main() -> None:
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    found = alone(job) if "fmu" in job else system(job)
    Path(sys.argv[2]).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
