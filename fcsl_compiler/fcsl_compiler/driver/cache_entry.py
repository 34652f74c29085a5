# SPDX-License-Identifier: Apache-2.0
"""One entry of the cache: a library in a folder of its own, and facts about it with its SHA-256.

An entry is published by the rename of its facts, when all its files are on the disk. Every load checks the hash of
library and facts, so that a damaged entry is built again and never executed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ..base.files import SourceError, digest, read_regular
from ..base.json_file import read_json
from .cache_folder import entry_folder, make_entry_folder
from .cache_lock import building
from .toolchain import ToolchainError

_FACTS = "built.json"
#: Maximum size of a library.
_LIBRARY_BYTES = 1 << 30
#: Builds in a row whose inputs changed meanwhile, until the change counts as an error.
_ATTEMPTS = 3


class Built(NamedTuple):
    """A library of the cache, and what its builder noted about it."""

    library: Path
    facts: dict[str, str]


def cached(
    kind: str, key: Callable[[], str], library: str, build: Callable[[Path], dict[str, str]], what: object
) -> Built:
    """The library with this file name from the entry with this key, built if needed.

    `key` is called again after a build: if the inputs have changed meanwhile, the library may be a mixture of old and
    new, and is built again. `build` makes the library at the path and returns facts about it. `what`: the name for
    messages. Raises OSError, ToolchainError and the exceptions of `key` and `build`.
    """
    now = key()
    for _ in range(_ATTEMPTS):
        found = _load(entry_folder(kind, now), library)
        if found is not None:
            return found
        folder = make_entry_folder(kind, now)
        with building(folder):
            found = _load(folder, library)
            if found is not None:
                return found
            (folder / library).unlink(missing_ok=True)  # whatever stands there: a compiler would write into a pipe
            facts = build(folder / library)
            built_from, now = now, key()
            if now == built_from:
                _publish(folder, library, facts)
                return Built(folder / library, facts)
    raise ToolchainError(f"{what}: its sources change while it is built; build it again when they are saved")


def _load(folder: Path, library: str) -> Built | None:
    """The entry in a folder. None if there is none, or if a file is damaged, for example by a system crash."""
    try:
        read = read_json(folder / _FACTS)
        if read["sha256"] == _sha256(folder / library, read["facts"]):
            return Built(folder / library, read["facts"])
    except (OSError, SourceError, ValueError, KeyError, TypeError):
        pass
    return None


def _sha256(library: Path, facts: dict[str, str]) -> str:
    return digest(read_regular(library, _LIBRARY_BYTES), json.dumps(facts))


def _publish(folder: Path, library: str, facts: dict[str, str]) -> None:
    for file in folder.iterdir():
        if file.is_file() or file.is_dir():
            _sync(file)
    _sync(folder)
    unfinished = folder / f".{_FACTS}-"
    unfinished.write_text(json.dumps({"sha256": _sha256(folder / library, facts), "facts": facts}))
    _sync(unfinished)
    unfinished.replace(folder / _FACTS)
    _sync(folder)


def _sync(path: Path) -> None:
    """Waits until a file or a folder is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
