# SPDX-License-Identifier: Apache-2.0
"""Where a `source` in a configuration may point: inside the configuration's folder, or into an installed ROS package."""

from __future__ import annotations

from pathlib import Path

from ..base.ament import PackageNotFound, package_share

_MAX_PATH = 1000
_SHARE = "share files between machines through package://"


class SourcePathError(ValueError):
    """A source that may not be read; str() says why."""


def resolve_source(text: str, *, config: Path) -> Path:
    """The file that `text` names in the file `config`. Raises SourcePathError when it would leave that file's folder."""
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
    """Whether a path lies in the folder of `config` after symbolic links too; a config that is a link itself (as colcon
    installs them) has a second folder, that of the file it stands for."""
    try:
        target = path.resolve()
        return any(target.is_relative_to(folder) for folder in (config.parent.resolve(), config.resolve().parent))
    except (OSError, RuntimeError):  # links that go in a circle; reading it says so
        return True
