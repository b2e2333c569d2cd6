"""A file that grows under one name, and is sometimes another one: replaced, cut short, or moved away by a rotation."""

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from bender_loop.errors import InputError

BYTES_AT_ONCE = 1 << 20
KNOWN_BY = 1024
"""Bytes at the beginning by which a file is known again."""


@dataclass(slots=True)
class Growing:
    """The bytes of a file as they come.

    Attributes:
        path: of the file.
        offset: bytes that were read.
        top: digest of the first bytes that were read, by which the file is known again; "" for a file not read yet.
    """

    path: Path
    offset: int = 0
    top: str = ""
    _known: int = 0
    _file: BinaryIO | None = field(default=None, init=False)

    def read(self) -> bytes | None:
        """Return what was written further, b"" for nothing; None where another file has taken the place of this one.

        Raises:
            InputError: the file cannot be read.
        """
        try:
            if self._file is None:
                self._file = self.path.open("rb")
            if not self._is_the_same():
                self.close()
                return None
            self._file.seek(self.offset)
            data = self._file.read(BYTES_AT_ONCE)
            if not data and self._was_moved():
                self.close()
                return None
        except FileNotFoundError:
            return b""
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({error.strerror or error})") from error
        self.offset += len(data)
        if self._known < KNOWN_BY and data:
            self._remember()
        return data

    def close(self) -> None:
        """Let go of the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def state(self) -> tuple[str, int]:
        """Return by what the file is known again."""
        return self.top, self._known

    def restore(self, offset: int, known: tuple[str, int]) -> None:
        """Go on at an offset of the file that is known by this."""
        self.offset, (self.top, self._known) = offset, known

    def _remember(self) -> None:
        assert self._file is not None
        self._known = min(self.offset, KNOWN_BY)
        self.top = self._digest()

    def _digest(self) -> str:
        assert self._file is not None
        self._file.seek(0)
        return hashlib.sha256(self._file.read(self._known)).hexdigest()

    def _is_the_same(self) -> bool:
        """Return whether the open file still has what was read of it."""
        assert self._file is not None
        if os.fstat(self._file.fileno()).st_size < self.offset:
            return False
        return not self.top or self._digest() == self.top

    def _was_moved(self) -> bool:
        """Return whether another file has its name, all of this one being read."""
        assert self._file is not None
        own, there = os.fstat(self._file.fileno()), os.stat(self.path)
        return (own.st_dev, own.st_ino) != (there.st_dev, there.st_ino)
