"""Child process: read the columns of a MATLAB file (up to version 7.2) and leave them beside each other.

The reader is compiled code that a damaged file can crash; this process then ends, and no other one with it.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

LARGE = "found more numbers than are read"
_LONGEST_REASON = 200


def numbers_of(path: Path) -> int:
    """Return how many numbers the arrays of a file hold together."""
    import scipy.io

    return sum(int(np.prod(shape, dtype=np.float64)) for _, shape, _ in scipy.io.whosmat(path))


def arrays_of(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name that hold plain numbers."""
    import scipy.io

    found = {k: np.asarray(v) for k, v in scipy.io.loadmat(path).items() if not k.startswith("__")}
    return {name: array for name, array in found.items() if array.dtype.kind in "fiub"}


def main(words: list[str]) -> int:
    """Read the file `words[0]` with at most `words[1]` numbers; its arrays go to the file `words[2]`."""
    path, most, out = Path(words[0]), int(words[1]), Path(words[2])
    try:
        if numbers_of(path) > most:
            raise ValueError(LARGE)
        found = arrays_of(path)
    except Exception as error:  # a damaged file makes the library fail in its own way
        reason = str(error).partition("\n")[0][:_LONGEST_REASON] or type(error).__name__
        sys.stdout.buffer.write(reason.encode("utf-8", "replace"))
        return 1
    np.savez(out, names=np.array(list(found)), **{f"column_{k}": x for k, x in enumerate(found.values())})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
