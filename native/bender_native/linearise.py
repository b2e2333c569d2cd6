"""A linear model of the plant at an operating point: A, B, C, D of one communication step with the voltage held.

    x[k+1] = A x[k] + B u[k]      y[k] = C x[k] + D u[k]

u is the change of the voltage, held from sample k to k+1; y the change of the outputs, read before the voltage of that
sample acts, so D = 0. x holds the states of the blocks, in the units of the plant (um, V, s), and the outputs in m.
The numbers are the derivatives of one step of the translated plant, not differences. The voltage that was in force
before counts as just changed: a step of the linear model is the answer to a change of the voltage.

Where a kernel has a corner (a play that engages, a hysteresis that turns) the answers to more and to less voltage
differ: the derivative is that of the branch which the step takes, and a note says so.
"""

import ctypes
import json
import math
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError, RunError
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_native.build import source_files
from bender_native.compilers import compiled, own_platform
from bender_native.plant_source import plant_source
from bender_plant.model import Model, load_model
from bender_plant.parameter import ModelError
from bender_plant.plant import Plant, State

Array = NDArray[np.float64]
OUTPUTS = ("displacement", "tip_displacement")
_PROBE_V = 1e-4
_DISAGREEMENT = 0.02
_SETTLING_STEPS = 200


