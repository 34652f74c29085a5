# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files, and digests of contents."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path


def digest(*parts: str | bytes) -> str:
    """SHA-256 (hex) of the parts. Each part is prefixed with its length, so that different lists give different
    digests."""
    total = hashlib.sha256()
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
