# SPDX-License-Identifier: Apache-2.0
"""Bounded reading and atomic writing of files, and digests of contents."""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

try:  # As random.py does: hashlib would load OpenSSL, a quarter of the time in which an unchanged machine loads.
    from _sha2 import sha256  # type: ignore[import-not-found]  # CPython 3.12
except ImportError:
    try:
        from _sha256 import sha256  # type: ignore[import-not-found]  # CPython 3.11
    except ImportError:
        from hashlib import sha256

if TYPE_CHECKING:
    from .source import Span

#: Maximum size of an input file. Larger files are rejected before parsing.
MAX_SOURCE_BYTES = 1 << 20


class SourceError(Exception):
    """A source file that cannot be read as text. str() gives the reason, `span` the place in the file if there is
    one."""

    def __init__(self, message: str, span: Span | None = None):
        super().__init__(message)
        self.span = span


def open_regular(name: str, flags: int) -> int:
    """Opener of `open` for regular files alone: pipes and devices neither block nor are read. Raises SourceError and
    OSError."""
    handle = os.open(name, flags | os.O_NONBLOCK | os.O_NOCTTY, 0o666)
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):  # `open` itself refuses a folder
        return handle
    os.close(handle)
    raise SourceError("it is not a regular file")


def read_regular(path: Path, limit: int) -> bytes:
    """Reads a regular file. Does not block on pipes or devices. Raises SourceError if it is not a regular file or too
    large, and OSError."""
    with open(path, "rb", opener=open_regular) as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        raise SourceError(f"it is larger than {limit} bytes")
    return data


def digest(*parts: str | bytes) -> str:
    """SHA-256 (hex) of the parts. Each part is prefixed with its length, so that different lists give different
    digests."""
    total = sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(len(data).to_bytes(8, "little") + data)
    return total.hexdigest()


def write_whole(path: Path, text: str) -> None:
    """Writes a file atomically. A file with equal content is not touched. The OSError raised on failure names
    `path`."""
    if path.is_file() and path.read_text(encoding="utf-8", errors="replace") == text:
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            os.chmod(name, 0o644)
            os.replace(name, path)
        except OSError:
            os.unlink(name)
            raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
