"""The FMI calls of a communication step, made as cheap as Python allows.

fmpy builds its arrays and looks its functions up at every call; here they are made once, and the values of the same
few ctypes objects change. Without argtypes ctypes passes such objects on as they are.
"""

import ctypes
from collections.abc import Callable

from fmpy.fmi2 import fmi2Warning

from bender_loop.fmu.instance import FmuInstance
from bender_loop.fmu.slave3 import Slave3

Advance = Callable[[float, float, float], float]
Read = Callable[[], float]


def step_calls(
    instance: FmuInstance, input_reference: int, output_reference: int, *, rollback: bool
) -> tuple[Advance, Read]:
    """Functions bound to one input and one output of `instance`.

    Args:
        instance: stays bound also when it is reset or made anew.
        input_reference: value reference of a Real input (FMI 2.0) or a Float64 one (FMI 3.0).
        output_reference: value reference of such an output.
        rollback: whether the state may be set back to an earlier time.

    Returns:
        `advance(value, time_s, step_s)` sets the input, steps and returns the output at the end; `read()` returns
        the output as it is. Both raise RunError when the FMU reports anything graver than a warning.
    """
    if isinstance(instance.slave, Slave3):
        return _step_calls3(instance, input_reference, output_reference, rollback)
    # Indexing the library makes function objects of our own; attributes are shared with fmpy, which types them.
    set_real = instance.library["fmi2SetReal"]
    do_step = instance.library["fmi2DoStep"]
    get_real = instance.library["fmi2GetReal"]
    component, one, final = instance.component, ctypes.c_size_t(1), ctypes.c_int(not rollback)
    time, step = ctypes.c_double(), ctypes.c_double()
    taken, given = ctypes.c_double(), ctypes.c_double()
    taken_pointer, given_pointer = ctypes.byref(taken), ctypes.byref(given)
    input_pointer = ctypes.byref(ctypes.c_uint(input_reference))
    output_pointer = ctypes.byref(ctypes.c_uint(output_reference))

    def advance(value: float, time_s: float, step_s: float) -> float:
        taken.value = value
        time.value = time_s
        step.value = step_s
        if (
            (status := set_real(component, input_pointer, one, taken_pointer)) > fmi2Warning
            or (status := do_step(component, time, step, final)) > fmi2Warning
            or (status := get_real(component, output_pointer, one, given_pointer)) > fmi2Warning
        ):
            raise instance.failure(f"the step of {step_s!r} s from t = {time_s!r} s at input {value!r}", status)
        return given.value

    def read() -> float:
        status = get_real(component, output_pointer, one, given_pointer)
        if status > fmi2Warning:
            raise instance.failure("reading the output", status)
        return given.value

    return advance, read


def _step_calls3(
    instance: FmuInstance, input_reference: int, output_reference: int, rollback: bool
) -> tuple[Advance, Read]:
    set_float, do_step, get_float = (instance.library[f"fmi3{x}"] for x in ("SetFloat64", "DoStep", "GetFloat64"))
    component, one, final = instance.component, ctypes.c_size_t(1), ctypes.c_bool(not rollback)
    time, step = ctypes.c_double(), ctypes.c_double()
    taken, given = ctypes.c_double(), ctypes.c_double()
    event, ends, early, reached = ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double()
    told = (ctypes.byref(event), ctypes.byref(ends), ctypes.byref(early), ctypes.byref(reached))
    taken_pointer, given_pointer = ctypes.byref(taken), ctypes.byref(given)
    input_pointer = ctypes.byref(ctypes.c_uint(input_reference))
    output_pointer = ctypes.byref(ctypes.c_uint(output_reference))

    def advance(value: float, time_s: float, step_s: float) -> float:
        taken.value = value
        time.value = time_s
        step.value = step_s
        if (
            (status := set_float(component, input_pointer, one, taken_pointer, one)) > fmi2Warning
            or (status := do_step(component, time, step, final, *told)) > fmi2Warning
            or (status := get_float(component, output_pointer, one, given_pointer, one)) > fmi2Warning
        ):
            raise instance.failure(f"the step of {step_s!r} s from t = {time_s!r} s at input {value!r}", status)
        if ends.value:
            raise instance.failure(f"the FMU asked for the end of the simulation in the step from {time_s!r} s", 1)
        return given.value

    def read() -> float:
        status = get_float(component, output_pointer, one, given_pointer, one)
        if status > fmi2Warning:
            raise instance.failure("reading the output", status)
        return given.value

    return advance, read
