"""Compiled runs of a block over a whole signal, made from the very source of the block.

The source of the block's kernel and of everything it calls is copied into one generated module beside a loop over the
sub-steps; numba compiles the module and keeps the machine code on disk. The module's name carries a hash of its text,
so a changed kernel is a new module.
"""

import ast
import hashlib
import importlib.util
import inspect
import math
import opcode
import re
import sys
import textwrap
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import CodeType, FunctionType, ModuleType
from typing import Any

from platformdirs import user_cache_path

from bender_plant.blocks import BLOCKS, Block
from bender_plant.kernels.state import of_any_length

_HEAD = '''"""Generated from the sources of the plant; a copy, never edited."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numba.core.options import DefaultOptions

# of a numba without this option, which is private, kernels count who holds their arrays
BORROWING = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}

'''

_UNCUT = """
@njit(cache=True, nogil=True)
def run(state, constants, t, h, u0, um, u1, x0, xm, x1):
    y0, ym, y1 = np.empty(h.size), np.empty(h.size), np.empty(h.size)
    {begin}
    for k in range(h.size):
        {step}
    return y0, ym, y1, state
"""

_RUN = """
@njit(cache=True, nogil=True)
def run(state, constants, t, h, u0, um, u1, x0, xm, x1, capacity):
    length = np.empty(capacity)
    begin, y0, ym, y1 = np.empty(capacity), np.empty(capacity), np.empty(capacity), np.empty(capacity)
    parent = np.empty(capacity, np.int64)
    start, stop = np.empty(capacity), np.empty(capacity)
    n = 0
    {begin}
    for k in range(h.size):
        time, rest = t[k], h[k]
        a, m, b = u0[k], um[k], u1[k]
        xa, xb, xc = x0[k], xm[k], x1[k]
        done = 0.0
        while True:
            if n == capacity:
                return -1, state, begin, length, y0, ym, y1, parent, start, stop
            fraction = {corner}
            part = rest
            am, ae, bm = m, b, b
            xam, xae, xbm = xb, xc, xc
            if fraction < 1.0:
                part = rest * fraction
                am, ae, bm, b = cut(a, m, b, fraction)
                xam, xae, xbm, xc = cut(xa, xb, xc, fraction)
            {step}
            begin[n], length[n], parent[n], start[n] = time, part, k, done
            done = done + (1.0 - done) * fraction
            stop[n] = done
            n += 1
            if not fraction < 1.0:
                stop[n - 1] = 1.0
                break
            time, rest = time + part, rest - part
            a, m = ae, bm
            xa, xb = xae, xbm
    return n, state, begin, length, y0, ym, y1, parent, start, stop
"""


_PARSING = threading.Lock()
"""Python counts how deep a tree of syntax is for all threads together: two that parse at once make it stumble."""


def _needs(function: Callable[..., Any], found: dict[str, Any]) -> dict[str, Any]:
    """Collect by name every function and number that a kernel refers to, itself included; caches are looked through."""
    function = inspect.unwrap(function)
    found[function.__name__] = function
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        value = inspect.unwrap(value) if callable(value) else value
        if isinstance(value, FunctionType) and name not in found:
            _needs(value, found)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found[name] = value
    return found


