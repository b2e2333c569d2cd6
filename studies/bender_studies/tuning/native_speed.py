"""What an FMU without Python costs beside one with PythonFMU and beside the least one there can be, in one run."""

import os
import statistics
import subprocess
import sys
import sysconfig
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np

import bender_native
from bender_export.build import ensure_plant_fmu
from bender_loop.errors import InputError, RunError
from bender_native.build import native_plant_fmu, way
from bender_native.compilers import compiled, own_compiler, own_platform
from bender_plant.model import load_model
from bender_plant.plant import sub_step_bounds_s
from bender_plant.substeps import GROWTH, lengths_s
from bender_studies.tuning.bare_fmu import BareFmu
from bender_studies.tuning.plants import PLANTS, Problem
from bender_studies.tuning.speed import Figure
from bender_tuner.optimisers import create
from bender_tuner.task.search_space import DIMENSION

PLANT = PLANTS[0]
MODELS = ("paper", "beam", "bench")
EVALUATIONS = 151
STEP_S = 0.01
HOST_STEPS = 200_000
PYTHON_STEPS = 5_000
HOST_LENGTHS_S = (0.001, STEP_S)
_HOSTS = Path(bender_native.__file__).parent / "hosts"
_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="trivial" guid="{trivial}">
  <CoSimulation modelIdentifier="trivial" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="voltage" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="displacement" valueReference="1" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"""

Report = Callable[[int, int, str], None]


def measure_native(repeats: int, report: Report) -> tuple[list[Figure], list[str]]:
    """Measure native and PythonFMU plants of the paper's model, in turns.

    Args:
        repeats: of everything.
        report: told (done, in all, what) before each part.

    Returns:
        The figures and sentences that say what was compared.

    Raises:
        InputError: this machine has no C compiler of its own.
        RunError: an FMU or the compiler fails, or the tunings end at different gains.
    """
    target = own_platform()
    if target is None or own_compiler() is None:
        raise InputError("found no C compiler of this machine's own, expected one: the timing host is compiled by it")
    with tempfile.TemporaryDirectory(prefix="bender_native_speed_") as folder:
        place = Path(folder)
        report(0, 3, "building")
        native = {name: place / f"{name}.fmu" for name in MODELS}
        for name, path in native.items():
            path.write_bytes(native_plant_fmu(load_model(name), way(2, [target.name])))
        trivial = _trivial_fmu(place)
        report(1, 3, "steps")
        figures = []
        for name, path in native.items():
            figures += _sizes(name, place, path)
            figures += _steps(name, place, path, ensure_plant_fmu(name), trivial, repeats)
        report(2, 3, "tunings")
        figures += _tunings(native[PLANT.model], ensure_plant_fmu(PLANT.model), repeats)
    return figures, [
        f"Plants: the built-in models. The host in C takes {HOST_STEPS} steps ({PYTHON_STEPS} of an FMU with Python, "
        f"for which it loads libpython first); through fmpy a step of {STEP_S:g} s is "
        "setReal, doStep and getReal. The trivial FMU hands its input on.",
        f"Tunings: {EVALUATIONS} evaluations of a run of {PLANT.duration_s:g} s at {PLANT.rate_Hz:g} Hz, the same "
        "seed, the same values to the last bit. Targets are judged by the best of the repeats.",
    ]


def _trivial_fmu(place: Path) -> Path:
    headers = Path(fmpy.__file__).parent / "c-code"
    files = {name: (headers / name).read_bytes() for name in ("fmi2FunctionTypes.h", "fmi2TypesPlatform.h")}
    files["trivial.c"] = (_HOSTS / "trivial.c").read_bytes()
    target = own_platform()
    assert target is not None
    library = compiled(files, "trivial", target, ("-fvisibility=default",), own=True)
    path = place / "trivial.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", _DESCRIPTION)
        archive.writestr(f"binaries/{fmpy.platform}/trivial{fmpy.sharedLibraryExtension}", library)
    return path


def _sizes(name: str, place: Path, native: Path) -> list[Figure]:
    """What a target without much room asks for."""
    folder = place / f"{name}_sources"
    with zipfile.ZipFile(native) as archive:
        archive.extractall(folder)
    headers = Path(fmpy.__file__).parent / "c-code"
    program = folder / "sizes"
    includes = [f"-I{folder / 'sources'}", f"-I{headers}"]
    _compile([str(own_compiler()), "-std=c99", *includes, str(_HOSTS / "sizes.c"), "-o", str(program)])
    size = float(subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout)
    first_s, longest_s = sub_step_bounds_s(load_model(name))
    most = float(len(lengths_s(0.0, STEP_S, first_s, longest_s, GROWTH)))
    least = float(len(lengths_s(1.0, STEP_S, first_s, longest_s, GROWTH)))
    return [
        Figure(f"{name}: an instance", "bytes", size, size),
        Figure(f"{name}: sub-steps of a step of {1e3 * STEP_S:g} ms, right after a jump", "1", most, most),
        Figure(f"{name}: sub-steps of a step of {1e3 * STEP_S:g} ms, a second later", "1", least, least),
    ]


def _compile(words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RunError(f"the timing host cannot be compiled: {done.stderr.strip()[:300]}")


def _steps(name: str, place: Path, native: Path, python: Path, trivial: Path, repeats: int) -> list[Figure]:
    volts = (25.0 + 20.0 * np.sin(np.arange(200) / 9.0)).tolist()
    times: dict[str, list[float]] = {"native": [], "python": [], "trivial": []}
    with BareFmu(native) as one, BareFmu(python) as two, BareFmu(trivial) as three:
        for _ in range(20 * repeats):
            for kind, bare in (("native", one), ("python", two), ("trivial", three)):
                times[kind].append(bare.round_trips_s(volts, STEP_S)[0] / len(volts))
        first = _libpython()
        host: dict[float, list[float]] = {length_s: [] for length_s in HOST_LENGTHS_S}
        embedded: dict[float, list[float]] = {length_s: [] for length_s in HOST_LENGTHS_S if first is not None}
        for _ in range(repeats):
            for length_s in HOST_LENGTHS_S:
                host[length_s].append(_host_step_s(place, one, HOST_STEPS, length_s))
            for length_s in embedded:
                embedded[length_s].append(_host_step_s(place, two, PYTHON_STEPS, length_s, first))

    def figure(what: str, seconds: list[float]) -> Figure:
        return Figure(what, "us", 1e6 * min(seconds), 1e6 * statistics.median(seconds))

    def ratio(what: str, above: list[float], below: list[float], **target: float) -> Figure:
        medians = statistics.median(above) / statistics.median(below)
        return Figure(what, "1", min(above) / min(below), medians, **target)

    in_hosts = []
    for length_s, times_s in host.items():
        length = f"{1e3 * length_s:g} ms"
        in_hosts.append(figure(f"{name}: {length} of the native FMU in a host in C", times_s))
        if length_s in embedded:
            other = embedded[length_s]
            in_hosts.append(figure(f"{name}: {length} of the PythonFMU FMU in the same host", other))
            in_hosts.append(
                ratio(f"{name}: PythonFMU over native, {length}, the same host", other, times_s, at_least=200.0)
            )
    return [
        *in_hosts,
        figure(f"{name}: a step of the PythonFMU FMU through fmpy", times["python"]),
        figure(f"{name}: a step of the native FMU through fmpy", times["native"]),
        figure("a step of the trivial FMU through fmpy", times["trivial"]),
        ratio(f"{name}: native over trivial, through fmpy", times["native"], times["trivial"], at_most=1.15),
    ]


def _libpython() -> Path | None:
    """The library that a host without Python has to load before an FMU of PythonFMU; None where there is none."""
    folder, name = sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME")
    path = Path(str(folder)) / str(name)
    return path if ".so" in path.name and path.is_file() else None


def _host_step_s(place: Path, bare: BareFmu, steps: int, length_s: float, first: Path | None = None) -> float:
    host = place / "timing"
    if not host.exists():
        headers = Path(fmpy.__file__).parent / "c-code"
        words = [str(own_compiler()), "-std=c99", "-O2", f"-I{headers}", str(_HOSTS / "timing.c"), "-o", str(host)]
        _compile([*words, "-ldl"])
    library = next((Path(bare.folder) / "binaries" / fmpy.platform).glob(f"*{fmpy.sharedLibraryExtension}"))
    numbers = [str(steps), repr(length_s), "20.0", str(bare.input[0]), str(bare.output[0])]
    resources = (Path(bare.folder) / "resources").as_uri()
    words = [str(host), str(library), resources, str(bare.description.guid), *numbers]
    words += [] if first is None else [str(first)]
    # a Python inside the host looks for its modules where ours are
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        raise RunError(f"the timing host ended with status {done.returncode}: {done.stderr.strip()[:300]}")
    return 1e-9 * float(done.stdout.split()[1])


def _tunings(native: Path, python: Path, repeats: int) -> list[Figure]:
    times: dict[Path, list[float]] = {native: [], python: []}
    found: dict[Path, list[float]] = {}
    for _ in range(repeats):
        for fmu in times:
            problem = Problem(PLANT, fmu)
            try:
                seconds, found[fmu] = _tuned(problem)
            finally:
                problem.close()
            times[fmu].append(seconds)
    if found[native] != found[python]:
        raise RunError("the tunings on the native and on the PythonFMU FMU differ; no times are given")
    fast, slow = times[native], times[python]
    medians = statistics.median(slow) / statistics.median(fast)
    return [
        Figure(f"{EVALUATIONS} evaluations on the native FMU", "s", min(fast), statistics.median(fast), at_most=0.2),
        Figure(f"{EVALUATIONS} evaluations on the PythonFMU FMU", "s", min(slow), statistics.median(slow)),
        Figure("tuning on PythonFMU over native", "1", min(slow) / min(fast), medians, at_least=2.0),
    ]


def _tuned(problem: Problem) -> tuple[float, list[float]]:
    space = problem.box()
    values = []
    began = time.perf_counter()
    optimiser = create("bas", DIMENSION, np.random.default_rng(0), np.full(DIMENSION, 0.5), EVALUATIONS)
    for _ in range(EVALUATIONS):
        x = optimiser.ask()
        value = problem.value(space, x)
        optimiser.tell(x, value)
        values.append(value)
    elapsed = time.perf_counter() - began
    optimiser.close()
    return elapsed, values
