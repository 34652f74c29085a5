# SPDX-License-Identifier: Apache-2.0
"""The private folder in which runs have their sockets; what killed supervisors left is removed."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path


class PrivateFolder:
    """`<XDG_RUNTIME_DIR, else the folder for temporary files>/fcsl-supervisor-<uid>/<one for this process>`, mode 0700.

    A supervisor holds a lock on its folder, which the kernel lets go when it dies: one that nobody holds is left over.
    """

    def __init__(self) -> None:
        """Raises OSError, also where the folder's name is taken by somebody else."""
        base = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / f"fcsl-supervisor-{os.getuid()}"
        base.mkdir(mode=0o700, exist_ok=True)
        found = base.lstat()
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) & 0o077:
            raise PermissionError(1, "not a folder of yours that nobody else can enter; remove it", str(base))
        with _locked(base):
            for other in base.iterdir():
                with contextlib.suppress(OSError), _locked(other, fcntl.LOCK_EX | fcntl.LOCK_NB):
                    shutil.rmtree(other, ignore_errors=True)
            self.path = Path(tempfile.mkdtemp(dir=base))
            self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(self._lock, fcntl.LOCK_EX)

    def of_run(self, name: str) -> Path:
        """A new folder in it."""
        folder = self.path / name
        folder.mkdir(mode=0o700)
        return folder

    def close(self) -> None:
        """Idempotent."""
        if self._lock >= 0:
            shutil.rmtree(self.path, ignore_errors=True)
            os.close(self._lock)
            self._lock = -1


@contextlib.contextmanager
def _locked(folder: Path, how: int = fcntl.LOCK_EX) -> Iterator[None]:
    lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, how)
        yield
    finally:
        os.close(lock)
