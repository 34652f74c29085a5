# SPDX-License-Identifier: Apache-2.0
"""Record of the inputs of a library, in a file beside it. Loaders use it to detect that a source has changed since the
build.

The library itself contains no paths of the computer that built it. Without the sources (on a vehicle) nothing is
compared.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.files import SourceError, digest, write_whole
from ..base.json_file import read_json
from .toolchain import ToolchainError, compiler, toolchain, toolchain_of

if TYPE_CHECKING:  # a process that only loads a library does not import the compiler
    from .passes import Compilation

SUFFIX = ".sources.json"
_VERSION = 2


class StaleBuild(RuntimeError):
    """A library that is older than its sources. str() lists the changes and the command that rebuilds it."""


def write_record(path: Path, compilations: Sequence[Compilation], command: str) -> None:
    """Writes the record. `command` rebuilds the library; it is empty if a build system does. Raises OSError."""
    machines = {c.checked.name: _machine(c) for c in compilations}
    head = {"version": _VERSION, "command": command, "compiler": compiler(), "toolchain": toolchain()}
    record = {**head, "machines": machines}
    write_whole(path, json.dumps({"sha256": _sha256(record), **record}, indent=1) + "\n")


def _sha256(record: dict[str, Any]) -> str:
    return digest(json.dumps(record))


def _machine(c: Compilation) -> dict[str, Any]:
    """Digests of the sources as they were compiled, not of the current files."""
    from ..ros.channels import definitions_used
    from ..ros.interfaces import stored_path

    assert c.parsed is not None
    sources = [c.parsed.source, *(file.source for file in c.parsed.files), *(r.span.source for r in c.effects)]
    files = {str(Path(s.path).resolve()): digest(s.text) for s in sources}
    stored = stored_path(c.path)
    if definitions_used(c.checked.channels) and stored.is_file():
        files[str(stored.resolve())] = digest(_text(stored))
    linked = [(path, path.read_bytes()) for path in c.target.archives]
    linked += [(file.path, file.content) for file in c.c_inputs.files if file.content is not None]
    externs = {str(path.resolve()): digest(content) for path, content in linked}
    return {"build_hash": c.build_hash, "config": str(c.path.resolve()), "files": files, "externs": externs}


def check_record(library: Path, machine: str, build_hash: str) -> None:
    """Raises StaleBuild if sources, C compiler or flags differ from those in the library's record.

    A library without a record, or whose machine JSON is not on this computer, passes.
    """
    path = Path(f"{library}{SUFFIX}")
    if not path.is_file():
        return
    try:
        record = read_json(path)
        if record.pop("sha256", None) != _sha256(record) or record["version"] != _VERSION:
            raise ValueError
        found = record["machines"].get(machine)
        if found is not None and not Path(found["config"]).is_file():
            return
        changes = _changes(record, found) if found is not None and found["build_hash"] == build_hash else None
        again = _again(record["command"], "" if found is None else found["config"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise StaleBuild(
            f"{path}: damaged, or not a source record of this fcslc version; build the library again"
        ) from None
    if changes is None:
        raise StaleBuild(f"{library}: it belongs to a different build than its source record, {path.name}\n{again}")
    if changes:
        raise StaleBuild("\n".join([f"{library}: it is older than its sources", *changes, again]))


def _changes(record: dict[str, Any], found: dict[str, Any]) -> list[str]:
    """One line for each difference."""
    lines = [_change(_kind(p, found["config"]), p, h, _text) for p, h in found["files"].items()]
    lines += [_change("extern", p, h, Path.read_bytes) for p, h in found["externs"].items()]
    try:
        now = toolchain_of(record["compiler"])
    except ToolchainError:
        now = record["toolchain"]  # without a C compiler there is nothing to compare
    if now != record["toolchain"]:
        lines.append(f"  C compiler or flags: built with `{record['toolchain']}`, now `{now}`")
    return [line for line in lines if line]


def _kind(path: str, config: str) -> str:
    if path.endswith(".interfaces.json"):
        return "definitions"
    return "machine" if path == config else "algorithm" if path.endswith(".py") else "requirements"


def _text(path: Path) -> str:
    from ..base.source import SourceFile

    return SourceFile.read(path, path.name).text


def _change(what: str, name: str, recorded: str, read: Callable[[Path], str | bytes]) -> str:
    try:
        return "" if digest(read(Path(name))) == recorded else f"  {what} {name} has changed"
    except (OSError, SourceError) as error:
        return f"  {what} {name}: {getattr(error, 'strerror', None) or error}"


def _again(command: str, config: str) -> str:
    how = f"run `{command}`" if command else "build and install its package (`colcon build`)"
    return f"{how}" + (f", or open {config} itself: it is recompiled after a change" if config else "")
