# SPDX-License-Identifier: Apache-2.0
"""One builder at a time in a folder of the cache."""

from __future__ import annotations

import contextlib
import fcntl
import shutil
from collections.abc import Iterator
from pathlib import Path

_NAME = "lock"


@contextlib.contextmanager
def building(folder: Path) -> Iterator[None]:
    """Whoever comes second waits, and should look again for what the first has built. Raises OSError.

    The system takes the lock from a process that dies, also by SIGKILL; what such a builder left half-done is removed here.
    Readers take no lock: what is built appears whole, by a rename.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / _NAME, "w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        for left in folder.glob(".*-*"):
            shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(missing_ok=True)
        yield
