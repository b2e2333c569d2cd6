"""Names of records that are distinguished as they are told: runs of a bench all call theirs `record.csv`."""

from collections.abc import Sequence
from pathlib import Path


def distinct_names(names: Sequence[str]) -> list[str]:
    """Return the end of each path, as short as distinguishes it from the others; alike where the paths are alike."""
    parts = [Path(name).parts or (name,) for name in names]
    longest = max((len(x) for x in parts), default=1)
    short = [x[-1] for x in parts]
    for count in range(2, longest + 1):
        again = [name for name in short if short.count(name) > 1]
        if not again:
            break
        short = ["/".join(x[-count:]) if name in again else name for x, name in zip(parts, short, strict=True)]
    return short
