# SPDX-License-Identifier: Apache-2.0
"""A folder for sockets that are needed for a while: what a killed process leaves of it, the next one takes away."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from pathlib import Path
from typing import Self


class PrivateFolder:
    """A new folder below the one for temporary files, which only this user may enter, until `close` or the end of a block.

    Its lock is held meanwhile, and the system lets go of it when this process dies, however that comes about: so folders
    that nobody holds are left over. Those for the same purpose are taken away when a new one is made.
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
        """A new folder in it, for one socket: whoever listens there locks the folder of its socket."""
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
    """A descriptor that holds the folder; None where another process does, or has just taken it away. Raises OSError where
    no folder could be held: whoever then tried again would make one after the other.
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
