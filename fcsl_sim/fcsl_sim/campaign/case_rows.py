# SPDX-License-Identifier: Apache-2.0
"""cases.bin: a row for each case, in their order.

Each row ends with a checksum of itself, of its case and of the campaign, so that a damaged row, one in another's place and one
of another campaign are found. A row of zeros is a case that is not flown. The file is read and written by calls, never through
a memory map: a full or broken disk gives an error and no signal.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.api.files import SourceError, open_regular

from ..errors import SimError

#: Of an error, or of what a case missed.
TEXT_BYTES = 240
_CHECK_BYTES = 8
#: That are read at a time, which bounds the memory.
GROUP_ROWS = 1 << 12

Rows = np.ndarray[Any, Any]


def not_written(path: Path, error: OSError) -> SimError:
    return SimError(f"{path}: {error.strerror or error}; cases that are flown are kept, and the same command goes on")


def temporary_of(path: Path) -> Path:
    return path.with_suffix(".new")


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A path to write to. The file takes the place of `path` when all went well. Raises SimError if it cannot be written."""
    temporary = temporary_of(path)
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise not_written(path, error) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


class CaseRows:
    """The file, open. `size` is what it has, in bytes, and `bytes` what it should have: what is missing reads as zeros. Raises
    SimError wherever it cannot be read or written."""

    def __init__(self, path: Path, cases: int, metrics: int, campaign: str):
        """Makes an empty file if there is none. campaign: its fingerprint, as hexadecimal digits."""
        self.path, self.cases = path, cases
        kind = [("verdict", "u1"), ("end", "u1"), ("ticks", "<u8"), ("hash", "S16"), ("text", f"S{TEXT_BYTES}")]
        self.dtype = np.dtype([*kind, ("metrics", "<f8", (metrics,)), ("check", f"V{_CHECK_BYTES}")])
        self.bytes = cases * self.dtype.itemsize
        self._campaign = bytes.fromhex(campaign)
        try:
            self._file = open_regular(str(path), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
        except SourceError as error:
            raise SimError(f"{path}: {error}") from None
        self.size = os.fstat(self._file).st_size

    def reserve(self) -> None:
        """All of the file's room on the disk, before anything is flown."""
        try:
            os.posix_fallocate(self._file, 0, self.bytes)
            os.ftruncate(self._file, self.bytes)
        except OSError as error:
            raise SimError(f"{self.path}: no room for {self.bytes} bytes: {error.strerror}") from None
        self.size = self.bytes

    def close(self) -> None:
        os.close(self._file)

    def read(self, first: int, end: int) -> Rows:
        """The rows of these cases."""
        place, size = first * self.dtype.itemsize, (end - first) * self.dtype.itemsize
        try:
            data = os.pread(self._file, size, place)
        except OSError as error:
            raise SimError(f"{self.path}: {error.strerror}") from None
        if len(data) < min(size, self.size - place):
            raise SimError(f"{self.path}: another program has shortened it")
        return np.frombuffer(data.ljust(size, b"\0"), self.dtype)

    def groups(self) -> Iterator[tuple[int, Rows]]:
        """All rows, some at a time, each with the number of its first case."""
        for first in range(0, self.cases, GROUP_ROWS):
            yield first, self.read(first, min(first + GROUP_ROWS, self.cases))

    def write(self, case: int, **values: Any) -> None:
        """values: of all but the last member of a row."""
        row = np.zeros((), self.dtype)
        for name, value in values.items():
            row[name] = value
        data = row.tobytes()[:-_CHECK_BYTES]
        data += self._check(case, data)
        try:
            if os.pwrite(self._file, data, case * len(data)) != len(data):
                raise OSError(0, "the disk has taken a part of a row")
        except OSError as error:
            raise not_written(self.path, error) from None

    def is_right(self, case: int, row: Any) -> bool:
        """Whether a row is one that `write` has made for this case, or that of a case that is not flown."""
        data = row.tobytes()
        return data[-_CHECK_BYTES:] == self._check(case, data[:-_CHECK_BYTES]) or not any(data)

    def _check(self, case: int, data: bytes) -> bytes:
        salt = case.to_bytes(blake2b.SALT_SIZE, "little")
        return blake2b(data, digest_size=_CHECK_BYTES, key=self._campaign, salt=salt).digest()
