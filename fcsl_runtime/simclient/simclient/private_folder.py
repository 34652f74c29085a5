# SPDX-License-Identifier: Apache-2.0
"""A temporary folder for sockets. The next process removes what a killed one left."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from pathlib import Path
from typing import Self


class PrivateFolder:
    """A new folder below the one for temporary files, accessible to this user only, until `close` or the end of a
    block.

    The process holds a lock on it. The kernel releases the lock when the process ends for any reason, so an unlocked
    folder is a leftover. A new folder's constructor removes leftovers of the same purpose.
    """

    def __init__(self, purpose: str) -> None:
        """Raises OSError."""
        prefix = f"fcsl-{purpose}-"
        _take_away_what_is_left(prefix)
        while True:
            self.path = Path(tempfile.mkdtemp(prefix=prefix))
            held = _lock(self.path)
            if held is not None:
                break
        self._held: int | None = held

    def inside(self, name: str) -> Path:
        """A new folder in it for one socket: the process that listens there locks that folder."""
        folder = self.path / name
        folder.mkdir(mode=0o700)
        return folder

    def close(self) -> None:
        """Idempotent."""
        if self._held is not None:
            shutil.rmtree(self.path, ignore_errors=True)
            os.close(self._held)
            self._held = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _lock(folder: Path) -> int | None:
    """A descriptor that holds the folder; None if another process holds it or has just removed it.

    Raises OSError if no folder can be locked, because a caller that retries would then create folders without end.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return None
    held = False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        held = os.path.samestat(os.fstat(descriptor), os.stat(folder))
    except (BlockingIOError, FileNotFoundError):
        pass
    finally:
        if not held:
            os.close(descriptor)
    return descriptor if held else None


def _take_away_what_is_left(prefix: str) -> None:
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        with contextlib.suppress(OSError):
            if folder.stat().st_uid != os.getuid():
                continue
            held = _lock(folder)
            if held is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(held)
