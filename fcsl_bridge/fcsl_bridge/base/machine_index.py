# SPDX-License-Identifier: Apache-2.0
"""Finds compiled machines by the names users give: `lander/lander_control`, or the path of a library."""

from __future__ import annotations

import difflib
import os
from pathlib import Path

from ..errors import BridgeError

#: Index folder of fcsl_add_machine(): one file `<package>__<machine>` with the library's path below the prefix.
_INDEX = Path("share/ament_index/resource_index/fcsl_machines")
_SEPARATOR = "__"


def find_machine(text: str) -> tuple[Path, str | None]:
    """Library and name of the machine (None: the library's only one). Raises BridgeError.

    text: `package/machine`, or `path/to/library.so`, or `path/to/library.so:machine`.
    """
    path, colon, name = text.rpartition(":")
    library = Path(path if colon else text)
    if library.suffix == ".so":
        if not library.is_file():
            raise BridgeError(f"machine `{text}`: no such library: {library}")
        return library, name if colon else None
    if text.count("/") != 1 or not all(text.split("/")):
        raise BridgeError(
            f"machine `{text}`: write package/machine as in lander/lander_control, or the path of a library"
        )
    package, name = text.split("/")
    for prefix in _prefixes():
        entry = prefix / _INDEX / f"{package}{_SEPARATOR}{name}"
        if entry.is_file():
            library = prefix / entry.read_text(encoding="utf-8").strip()
            if not library.is_file():
                raise BridgeError(f"machine `{text}`: {library} is missing; build package `{package}` again")
            return library, name
    raise BridgeError(f"machine `{text}` is not installed in this environment{_hint(text)}")


def _prefixes() -> list[Path]:
    return [Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]


def _hint(text: str) -> str:
    entries = [entry.name for prefix in _prefixes() for entry in (prefix / _INDEX).glob(f"*{_SEPARATOR}*")]
    known = sorted(name.replace(_SEPARATOR, "/", 1) for name in entries)
    if not known:
        return "; there are none: source install/setup.bash of a workspace that builds one with fcsl_add_machine()"
    close = difflib.get_close_matches(text, known, n=1, cutoff=0.5)
    return f"; did you mean `{close[0]}`?" if close else f"; there are: {', '.join(known)}"
