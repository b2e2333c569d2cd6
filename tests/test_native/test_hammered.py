"""The compiled plant under a host that treats it badly, watched by the sanitizers of addresses, leaks and behaviour."""

import subprocess
from pathlib import Path

import pytest
from native_hosts import GUID

import bender_native
from bender_native.build import source_files
from bender_native.compilers import own_compiler
from bender_native.plant_source import plant_source
from bender_plant.model import load_model

HAMMER = Path(bender_native.__file__).parent / "hosts" / "hammer.c"
FLAGS = ("-std=c99", "-O1", "-g", "-ffp-contract=off", "-w")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=undefined")
CALLS, INSTANCES = 10_000, 10_000


def _compiler_with_sanitizers(folder: Path) -> str:
    compiler = own_compiler()
    if compiler is None:
        pytest.skip("no C compiler is installed")
    (folder / "empty.c").write_text("int main(void) { return 0; }\n", encoding="utf-8")
    words = [compiler, *SANITIZERS, "empty.c", "-o", "empty"]
    linked = subprocess.run(words, cwd=folder, capture_output=True, check=False)
    if linked.returncode != 0 or subprocess.run([folder / "empty"], capture_output=True, check=False).returncode != 0:
        pytest.skip("the C compiler has no sanitizers")
    return compiler


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("paper", 1), ("beam", 2)])
def test_no_call_is_too_strange_and_no_instance_one_too_many(name: str, seed: int, tmp_path: Path):
    compiler = _compiler_with_sanitizers(tmp_path)
    model = load_model(name)
    source = plant_source(model)
    files = source_files(source, plant_source(model, dual=True), 2)
    identity = f'#define MODEL_GUID "{GUID}"\n#define MODEL_IDENTITY "tested {GUID}"\n'
    for file, data in (files | {"identity.h": identity.encode(), "hammer.c": HAMMER.read_bytes()}).items():
        (tmp_path / file).write_bytes(data)
    sources = sorted(path.name for path in tmp_path.glob("*.c") if path.name != "empty.c")
    built = subprocess.run(
        [compiler, *FLAGS, *SANITIZERS, *sources, "-o", "hammer", "-lm"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr[-2000:]
    references = {row.name: k for k, row in enumerate(source.table)}
    numbers = (seed, CALLS, INSTANCES, references["voltage"], references["displacement"], len(references))
    done = subprocess.run(
        [tmp_path / "hammer", GUID, *map(str, numbers)], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr[-3000:]
    taken, refused = map(int, done.stdout.split())
    assert taken + refused == CALLS
    # neither is everything taken nor everything refused
    assert min(taken, refused) > CALLS // 20
