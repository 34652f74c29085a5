# SPDX-License-Identifier: Apache-2.0
"""Files that a `source` in a configuration may name: in the configuration's folder, or in an installed ROS package."""

from __future__ import annotations

import os
from pathlib import Path

from ..base.packages import PackageNotFound, package_share
from ..base.source import Span

_MAX_PATH = 1000
_SHARE = "share files between machines through package://"


class SourcePathError(ValueError):
    """A source path that is not allowed. str() gives the reason."""


def beside(folder: str, text: str) -> str:
    """What a text names that stands in a file of `folder`."""
    return f"{folder}/{text}" if folder and not text.startswith(("package://", "/")) else text


def missing_file_help(error: Exception, at: Span) -> str:
    """What a relative path at `at` is relative to, if the error is that there is no such file."""
    relative = str(error) == "no such file" and not at.text.startswith('"package://')
    return f"paths are relative to {Path(at.source.path).parent}" if relative else ""


def resolve_source(text: str, *, config: Path) -> Path:
    """The file that `text` names in the configuration file `config`. Raises SourcePathError if the path leaves the
    configuration's folder."""
    if text.startswith("package://"):
        package, _, inside = text.removeprefix("package://").partition("/")
        if not package or not inside:
            raise SourcePathError("write package://<ros package>/<path below its share folder>")
        try:
            root = package_share(package)
        except PackageNotFound as error:
            raise SourcePathError(str(error)) from None
    else:
        root, inside = config.parent, text
    if len(inside) > _MAX_PATH:
        raise SourcePathError(f"it is longer than {_MAX_PATH} characters")
    path = Path(inside)
    if path.is_absolute() or "\0" in inside or ".." in path.parts:
        raise SourcePathError(f"it would leave its folder; {_SHARE}")
    if root == config.parent and not _stays(root / path, config):
        raise SourcePathError(f"a symbolic link leads it out of its folder; {_SHARE}")
    return root / path


def _stays(path: Path, config: Path) -> bool:
    """Whether a path is in the folder of `config`, also after resolving symbolic links. If `config` is a link (colcon
    installs links), the folder of its target is allowed too."""
    # Of a cycle of links realpath resolves as much as it can; reading the file reports it.
    target = os.path.realpath(path)
    folders = os.path.realpath(config.parent), os.path.dirname(os.path.realpath(config))
    return any(target == folder or target.startswith(f"{folder.rstrip(os.sep)}{os.sep}") for folder in folders)
