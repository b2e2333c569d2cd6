"""What a test cannot go on without."""

from typing import TypeVar

T = TypeVar("T")


def present(value: T | None) -> T:
    """Return what is there; an AssertionError where nothing is."""
    assert value is not None
    return value
