# SPDX-License-Identifier: Apache-2.0
"""Where a `source` in a configuration may point: inside the configuration's folder, or into an installed ROS package."""

from __future__ import annotations

from pathlib import Path

from .ament import PackageNotFound, package_share


class SourcePathError(ValueError):
    """A source that may not be read; str() says why."""


def resolve_source(text: str, folder: Path) -> Path:
    """The file that `text` names. Raises SourcePathError when it would leave its folder."""
    if text.startswith("package://"):
        package, _, inside = text.removeprefix("package://").partition("/")
        if not package or not inside:
            raise SourcePathError("write package://<ros package>/<path below its share folder>")
        try:
            root = package_share(package)
        except PackageNotFound as error:
            raise SourcePathError(str(error)) from None
    else:
        root, inside = folder, text
    path = Path(inside)
    if path.is_absolute() or "\0" in inside or ".." in path.parts:
        raise SourcePathError("it would leave its folder; share files between machines through package://")
    return root / path