class _Filled(ast.NodeTransformer):
    """Writes what a kernel appends to its next state into an array that it is given first: lists are slow there."""

    name = ""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Take the array as the first argument."""
        self.generic_visit(node)
        node.args.args.insert(0, ast.arg(self.name))
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> list[ast.stmt]:
        """Fill the array with the numbers that the list begins with."""
        assert isinstance(node.target, ast.Name)
        assert isinstance(node.value, ast.List)
        self.name = node.target.id
        begun = [f"{self.name}[{k}] = {ast.unparse(x)}" for k, x in enumerate(node.value.elts)]
        return ast.parse("\n".join([*begun, f"filled = {len(begun)}"])).body

    def visit_Expr(self, node: ast.Expr) -> list[ast.stmt] | ast.AST:
        """Fill the next place where the list is appended to."""
        call = node.value
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "append":
            return ast.parse(f"{self.name}[filled] = {ast.unparse(call.args[0])}\nfilled += 1").body
        return node

    def visit_Return(self, node: ast.Return) -> ast.Return:
        """Return what stands beside the state, which is in the array."""
        assert isinstance(node.value, ast.Tuple)
        node.value.elts = node.value.elts[1:]
        return node


def _compilable(function: Callable[..., Any], options: str) -> str:
    """Return the source of a function to compile, without `del` of unused arguments."""
    source = textwrap.dedent(inspect.getsource(function))
    if _ends_of_any_length(function):
        with _PARSING:
            source = ast.unparse(_Filled().visit(ast.parse(source))) + "\n"
    return f"@njit({options})\n" + re.sub(r"^ +del .*\n|^@.*\n", "", source, flags=re.MULTILINE)


def _ends_of_any_length(function: Callable[..., Any]) -> bool:
    return of_any_length.__name__ in function.__code__.co_names


_BUILDING = {opcode.opmap[name] for name in ("BUILD_LIST", "BUILD_MAP", "BUILD_SET") if name in opcode.opmap}


def _allocates(function: Callable[..., Any]) -> bool:
    """Return whether a compiled function may need memory: for a list other than its next state, or of a library."""
    used = (function.__globals__.get(name) for name in function.__code__.co_names)
    return _built(function.__code__) > _ends_of_any_length(function) or any(_is_of_library(x) for x in used)


def _built(code: CodeType) -> int:
    """Return how many lists and the like a function writes down, in comprehensions as well."""
    within = (x for x in code.co_consts if isinstance(x, CodeType))
    return sum(x in _BUILDING for x in code.co_code[::2]) + sum(map(_built, within))


def _is_of_library(value: Any) -> bool:
    value = inspect.unwrap(value) if callable(value) else value
    if isinstance(value, ModuleType):
        return value is not math
    return callable(value) and not isinstance(value, FunctionType) and value.__module__ not in ("math", "builtins")


def sources(functions: list[Callable[..., Any]]) -> str:
    """Return the beginning of a generated module: the sources of functions, and of all that they call, to compile.

    Only compiled code calls them, so they need no wrappers; these would take a fifth of the time of compiling. Where
    none allocates memory, they borrow their arrays: counting who holds one takes longer than most kernels do.
    """
    found: dict[str, Any] = {}
    for function in functions:
        _needs(function, found)
    numbers = [f"{name} = {value!r}" for name, value in found.items() if not callable(value)]
    kernels = [x for x in found.values() if callable(x) and x is not of_any_length]
    borrowing = "" if any(map(_allocates, kernels)) else ", **BORROWING"
    bodies = [_compilable(x, f"no_cpython_wrapper=True, no_cfunc_wrapper=True{borrowing}") for x in kernels]
    return _HEAD + "\n".join(numbers) + "\n\n\n" + "\n\n".join(bodies)


_IMPORTING = threading.Lock()


def kernels_folder() -> Path:
    """Return where generated modules are written."""
    return user_cache_path("piezo-bender") / "kernels"


def generated(name: str, text: str) -> ModuleType:
    """Import a generated module, written to the user's cache first where it is not there yet; one thread at a time.

    Where that cache cannot be written, a home that is full or read-only, the module lasts as long as the process.

    Raises:
        OSError: it cannot be written anywhere.
    """
    with _IMPORTING:
        return _generated(name, text)


@cache
def _generated(name: str, text: str) -> ModuleType:
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    file = f"bender_kernel_{name}_{digest}.py"
    try:
        return _imported(_written(kernels_folder() / file, text))
    except (OSError, RuntimeError):  # the latter from numba, where it finds no place for machine code
        return _imported(_written(Path(_of_this_process().name) / file, text))


@cache
def _of_this_process() -> "TemporaryDirectory[str]":
    return TemporaryDirectory(prefix="bender-kernels-", ignore_cleanup_errors=True)


def _written(path: Path, text: str) -> Path:
    """Return where a text is, written to a temporary name and moved there unless it is there already."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{id(text)}")
        try:
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    return path


def _imported(path: Path) -> ModuleType:
    # numba takes a while to import: nobody waits for it before there is something to compile
    from bender_compiled.stored_code import use_stored_code

    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path}: not a module")
    module = importlib.util.module_from_spec(spec)
    # numba keeps compiled functions by the name of their module
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    use_stored_code(module)
    return module


@cache
def block_run(block_id: str) -> Callable[..., tuple[Any, ...]]:
    """Return the compiled run of a block with corners: `run(state, constants, t, h, u0, um, u1, x0, xm, x1, capacity)`.

    It returns the number of sub-steps put out (-1: more than the capacity), the state at the end, and for each
    sub-step its begin, length, values, the sub-step it is part of and the fractions of that one where it lies.
    """
    from bender_plant.parabola import cut

    block = BLOCKS[block_id]
    if block.corner is None:
        raise ValueError(f"{block_id} has no corners, expected a block that cuts sub-steps")
    kernel = _checked(block)
    beside = ", xa, xam, xae" if block.beside else ""
    before = ", xa, xb, xc" if block.beside else ""
    corner = f"corner(state, constants, rest, a, m, b{before})"
    loop = _loop(block, f"constants, time, part, a, am, ae{beside}", "n")
    return generated(block_id, sources([cut, kernel, block.corner]) + _RUN.format(corner=corner, **loop)).run


@cache
def uncut_run(block_id: str) -> Callable[..., tuple[Any, Any, Any, Any]]:
    """Return the compiled run of a block without corners: `run(state, constants, t, h, u0, um, u1, x0, xm, x1)`.

    It returns the values at the start, middle and end of every sub-step, and the state at the end.
    """
    block = BLOCKS[block_id]
    if block.corner is not None:
        raise ValueError(f"{block_id} has corners, expected a block that cuts no sub-steps")
    kernel = _checked(block)
    beside = ", x0[k], xm[k], x1[k]" if block.beside else ""
    loop = _loop(block, f"constants, t[k], h[k], u0[k], um[k], u1[k]{beside}", "k")
    return generated(block_id, sources([kernel]) + _UNCUT.format(**loop)).run


