# SPDX-License-Identifier: Apache-2.0
"""A folder for a socket that is needed for a moment: what a killed process leaves of it, the next one takes away."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

_PREFIX = "fcsl-twin-"


@contextlib.contextmanager
def socket_folder() -> Iterator[Path]:
    """A new folder, which only this user may enter, until the end of the block.

    Its lock is held meanwhile, and the system lets go of it when this process dies, however that comes about: so folders
    that nobody holds are left over.
    """
    _take_away_what_is_left()
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        held = _lock(folder)
        if held is not None:
            break
    try:
        place = folder / "s"  # whoever listens there locks the folder of its socket
        place.mkdir(0o700)
        yield place
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(held)


def _lock(folder: Path) -> int | None:
    """A descriptor that holds the folder; None where another process does, or has just taken it away."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(descriptor), os.stat(folder)):
            return descriptor
    except OSError:
        pass
    os.close(descriptor)
    return None


def _take_away_what_is_left() -> None:
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            if folder.stat().st_uid != os.getuid():
                continue
            held = _lock(folder)
            if held is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(held)
