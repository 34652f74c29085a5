# SPDX-License-Identifier: Apache-2.0
"""The folders of the cache. Only their owner may write in them, because what they hold is executed."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from .toolchain import ToolchainError, cache_dir


def entry_folder(kind: str, key: str) -> Path:
    """The folder of an entry, which need not exist. Raises ToolchainError if others could have written into it."""
    for folder in _chain(kind, key):
        try:
            _check(folder, os.stat(folder))
        except FileNotFoundError:
            break
    return cache_dir() / kind / key


def make_entry_folder(kind: str, key: str) -> Path:
    """Makes the folder of an entry, closed to others. Raises OSError and ToolchainError."""
    for folder in _chain(kind, key):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return entry_folder(kind, key)


def _chain(kind: str, key: str) -> tuple[Path, Path, Path]:
    root = cache_dir()
    return root, root / kind, root / kind / key


def _check(folder: Path, status: os.stat_result) -> None:
    mine = "set FCSL_CACHE_DIR to a folder of your own"
    if status.st_uid != os.geteuid():
        problem = f"it belongs to user {status.st_uid}, and you are user {os.geteuid()}"
        fix = mine
    elif status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        problem = f"others may write in it (mode {stat.S_IMODE(status.st_mode):04o})"
        fix = f"empty it and run `chmod 700 {folder}`, or {mine}"
    else:
        return
    raise ToolchainError(
        f"{folder}: not used as a cache of builds, because {problem}; libraries from it are executed: {fix}"
    )
