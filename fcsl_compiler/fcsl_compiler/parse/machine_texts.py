# SPDX-License-Identifier: Apache-2.0
"""The files that a machine is built from, found without checking them: what the cache of builds hashes.

A build reads no other file of the machine, apart from those of externs. A machine of which this finds nothing does not
compile, so that the cache has no entry of it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..base.files import MAX_SOURCE_BYTES, SourceError, read_regular
from ..base.json_file import json_value
from .source_path import SourcePathError, beside, resolve_source

#: Matches an import anywhere in the text, also across lines. A false match is harmless.
_IMPORT = re.compile(r"\bfrom[\s\\]+([A-Za-z_]\w*(?:[\s\\]*\.[\s\\]*[A-Za-z_]\w*)*)[\s\\]*\bimport\b")
_NAME = re.compile(r"<name>\s*([a-z][a-z0-9_]*)\s*</name>")


class MachineTexts:
    """A machine JSON, `keys` of it, and its algorithm files with all that they import, by name."""

    def __init__(self, text: str, keys: dict[str, Any], files: dict[str, str]):
        self.text, self.keys, self.files = text, keys, files

    @property
    def has_mesh(self) -> bool:
        """Whether `views` name the file of a mesh."""
        views = self.keys.get("views")
        body = views.get("body") if isinstance(views, dict) else None
        return isinstance(body, dict) and "mesh" in body


def message_types(keys: dict[str, Any]) -> list[str]:
    """The messages that the channels of a machine JSON name; services have none."""
    channels = keys.get("channels")
    mappings = [c.get("ros") for c in (channels if isinstance(channels, list) else ()) if isinstance(c, dict)]
    types = [ros.get("type") for ros in mappings if isinstance(ros, dict) and "service" not in ros]
    return list(dict.fromkeys(type_ for type_ in types if isinstance(type_, str)))


def read_texts(config: Path) -> MachineTexts | None:
    """None where the machine JSON or a file that it names cannot be read."""
    try:
        text = _read(config)
        keys = json_value(text)
        parts: dict[str, str] = {}
        sources = _named(config, "", text, keys, parts)
    except (OSError, SourceError, SourcePathError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    files = _files(config, sources) if all(isinstance(source, str) for source in sources) else {}
    return MachineTexts(text, keys, parts | files) if files.keys() >= set(sources) else None


def _named(config: Path, folder: str, text: str, keys: dict[str, Any], parts: dict[str, str]) -> list[str]:
    """The files that a machine JSON of a folder names, and its parts, whose texts are added to `parts`."""
    sources = [beside(folder, algorithm["source"]) for algorithm in keys["algorithms"].values()]
    sources += [beside(folder, keys[key]) for key in ("constants", "requirements") if isinstance(keys.get(key), str)]
    if '"csv"' in text:
        sources += [beside(folder, name) for name in _columns(keys["instances"])]
    for instance in keys["instances"].values() if '"machine"' in text else ():
        if "machine" in instance and (name := beside(folder, instance["machine"])) not in parts:
            parts[name] = _read(resolve_source(name, config=config))
            own = json_value(parts[name])
            sources += _named(config, name.rpartition("/")[0], parts[name], own, parts)
    return sources


def _columns(node: Any) -> list[str]:
    """The CSV files that values name."""
    if isinstance(node, dict):
        own = [node["csv"]] if isinstance(node.get("csv"), str) else []
        return own + [name for value in node.values() for name in _columns(value)]
    return [name for value in node for name in _columns(value)] if isinstance(node, list) else []


def package_of(path: Path, name: str) -> str:
    """The ROS package that contains the machine (from the nearest package.xml above it). The machine's name if there is
    none."""
    folder = os.path.dirname(os.path.realpath(path))
    while True:
        manifest = os.path.join(folder, "package.xml")
        if os.path.isfile(manifest):
            with open(manifest, encoding="utf-8", errors="replace") as file:
                match = _NAME.search(file.read())
            if match:
                return match.group(1)
        if folder == os.path.dirname(folder):
            return name
        folder = os.path.dirname(folder)


def _files(config: Path, sources: Iterable[str]) -> dict[str, str]:
    """The contents of these files and of all that they import, without those that cannot be read."""
    found: dict[str, str] = {}
    names = list(dict.fromkeys(sources))
    for name in names:  # grows by what they import
        try:
            path = resolve_source(name, config=config)
            found[name] = _read(path)
        except (OSError, SourceError, SourcePathError, ValueError):
            continue
        for module in _IMPORT.findall(found[name]):
            beside = "".join(module.replace("\\", " ").split()).replace(".", "/") + ".py"
            imported = f"{name.rpartition('/')[0]}/{beside}" if "/" in name else beside
            if imported not in names and os.path.isfile(os.path.join(path.parent, beside)):
                names.append(imported)
    return found


def _read(path: Path) -> str:
    return read_regular(path, MAX_SOURCE_BYTES).decode().removeprefix("\ufeff")
