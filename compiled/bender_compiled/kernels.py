"""Compiled runs of a block over a whole signal, made from the very source of the block.

The source of the block's kernel and of everything it calls is copied into one generated module beside a loop over the
sub-steps; numba compiles the module and keeps the machine code on disk. The module's name carries a hash of its text,
so a changed kernel is a new module.
"""

import ast
import hashlib
import importlib.util
import inspect
import re
import sys
import textwrap
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from platformdirs import user_cache_path

from bender_plant.blocks import BLOCKS, Block
from bender_plant.kernels.state import of_any_length

_HEAD = '''"""Generated from the sources of the plant; a copy, never edited."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

'''

_UNCUT = """
@njit(cache=True, nogil=True)
def run(state, constants, t, h, u0, um, u1, x0, xm, x1):
    y0, ym, y1 = np.empty(h.size), np.empty(h.size), np.empty(h.size)
    for k in range(h.size):
        state, y0[k], ym[k], y1[k] = {step}
    return y0, ym, y1
"""

_RUN = """
@njit(cache=True, nogil=True)
def run(state, constants, t, h, u0, um, u1, x0, xm, x1, capacity):
    length = np.empty(capacity)
    begin, y0, ym, y1 = np.empty(capacity), np.empty(capacity), np.empty(capacity), np.empty(capacity)
    parent = np.empty(capacity, np.int64)
    start, stop = np.empty(capacity), np.empty(capacity)
    n = 0
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
            state, y0[n], ym[n], y1[n] = {step}
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
    """Writes what a kernel appends to its next state into an array as long as `state`: lists are slow there."""

    name = ""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> list[ast.stmt]:
        """Begin the array where the list begins, with the numbers that it begins with."""
        assert isinstance(node.target, ast.Name)
        assert isinstance(node.value, ast.List)
        self.name = node.target.id
        begun = [f"{self.name}[{k}] = {ast.unparse(x)}" for k, x in enumerate(node.value.elts)]
        return ast.parse("\n".join([f"{self.name} = np.empty_like(state)", *begun, f"filled = {len(begun)}"])).body

    def visit_Expr(self, node: ast.Expr) -> list[ast.stmt] | ast.AST:
        """Fill the next place where the list is appended to."""
        call = node.value
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "append":
            return ast.parse(f"{self.name}[filled] = {ast.unparse(call.args[0])}\nfilled += 1").body
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Return the array itself in the end."""
        if isinstance(node.func, ast.Name) and node.func.id == of_any_length.__name__:
            return node.args[0]
        return node


def _compilable(function: Callable[..., Any]) -> str:
    """Return the source of a function to compile, without `del` of unused arguments.

    Only compiled code calls it, so it needs no wrappers; they would take a fifth of the time of compiling.
    """
    source = textwrap.dedent(inspect.getsource(function))
    if of_any_length.__name__ in function.__code__.co_names:
        source = ast.unparse(_Filled().visit(ast.parse(source))) + "\n"
    return "@njit(no_cpython_wrapper=True, no_cfunc_wrapper=True)\n" + re.sub(
        r"^ +del .*\n|^@.*\n", "", source, flags=re.MULTILINE
    )


def sources(functions: list[Callable[..., Any]]) -> str:
    """Return the beginning of a generated module: the sources of functions, and of all that they call, to compile."""
    found: dict[str, Any] = {}
    for function in functions:
        _needs(function, found)
    numbers = [f"{name} = {value!r}" for name, value in found.items() if not callable(value)]
    bodies = [_compilable(x) for x in found.values() if callable(x) and x is not of_any_length]
    return _HEAD + "\n".join(numbers) + "\n\n\n" + "\n\n".join(bodies)


_IMPORTING = threading.Lock()


def kernels_folder() -> Path:
    """Return where generated modules are written."""
    return user_cache_path("piezo-bender") / "kernels"


def generated(name: str, text: str) -> ModuleType:
    """Import a generated module, written to the user's cache first where it is not there yet; one thread at a time."""
    with _IMPORTING:
        return _generated(name, text)


@cache
def _generated(name: str, text: str) -> ModuleType:
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    folder = kernels_folder()
    path = folder / f"bender_kernel_{name}_{digest}.py"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        temporary = folder / f".{path.name}.{id(text)}"
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    return _imported(path)


def _imported(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path}: not a module")
    module = importlib.util.module_from_spec(spec)
    # numba keeps compiled functions by the name of their module
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
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
    step = f"{kernel.__name__}(state, constants, time, part, a, am, ae{beside})"
    return generated(block_id, sources([cut, kernel, block.corner]) + _RUN.format(corner=corner, step=step)).run


@cache
def uncut_run(block_id: str) -> Callable[..., tuple[Any, Any, Any]]:
    """Return the compiled run of a block without corners: `run(state, constants, t, h, u0, um, u1, x0, xm, x1)`.

    It returns the values at the start, middle and end of every sub-step.
    """
    block = BLOCKS[block_id]
    if block.corner is not None:
        raise ValueError(f"{block_id} has corners, expected a block that cuts no sub-steps")
    kernel = _checked(block)
    beside = ", x0[k], xm[k], x1[k]" if block.beside else ""
    step = f"{kernel.__name__}(state, constants, t[k], h[k], u0[k], um[k], u1[k]{beside})"
    return generated(block_id, sources([kernel]) + _UNCUT.format(step=step)).run


def _checked(block: Block) -> Callable[..., Any]:
    """Return the kernel of a block that declares rightly whether its state may be of any length."""
    kernel = block.step
    if kernel is None:
        raise ValueError(f"{block.id} acts on no signal, expected a block with a step")
    ends_so = of_any_length in _needs(kernel, {}).values()
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
