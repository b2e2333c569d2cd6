"""libcosim (OSP) runs one FMU, or a system: job file in, result file out, since the library logs where it likes.

The job is `{"fmu": path, "voltages": [...], "step_s": ..., "references": [input, output]}`, those of the plant where
none are given, or `{"folder": path of an unpacked SSP, "steps": n,
"step_s": ...}`; the result is the displacement in m at the end of every step.
"""

import json
import sys
from pathlib import Path
from typing import Any

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

VOLTAGE, DISPLACEMENT = 0, 1


def alone(job: dict[str, Any]) -> list[float]:
    execution = CosimExecution.from_step_size(step_size=round(1e9 * job["step_s"]))
    plant = execution.add_local_slave(CosimLocalSlave(fmu_path=job["fmu"], instance_name="plant"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator=manipulator)
    execution.add_observer(observer=observer)
    command, reading = job.get("references", [VOLTAGE, DISPLACEMENT])
    found = []
    for voltage in job["voltages"]:
        manipulator.slave_real_values(slave_index=plant, variable_references=[command], values=[voltage])
        execution.step()
        found += observer.last_real_values(slave_index=plant, variable_references=[reading])
    return found


def system(job: dict[str, Any]) -> list[float]:
    execution = CosimExecution.from_ssp_file(ssp_path=job["folder"], step_size=round(1e9 * job["step_s"]))
    plant = execution.slave_index_from_instance_name("plant")
    if plant is None:
        raise SystemExit("no plant in the system")
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    found = []
    for _ in range(job["steps"]):
        execution.step()
        found += observer.last_real_values(slave_index=plant, variable_references=[DISPLACEMENT])
    return found


def main() -> None:
    log_output_level(CosimLogLevel.ERROR)
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    found = alone(job) if "fmu" in job else system(job)
    Path(sys.argv[2]).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
