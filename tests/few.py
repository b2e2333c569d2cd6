"""Some cases of a parametrisation for every run of the tests, the others for `make test-all`."""

from collections.abc import Iterable
from typing import Any

import pytest


def few(cases: Iterable[Any], *kept: int) -> list[Any]:
    """Return all cases, those `slow` whose places are not among those kept."""
    return _marked([case if _is_param(case) else pytest.param(case) for case in cases], kept)


def few_rows(rows: Iterable[Any], *kept: int) -> list[Any]:
    """Return the same for rows of several values."""
    return _marked([row if _is_param(row) else pytest.param(*row) for row in rows], kept)


def _is_param(case: Any) -> bool:
    return isinstance(case, type(pytest.param()))


def _marked(cases: list[Any], kept: tuple[int, ...]) -> list[Any]:
    assert set(kept) <= set(range(len(cases))), f"{len(cases)} cases have no place {max(kept)}"
    return [
        case if place in kept else pytest.param(*case.values, marks=[*case.marks, pytest.mark.slow], id=case.id)
        for place, case in enumerate(cases)
    ]
