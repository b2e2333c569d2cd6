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
HOSTILE = {"hang": 1, "crash": 2, "trap": 3, "leave": 4, "eat": 5}


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
) -> Path:
    """Write the FMU; without `any_step` or `state` it does not only say so but refuses, too.

    A hostile one does something that takes its process along (see `HOSTILE`) once it has done `after` steps.
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
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(binary, f"binaries/{fmpy.platform}/{IDENTIFIER}{fmpy.sharedLibraryExtension}")
    return out


def compiled(source: Path, out: Path, flags: list[str]) -> Path:
    """Compile a shared library."""
    compiler = c_compiler()
    assert compiler is not None
    words = [compiler, "-std=c99", "-O1", "-Wall", "-shared", "-fPIC", f"-I{HEADERS}", *flags, str(source)]
    done = subprocess.run([*words, "-o", str(out), "-lm"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out
