# SPDX-License-Identifier: Apache-2.0
"""Lock for a folder of the cache: one builder at a time."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import shutil
from collections.abc import Iterator
from pathlib import Path

from ..base.files import SourceError, open_regular

_NAME = "lock"


@contextlib.contextmanager
def building(folder: Path) -> Iterator[None]:
    """Holds the lock of a folder, waiting for it if necessary. After waiting, the caller must check whether another
    process has built the result. Raises OSError.

    The system releases the lock of a process that dies, also after SIGKILL. Incomplete files of such a builder are
    removed here. Readers need no lock, because results appear atomically by a rename.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / _NAME
    try:
        file = open(path, "w", encoding="utf-8", opener=open_regular)
    except SourceError as error:
        raise OSError(errno.EINVAL, str(error), str(path)) from None
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        for left in folder.glob(".*-*"):
            shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(missing_ok=True)
        yield
