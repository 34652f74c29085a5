# SPDX-License-Identifier: Apache-2.0
"""What a library was built from: a file beside it, by which whoever loads it sees that a source has changed since.

The library itself names no file of the computer that built it. Where its sources are not (a vehicle), nothing is compared.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.files import digest, write_whole
from ..base.source import SourceError, SourceFile
from .toolchain import ToolchainError, compiler, toolchain, toolchain_of

if TYPE_CHECKING:  # whoever loads a library does not need the compiler for it
    from .passes import Compilation

SUFFIX = ".sources.json"
_VERSION = 1


class StaleBuild(RuntimeError):
    """A library that is older than its sources; str() says what has changed, and what to run."""


def write_record(path: Path, compilations: Sequence[Compilation], command: str) -> None:
    """`command` builds the library again; empty where a build system does. Raises OSError."""
    machines = {c.checked.name: _machine(c) for c in compilations}
    head = {"version": _VERSION, "command": command, "compiler": compiler(), "toolchain": toolchain()}
    write_whole(path, json.dumps({**head, "machines": machines}, indent=1) + "\n")


def _machine(c: Compilation) -> dict[str, Any]:
    """Sources as they were compiled, whatever has become of the files meanwhile."""
    assert c.parsed is not None
    sources = [c.parsed.source, *(file.source for file in c.parsed.files)]
    files = {str(Path(s.path).resolve()): digest(s.text) for s in sources}
    externs = {str(path.resolve()): digest(path.read_bytes()) for path in c.target.files}
    return {"build_hash": c.build_hash, "config": str(c.path.resolve()), "files": files, "externs": externs}


def check_record(library: Path, machine: str, build_hash: str) -> None:
    """Raises StaleBuild when the library's record tells of other sources, C compiler or flags than there are now.

    A library without a record, or whose machine JSON is not on this computer, passes.
    """
    path = Path(f"{library}{SUFFIX}")
    if not path.is_file():
        return
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        found = record["machines"].get(machine)
        if record["version"] != _VERSION:
            raise ValueError
        if found is not None and not Path(found["config"]).is_file():
            return
        changes = _changes(record, found) if found is not None and found["build_hash"] == build_hash else None
        again = _again(record["command"], "" if found is None else found["config"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise StaleBuild(f"{path}: not a record of sources that this fcslc wrote; build the library again") from None
    if changes is None:
        raise StaleBuild(f"{library}: it is of another build than the record of its sources, {path.name}\n{again}")
    if changes:
        raise StaleBuild("\n".join([f"{library}: it is older than what it is built from", *changes, again]))


def _changes(record: dict[str, Any], found: dict[str, Any]) -> list[str]:
    """One line for each thing that is not as it was."""
    lines = [
        _change("machine" if p == found["config"] else "algorithm", p, h, _text) for p, h in found["files"].items()
    ]
    lines += [_change("extern", p, h, Path.read_bytes) for p, h in found["externs"].items()]
    try:
        now = toolchain_of(record["compiler"])
    except ToolchainError:
        now = record["toolchain"]  # whoever cannot compile has no other compiler
    if now != record["toolchain"]:
        lines.append(f"  C compiler or flags: built with `{record['toolchain']}`, now `{now}`")
    return [line for line in lines if line]


def _text(path: Path) -> str:
    return SourceFile.read(path, path.name).text


def _change(what: str, name: str, recorded: str, read: Callable[[Path], str | bytes]) -> str:
    try:
        return "" if digest(read(Path(name))) == recorded else f"  {what} {name} has changed"
    except (OSError, SourceError) as error:
        return f"  {what} {name}: {getattr(error, 'strerror', None) or error}"


def _again(command: str, config: str) -> str:
    how = f"run `{command}`" if command else "build and install its package (`colcon build`)"
    return f"{how}" + (f", or open {config} itself: it is compiled when it has changed" if config else "")
