"""Kernels compiled in a process beside this one, where the machine code of most of them is not on disk yet.

Compiling holds the interpreter: threads do not share that work. This process compiles what it needs, in the order in
which it needs it; the other one begins at the end of the list. Whatever is on disk when it is needed is read.
"""

import contextlib
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from bender_compiled.kernels import block_run, kernels_folder
from bender_compiled.linear_modes import LINEAR_MODES
from bender_compiled.parallel_map import cores
from bender_compiled.simulation import constants_of, has_linear_modes, initial_of, uncut_values
from bender_plant.blocks import Block
from bender_plant.model import Model
from bender_plant.plant import effective_settings

A_STEP_S = 1e-3
FEWEST = 4
"""Kernels that are missing: what fewer take is no more than what beginning a process does."""


@contextlib.contextmanager
def compile_in_background(models: Callable[[], Sequence[Model]]) -> Iterator[None]:
    """Compile the kernels of models beside the block, the last ones first, where most are missing and a core is free.

    Args:
        models: returns them; called only where a core is free. What the first one has, the block compiles itself.
    """
    wanted = models() if cores() > 1 else []
    child = _begun(list(wanted)) if len(_missing(wanted)) >= FEWEST else None
    try:
        yield
    finally:
        if child is not None:
            child.kill()
            child.wait()


def _begun(models: list[Model]) -> "subprocess.Popen[bytes] | None":
    """Return a process that compiles; None where none can be begun: this one compiles by itself then."""
    words, nowhere = [sys.executable, "-P", "-m", __name__], subprocess.DEVNULL
    with contextlib.suppress(OSError):
        child = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=nowhere, stderr=nowhere)
        assert child.stdin is not None
        with contextlib.suppress(OSError), child.stdin:
            pickle.dump(models, child.stdin)
        return child
    return None


def _missing(models: Sequence[Model]) -> set[str]:
    """Return the kernels of the models of which none has ever been written here."""
    folder = kernels_folder()
    there = {x.name for x in folder.glob("*.py")} if folder.is_dir() else set[str]()
    wanted = {name for model in models for name, _, _ in _kernels(model)}
    return {x for x in wanted if not any(name.startswith(f"bender_kernel_{x}_") for name in there)}


def compile_blocks(models: Sequence[Model]) -> list[str]:
    """Compile the kernels of what models have beyond the first one; returns their names, the last model's first."""
    done: list[str] = []
    known = {name for name, _, _ in _kernels(models[0])}
    for model in models[:0:-1]:
        for name, block, constants in _kernels(model):
            if name in known or name in done:
                continue
            arguments = (np.zeros(1), np.full(1, A_STEP_S), *np.zeros((6, 1)))
            if block.corner is None:
                uncut_values(block, constants, arguments)
            else:
                block_run(block.id)(initial_of(block, constants), constants, *arguments, 16)
            done.append(name)
    return done


def _kernels(model: Model) -> Iterator[tuple[str, Block, tuple[Any, ...]]]:
    """Yield name, block and constants of every kernel that a model is simulated with."""
    for block, parameters in effective_settings(model):
        if block.step is not None and not block.modify:
            constants = constants_of(block, parameters, model)
            yield LINEAR_MODES if has_linear_modes(block, constants) else block.id, block, constants


if __name__ == "__main__":
    # the terminal's Ctrl-C is for the process that this one works for, which ends it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    compile_blocks(pickle.load(sys.stdin.buffer))
