"""FMUs that this project did not make: a lag in C, compiled against FMPy's copy of the FMI headers."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest

SOURCES = Path(__file__).parent / "foreign"
HEADERS = Path(fmpy.__file__).parent / "c-code"
IDENTIFIER = "foreign_lag"
TAU_S = 0.1
MEASUREMENT = """\
    <ScalarVariable name="measurement" valueReference="7" causality="input" variability="continuous">
      <Real start="0" unit="m"/>
    </ScalarVariable>
"""
_LIBRARIES: dict[tuple[str, ...], bytes] = {}
HOSTILE = {"hang": 1, "crash": 2, "trap": 3, "leave": 4, "eat": 5, "nan": 6, "close": 7}


def c_compiler() -> str | None:
    return os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


needs_compiler = pytest.mark.skipif(
    c_compiler() is None or sys.platform == "win32", reason="no C compiler is installed (or one for another platform)"
)


def foreign_fmu(
    out: Path,
    *,
    any_step: bool = True,
    state: bool = True,
    input_unit: str = "V",
    output_unit: str = "m",
    gain: float = 1e-6,
    hostile: str | None = None,
    after: int = 3000,
    controller: bool = False,
) -> Path:
    """Write the FMU; without `any_step` or `state` it does not only say so but refuses, too.

    A hostile one does something that takes its process along (see `HOSTILE`) once it has done `after` steps. As a
    controller it commands its gain times the set-point, late, whatever the measurement.
    """
    refuses_state, even_steps = not state, not any_step
    starts = {"GAIN_START": gain, "REFUSES_STATE_START": int(refuses_state), "EVEN_STEPS_START": int(even_steps)}
    if hostile is not None:
        starts |= {"HOSTILE": HOSTILE[hostile], "HOSTILE_AFTER": after}
    binary = compiled(
        SOURCES / "lag.c", out.with_suffix(".so"), [f"-D{name}={value!r}" for name, value in starts.items()]
    )
    filled = {
        "any_step": any_step, "state": state, "input_unit": input_unit, "output_unit": output_unit, "gain": gain,
        "refuses_state": refuses_state, "even_steps": even_steps,
    }  # fmt: skip
    text = (SOURCES / "modelDescription.xml").read_text(encoding="utf-8")
    for name, value in filled.items():
        text = text.replace(f"@{name}@", str(value).lower() if isinstance(value, bool) else str(value))
    if controller:
        text = text.replace("drive.u", "setpoint").replace("sensor.y", "command")
        text = text.replace("  </ModelVariables>", f"{MEASUREMENT}  </ModelVariables>")
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(binary, f"binaries/{fmpy.platform}/{IDENTIFIER}{fmpy.sharedLibraryExtension}")
    return out


OSCILLATOR = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Oscillator" guid="{{7e5c0d52-1c5b-4a57-8f0b-3d8f6f3f7a11}}">
  <CoSimulation modelIdentifier="oscillator" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"><Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="continuous" initial="calculated">
      <Real/>
    </ScalarVariable>
{parameters}
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs><InitialUnknowns><Unknown index="2"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
OSCILLATOR_STARTS = {"mass": 0.5, "damping": 4.0, "stiffness": 800.0, "cubic": 0.0, "force": 800.0, "idle": 1.0}


def oscillator_fmu(out: Path, cubic: float = 0.0) -> Path:
    """Write a mass on a spring: 6.4 Hz, damped by 0.1, one unit of y per unit of u; `idle` does nothing."""
    starts = OSCILLATOR_STARTS | {"cubic": cubic}
    rows = [
        f'    <ScalarVariable name="{name}" valueReference="{k + 2}" causality="parameter" variability="tunable" '
        f'initial="exact"><Real start="{value}"/></ScalarVariable>'
        for k, (name, value) in enumerate(starts.items())
    ]
    binary = compiled(SOURCES / "oscillator.c", out.with_suffix(".so"), [f"-DCUBIC_START={cubic!r}"])
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", OSCILLATOR.format(parameters="\n".join(rows)))
        archive.write(binary, f"binaries/{fmpy.platform}/oscillator{fmpy.sharedLibraryExtension}")
    return out


ARM = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Arm" guid="{2f0e1a64-7b1d-4c0e-9a55-6f1d2c3b4a59}">
  <CoSimulation modelIdentifier="arm" canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions>
    <Unit name="V"><BaseUnit kg="1" m="2" s="-3" A="-1"/></Unit><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>
    <Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
  </UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.02"/>
  <ModelVariables>
    <ScalarVariable name="command" valueReference="0" causality="input" variability="continuous">
      <Real start="0" unit="V"/></ScalarVariable>
    <ScalarVariable name="load" valueReference="1" causality="input" variability="continuous">
      <Real start="0" unit="N"/></ScalarVariable>
    <ScalarVariable name="tip" valueReference="2" causality="output" variability="continuous" initial="calculated">
      <Real unit="mm"/></ScalarVariable>
    <ScalarVariable name="force" valueReference="3" causality="output" variability="continuous" initial="calculated">
      <Real unit="N"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="3"/><Unknown index="4"/></Outputs>
    <InitialUnknowns><Unknown index="3"/><Unknown index="4"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
ARM_TIP_mm, ARM_FORCE_N = (0.1, 0.05, -0.8), (0.04, 0.02, 0.5)
"""Lag in s, per V of the command, per N of the load."""


def arm_fmu(out: Path) -> Path:
    """Write an arm with two inputs (command, load) and two outputs (tip, force), each a lag of both inputs."""
    binary = compiled(SOURCES / "arm.c", out.with_suffix(".so"), [])
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", ARM)
        archive.write(binary, f"binaries/{fmpy.platform}/arm{fmpy.sharedLibraryExtension}")
    return out


def compiled(source: Path, out: Path, flags: list[str]) -> Path:
    """Compile a shared library, once in a session for the same source and flags."""
    compiler = c_compiler()
    assert compiler is not None
    words = [compiler, "-std=c99", "-O1", "-Wall", "-shared", "-fPIC", f"-I{HEADERS}", *flags, str(source)]
    if (kept := _LIBRARIES.get(tuple(words))) is None:
        done = subprocess.run([*words, "-o", str(out), "-lm"], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        _LIBRARIES[tuple(words)] = out.read_bytes()
    else:
        out.write_bytes(kept)
    return out
