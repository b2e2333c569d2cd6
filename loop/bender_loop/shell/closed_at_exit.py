"""What is closed at the end of a `with` block."""

from abc import ABC, abstractmethod
from typing import Self


class ClosedAtExit(ABC):
    """A context manager whose end is `close`, whatever ended the block."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Let go of everything; may be called again."""