@dataclass(frozen=True, slots=True)
class Linear:
    """The linear model and where it holds.

    Attributes:
        A: (n, n), B: (n, 1), C: (2, n), D: (2, 1); see the module.
        states: n names.
        step_s: sampling time.
        voltage_V: of the operating point.
        displacement_m: reading there.
        tip_displacement_m: tip there.
        delay_s: delay of the command, which is not in the matrices.
        notes: what the user must know of the numbers.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    step_s: float
    voltage_V: float
    displacement_m: float
    tip_displacement_m: float
    delay_s: float
    notes: tuple[str, ...]


def linearised(model: str | Path | Model, voltage_V: float, step_s: float, settle_s: float) -> Linear:
    """Return the linear model of the plant after a voltage has been held.

    Raises:
        InputError: there is no such model, a number is out of range, or the model cannot be translated.
        RunError: there is no C compiler, or the plant ran away.
    """
    if not (math.isfinite(voltage_V) and 0.0 < step_s < math.inf and 0.0 < settle_s < math.inf):
        raise InputError(
            f"found {voltage_V!r} V, step {step_s!r} s, settling {settle_s!r} s, expected finite, times > 0"
        )
    try:
        loaded = model if isinstance(model, Model) else load_model(model)
    except ModelError as problem:
        raise InputError(str(problem)) from None
    delay_s = loaded.values().get("transport_delay.delay", 0.0)
    whole = tuple(settings for settings in loaded.blocks if settings.id != "transport_delay")
    loaded = replace(loaded, blocks=whole)
    plant, state, time_s = _settled(loaded, voltage_V, settle_s)
    _, reading_um, tip_um = plant.step(state, voltage_V, time_s, step_s)
    A, B, names = _slopes(loaded, state, voltage_V, time_s, step_s)
    notes = _notes(plant, state, voltage_V, time_s, step_s, B[-2, 0], delay_s)
    kept = [k for k in range(len(names)) if names[k] in OUTPUTS or not _is_inert(A, B, k)]
    A, B, names = A[np.ix_(kept, kept)], B[kept], tuple(names[k] for k in kept)
    C = np.zeros((len(OUTPUTS), len(names)))
    for row, output in enumerate(OUTPUTS):
        C[row, names.index(output)] = 1.0
    return Linear(
        A, B, C, np.zeros((len(OUTPUTS), 1)), names, step_s, voltage_V, reading_um / 1e6, tip_um / 1e6, delay_s, notes
    )


def _is_inert(A: Array, B: Array, k: int) -> bool:
    """Return whether a state is moved by nothing and moves nothing: that of a load which the modes do not have."""
    others = np.arange(A.shape[0]) != k
    return not (A[k, others].any() or A[others, k].any() or B[k].any())


def write_linear(linear: Linear, out: Path) -> None:
    """Write a linear model as JSON, or as NumPy's .npz.

    Raises:
        InputError: the ending is neither, or the place cannot be written.
    """
    content = table_content(out)(asdict(linear) | {"inputs": ["voltage"], "outputs": list(OUTPUTS)})
    prepare_directory(out.parent)
    write_atomically(out, content)


def table_content(out: Path) -> Callable[[Mapping[str, Any]], bytes]:
    """Return what makes the content of a file of matrices, by its ending: JSON, or NumPy's .npz.

    Raises:
        InputError: the ending is neither.
    """
    if out.suffix not in (".json", ".npz"):
        raise InputError(f"{out}: found the ending {out.suffix!r}, expected .json or .npz")
    return _npz if out.suffix == ".npz" else _json


def _npz(table: Mapping[str, Any]) -> bytes:
    buffer = BytesIO()
    np.savez(buffer, **{name: np.asarray("" if x is None else x) for name, x in table.items()})  # pyright: ignore[reportArgumentType]
    return buffer.getvalue()


def _json(table: Mapping[str, Any]) -> bytes:
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in table.items()}
    return (json.dumps(plain, indent=1) + "\n").encode()


def _settled(model: Model, voltage_V: float, settle_s: float) -> tuple[Plant, State, float]:
    plant = Plant(model)
    state, time_s, length_s = plant.initial(), 0.0, settle_s / _SETTLING_STEPS
    try:
        for _ in range(_SETTLING_STEPS):
            state, _, _ = plant.step(state, voltage_V, time_s, length_s)
            time_s += length_s
    except (ArithmeticError, ValueError) as problem:
        raise RunError(f"{model.name}: no operating point at {voltage_V:g} V: {problem}") from None
    # a change of the voltage begins the short sub-steps, so the answer to one is taken after a change, however small
    return plant, state._replace(voltage_V=math.nextafter(voltage_V, math.inf)), time_s


def _slopes(
    model: Model, state: State, voltage_V: float, time_s: float, step_s: float
) -> tuple[Array, Array, list[str]]:
    target = own_platform()
    if target is None:
        raise RunError("found a machine that no C compiler here compiles for, expected x86-64 or 64-bit ARM")
    source, slopes = plant_source(model), plant_source(model, dual=True)
    identity = {"identity.h": b'#define MODEL_GUID ""\n#define MODEL_IDENTITY ""\n'}
    library = compiled(source_files(source, slopes, 2) | identity, "linear", target, ["-fvisibility=default"])
    folder = Path(tempfile.mkdtemp(prefix="bender_linearise_"))
    try:
        path = folder / f"linear{target.ending}"
        path.write_bytes(library)
        run = ctypes.CDLL(str(path)).slopes_of_state
        values = np.array([float(row.start) for row in source.table])
        values[0] = voltage_V
        start = np.array(list(_flat(state)))
        columns = []
        for k in range(-1, start.size):
            seeds, state_seeds = np.zeros(values.size), np.zeros(start.size)
            (seeds if k < 0 else state_seeds)[max(k, 0)] = 1.0
            columns.append(_one(run, values, seeds, start, state_seeds, time_s, step_s))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    slopes_of = np.array(columns).T
    # the age of the command and the command in force are no states of a step that begins with a new command
    rows = [*range(2, start.size), start.size, start.size + 1]
    names = [*source.states[2:], *OUTPUTS]
    A = np.zeros((len(rows), len(rows)))
    A[:, : start.size - 2] = slopes_of[rows, 3:]
    return A, slopes_of[rows, :1], names


def _one(
    run: "ctypes._NamedFuncPointer", values: Array, seeds: Array, start: Array, state_seeds: Array, time_s: float,
    step_s: float,
) -> list[float]:  # fmt: skip
    """Return the derivatives of all states at the end of the step, then of the two outputs."""
    found, after = np.zeros(values.size), np.zeros(start.size)
    places = [x.ctypes.data_as(ctypes.c_void_p) for x in (values, seeds, start, state_seeds)]
    ends = [x.ctypes.data_as(ctypes.c_void_p) for x in (found, after)]
    if run(*places, ctypes.c_double(time_s), ctypes.c_double(step_s), *ends, None):
        raise RunError("the step at the operating point cannot be repeated")
    numbers = [*after.tolist(), found[1], found[2]]
    if not np.all(np.isfinite(numbers)):
        raise RunError("there is no derivative at the operating point: it is not finite")
    return numbers


def _flat(state: State) -> list[float]:
    return [state.voltage_V, state.since_jump_s, *[x for block in state.blocks for x in block]]


def _notes(
    plant: Plant, state: State, voltage_V: float, time_s: float, step_s: float, slope: float, delay_s: float
) -> tuple[str, ...]:
    notes = []
    if delay_s > 0.0:
        notes.append(f"the delay of {delay_s:g} s is not in the matrices: put it in front of the input")
    here, above, below = (
        plant.step(state, voltage_V + change, time_s, step_s)[1] / 1e6 for change in (0.0, _PROBE_V, -_PROBE_V)
    )
    sides = (above - here) / _PROBE_V, (here - below) / _PROBE_V
    size = max(abs(slope), *map(abs, sides))
    if size > 0.0 and max(abs(side - slope) for side in sides) > _DISAGREEMENT * size:
        up, down = sides
        notes.append(
            f"a corner lies here: {up:.4g} m/V for more voltage, {down:.4g} m/V for less; "
            f"the matrices have {slope:.4g} m/V"
        )
    return tuple(notes)
