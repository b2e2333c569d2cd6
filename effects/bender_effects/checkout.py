"""What `bender effects` writes into a checkout: the skeleton of a new effect, and the pages that follow from all."""

from collections.abc import Iterator

from bender_effects.catalogue import EFFECTS
from bender_effects.documents import INDEX, documents, root_of_checkout, stale
from bender_effects.skeleton import problem, skeleton
from bender_loop.errors import InputError
from bender_loop.shell.files import write_atomically


def begun(effect_id: str, stage: str) -> Iterator[str]:
    """Write the skeleton of a new effect, and yield what was done, line by line.

    Raises:
        InputError: the id or the stage will not do, or this is no checkout.
    """
    root = root_of_checkout()
    wrong = problem(effect_id, stage, root)
    if wrong or root is None:
        raise InputError(wrong or "effects new: no checkout")
    for name, text in skeleton(effect_id, stage, root).items():
        write_atomically(root / name, text.encode())
        yield f"written: {root / name}"
    yield "fill in what says TODO, then: bender effects --write-docs; CONTRIBUTING.md says the rest"


def documented() -> Iterator[str]:
    """Write the pages that follow from the catalogue, and yield what was done, line by line.

    Raises:
        InputError: this is no checkout.
    """
    root = root_of_checkout()
    if root is None:
        raise InputError(f"--write-docs: found an installed package without {INDEX}, expected a checkout")
    wrong = stale(EFFECTS, root)
    for path, text in documents(EFFECTS, root).items():
        if path.as_posix() in wrong:
            write_atomically(root / path, text.encode())
            yield f"written: {root / path}"
    yield from (f"of no effect, remove it: {root / name}" for name in stale(EFFECTS, root) if name in wrong)
    if not wrong:
        yield "the documentation is as the catalogue says"
