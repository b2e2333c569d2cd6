"""`bender benchmark native`: what an FMU without Python asks of its target, memory and sub-steps."""

import argparse
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

HELP = "FMUs without Python: bytes of an instance, sub-steps of a communication step"
MODELS = ("paper", "beam", "bench")
STEP_S = 0.01
COLUMNS = ("model", "bytes of an instance", "sub-steps of 10 ms after a jump", "a second later")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the results go."""
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("results/benchmark-native"))


def run(arguments: argparse.Namespace) -> int:
    """Print the table, write native.json.

    Raises:
        InputError: this machine has no C compiler of its own.
        RunError: the compiler fails.
    """
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import print_table
    from bender_native.compilers import own_compiler

    compiler = own_compiler()
    if compiler is None:
        raise InputError("found no C compiler of this machine's own, expected one to measure the size of an instance")
    out: Path = prepare_directory(arguments.out)
    rows = [[name, _bytes_of_instance(name, str(compiler)), *_sub_steps(name)] for name in MODELS]
    write_result(out / "native.json", {"figures": [dict(zip(COLUMNS, row, strict=True)) for row in rows]})
    print_table("What an FMU without Python asks of its target", COLUMNS, rows)
    sys.stdout.write(f"written: {out / 'native.json'}\n")
    return 0


def _bytes_of_instance(model: str, compiler: str) -> int:
    """Compile the sources that the FMU carries beside a program that prints the size of their instance."""
    import fmpy

    import bender_native
    from bender_loop.errors import RunError
    from bender_native.build import native_plant_fmu, way
    from bender_native.compilers import own_platform
    from bender_plant.model import load_model

    target = own_platform()
    assert target is not None
    program = Path(bender_native.__file__).parent / "hosts" / "sizes.c"
    with tempfile.TemporaryDirectory(prefix="bender_native_") as name:
        folder = Path(name)
        (folder / "plant.fmu").write_bytes(native_plant_fmu(load_model(model), way(2, [target.name])))
        with zipfile.ZipFile(folder / "plant.fmu") as archive:
            archive.extractall(folder)
        includes = [f"-I{folder / 'sources'}", f"-I{Path(fmpy.__file__).parent / 'c-code'}"]
        words = [compiler, "-std=c99", *includes, str(program), "-o", str(folder / "sizes")]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RunError(f"the sources of {model} cannot be compiled: {done.stderr.strip()[:300]}")
        return int(subprocess.run([str(folder / "sizes")], capture_output=True, text=True, check=True).stdout)


def _sub_steps(model: str) -> tuple[int, int]:
    """Return into how many sub-steps a step is cut, right after a jump and a second later."""
    from bender_plant.model import load_model
    from bender_plant.plant import sub_step_bounds_s
    from bender_plant.substeps import GROWTH, lengths_s

    first_s, longest_s = sub_step_bounds_s(load_model(model))
    after, later = (len(lengths_s(since_s, STEP_S, first_s, longest_s, GROWTH)) for since_s in (0.0, 1.0))
    return after, later
