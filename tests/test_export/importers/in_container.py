"""fmucontainer wraps FMUs in a native one, which FMPy then runs: job file in, result file out.

The job is `{"fmu": path, "voltages": [...], "step_s": ...}` or `{"folder": path of an unpacked SSP, "steps": n,
"step_s": ..., "start": {file: {variable: value}}}`, with `"controller": file` for another one than the PID block; the
result is the displacement in m at the end of every step.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from running_fmu import RunningFmu

PLANT, CONTROLLER, REFERENCE = "PiezoBender.fmu", "PidController.fmu", "StaircaseReference.fmu"
AS_WRITTEN = dict.fromkeys(("auto_link", "auto_input", "auto_output", "auto_parameter", "auto_local"), False)


def contained(folder: Path, description: dict[str, Any], step_s: float) -> Path:
    """Build the container; its messages go to the standard error."""
    file = folder / "container.json"
    file.write_text(json.dumps({"name": "container.fmu", **AS_WRITTEN, "step_size": step_s, **description}))
    code = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    words = [sys.executable, "-c", code, "-container", file.name, "-fmu-directory", str(folder)]
    subprocess.run(words, cwd=folder, stdout=sys.stderr, check=True)
    return folder / "container.fmu"


def alone(job: dict[str, Any], folder: Path) -> list[float]:
    (folder / PLANT).write_bytes(Path(job["fmu"]).read_bytes())
    ports = {"input": [["voltage", PLANT, "voltage"]], "output": [[PLANT, "displacement", "displacement"]]}
    with RunningFmu(contained(folder, {"fmu": [PLANT], **ports}, job["step_s"])) as container:
        return [container.step(job["step_s"], voltage=voltage)[0] for voltage in job["voltages"]]


def system(job: dict[str, Any], folder: Path) -> list[float]:
    controller = job.get("controller", CONTROLLER)
    for name in (PLANT, controller, REFERENCE):
        (folder / name).write_bytes((Path(job["folder"]) / "resources" / name).read_bytes())
    description = {
        "fmu": [PLANT, controller, REFERENCE],
        "link": [
            [REFERENCE, "setpoint", controller, "setpoint"],
            [PLANT, "displacement", controller, "measurement"],
            [controller, "command", PLANT, "voltage"],
        ],
        "output": [[PLANT, "displacement", "displacement"]],
        "start": [[file, name, value] for file, values in job["start"].items() for name, value in values.items()],
    }
    with RunningFmu(contained(folder, description, job["step_s"])) as container:
        return [container.step(job["step_s"])[0] for _ in range(job["steps"])]


def main() -> None:
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        found = (alone if "fmu" in job else system)(job, Path(folder))
    Path(sys.argv[2]).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