def _loop(block: Block, arguments: str, row: str) -> dict[str, str]:
    """Return what begins a loop over sub-steps, and a step of it: a state of any length is written to and fro."""
    kernel, values = _checked(block).__name__, f"y0[{row}], ym[{row}], y1[{row}]"
    if not block.state_of_any_length:
        return {"begin": "", "step": f"state, {values} = {kernel}(state, {arguments})"}
    step = f"{values} = {kernel}(other, state, {arguments}); state, other = other, state"
    return {"begin": "state, other = state.copy(), np.empty_like(state)", "step": step}


def _checked(block: Block) -> Callable[..., Any]:
    """Return the kernel of a block that declares rightly whether its state may be of any length."""
    kernel = block.step
    if kernel is None:
        raise ValueError(f"{block.id} acts on no signal, expected a block with a step")
    ends_so = _ends_of_any_length(inspect.unwrap(kernel))
    if ends_so != block.state_of_any_length:
        declared = "declares STATE_OF_ANY_LENGTH" if block.state_of_any_length else "does not declare it"
        used = "ends its step with of_any_length" if ends_so else "does not end its step with of_any_length"
        raise ValueError(f"{block.id}: found a block that {declared} and {used}, expected both or neither")
    return kernel


_GRID = """
@njit(cache=True, nogil=True)
def grid(
    row_times, instants, values, slopes, elapsed, first_s, longest_s, growth, span, settled_s, lasting_s, capacity
):
    t, h = np.empty(capacity), np.empty(capacity)
    u0, u1 = np.empty(capacity), np.empty(capacity)
    last = np.empty(row_times.size, np.int64)
    last[0] = -1
    n, j = 0, 0
    for row in range(1, row_times.size):
        time, end = row_times[row - 1], row_times[row]
        while time < end:
            while j + 1 < instants.size and instants[j + 1] <= time + INSTANT:
                j += 1
                before = values[j - 1] + slopes[j - 1] * (instants[j] - instants[j - 1])
                jump = abs(values[j] - before)
                if jump > ROUNDING * (abs(values[j]) + abs(values[j - 1])):
                    age = first_s / growth * ((span / jump) ** (1.0 / 3.0) - 1.0) if span > jump else 0.0
                    elapsed = min(elapsed, age)
            stop = end
            if j + 1 < instants.size and instants[j + 1] < end - INSTANT:
                stop = instants[j + 1]
            longest = longest_s
            if slopes[j] == 0.0 and stop - time > settled_s:
                if time - instants[j] < settled_s:
                    stop = time + settled_s
                else:
                    longest = lasting_s
            for length in lengths_s(elapsed, stop - time, first_s, longest, growth):
                if n == capacity:
                    return -1, t, h, u0, u1, last
                t[n], h[n] = time, length
                u0[n] = values[j] + slopes[j] * (time - instants[j])
                u1[n] = values[j] + slopes[j] * (time + length - instants[j])
                n += 1
                time += length
                elapsed += length
            time = stop
        last[row] = n - 1
    return n, t, h, u0, u1, last
"""


@cache
def grid_run() -> Callable[..., tuple[Any, ...]]:
    """Return the compiled cutting of the time between rows into sub-steps, by the plant's own rule.

    What a parabola misses of a transient goes with the jump that began it and the cube of the sub-step. Where a `span`
    is given, a smaller jump counts as one that is so old that the sub-steps behind it miss as much as those behind a
    jump by the span do. Where the command stands for longer than `settled_s`, whatever rings has come to rest and
    `lasting_s` is the longest sub-step.
    """
    from bender_plant.substeps import lengths_s

    return generated("grid", sources([lengths_s]) + "\n\nINSTANT, ROUNDING = 1e-12, 1e-14\n" + _GRID).grid


_CUT = """
@njit(cache=True, nogil=True)
def cut_like(y0, ym, y1, parent, start, stop):
    a, m, b = np.empty(parent.size), np.empty(parent.size), np.empty(parent.size)
    for n in range(parent.size):
        k = parent[n]
        a[n] = value(y0[k], ym[k], y1[k], start[n])
        m[n] = value(y0[k], ym[k], y1[k], 0.5 * (start[n] + stop[n]))
        b[n] = value(y0[k], ym[k], y1[k], stop[n])
    return a, m, b
"""


@cache
def cut_run() -> Callable[..., tuple[Any, Any, Any]]:
    """Return the compiled cutting of parabolas: `cut_like(y0, ym, y1, parent, start, stop)`."""
    from bender_plant.parabola import value

    return generated("cut", sources([value]) + "\n\n" + _CUT).cut_like
