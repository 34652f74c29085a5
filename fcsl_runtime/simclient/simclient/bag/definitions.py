# SPDX-License-Identifier: Apache-2.0
"""Definitions of messages for bags that have none: from folders that the user names, ROS 2 Jazzy, or the ament index."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fcsl_compiler.api.packages import PackageNotFound, package_share

from ..errors import BagError

#: The source of types that are not looked up in files.
JAZZY = "ROS 2 Jazzy"
_NAME = re.compile(r"[A-Za-z]\w*/msg/[A-Za-z]\w*", re.ASCII)
#: Most bytes of a .msg file that are read.
_MAX_BYTES = 1 << 20


def declarations(text: str) -> tuple[str, ...]:
    """The lines of a definition (of .msg files) that say what bytes a message has: without comments, and spaces that
    tell nothing apart."""
    lines = (" ".join(line.partition("#")[0].split()) for line in text.splitlines())
    return tuple(line for line in lines if line)


class Definitions:
    """Definitions by name. Those in `folders` come first, then Jazzy's, then those of installed packages."""

    def __init__(self, folders: Sequence[str | Path] = ()):
        self._folders = [Path(folder) for folder in folders]
        for folder in self._folders:
            if not folder.is_dir():
                raise BagError(f"{folder}: no such directory; --msg-path names folders of packages with a folder `msg`")
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._own: set[str] = set()

    def text(self, kind: str) -> tuple[str, str]:
        """(definition of a type with all that it uses, where it is from); empty if it is nowhere. Raises BagError."""
        source = self._add(kind)
        if not source:
            return "", ""
        try:
            return self._store.generate_msgdef(kind, ros_version=2)[0], source
        except RecursionError:
            raise BagError(f"{source}: {kind} contains itself") from None

    def _add(self, kind: str) -> str:
        """Makes sure that the store has a type and those that it uses; says where it is from, or "" if it cannot."""
        file = self._file(kind)
        if kind in self._store.fielddefs and (file is None or kind in self._own or not self._named(file)):
            return str(file) if kind in self._own else JAZZY
        if file is None:
            return ""
        try:
            with file.open("rb") as stream:
                types: dict[str, Any] = dict(get_types_from_msg(stream.read(_MAX_BYTES).decode(), kind))
        except Exception as error:  # noqa: BLE001  text that is no definition can make the parser raise anything
            raise BagError(f"{file}: not a valid definition of {kind}: {error}") from None
        self._own.add(kind)
        self._store.fielddefs[kind] = types[kind]
        missing = [used for used in _used(types[kind][1]) if not self._add(used)]
        if missing:
            raise BagError(f"{file}: {kind} uses {missing[0]}, whose definition is neither beside it nor installed")
        return str(file)

    def _named(self, file: Path) -> bool:
        return any(file.is_relative_to(folder) for folder in self._folders)

    def _file(self, kind: str) -> Path | None:
        if not _NAME.fullmatch(kind):
            return None
        package, _, name = kind.split("/")
        inner = f"msg/{name}.msg"
        for folder in self._folders:
            places = [folder / package / inner, folder / "share" / package / inner]
            places += [folder / inner] if folder.resolve().name == package else []
            found = next((place for place in places if place.is_file()), None)
            if found is not None:
                return found
        try:
            installed = package_share(package) / inner
        except PackageNotFound:
            return None
        return installed if installed.is_file() else None


def _used(fields: Any) -> Iterator[str]:
    """Names of the types that fields are of."""
    for _, (node, detail) in fields:
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            node, detail = detail[0]
        if node == Nodetype.NAME:
            yield detail
