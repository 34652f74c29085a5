# SPDX-License-Identifier: Apache-2.0
"""Root: the folder that contains all files that requests may name."""

from __future__ import annotations

import stat
from pathlib import Path

from .http_error import HttpError, nearest
from .limits import PATH_BYTES


class Root:
    """Paths in requests are relative to it. Symbolic links are resolved first; their targets must lie below it, too."""

    def __init__(self, folder: Path):
        """Raises OSError if there is no such folder."""
        self.folder = folder.resolve(strict=True)
        if not self.folder.is_dir():
            raise NotADirectoryError(20, "not a folder", str(folder))

    def existing(self, what: str, text: object, *suffixes: str) -> Path:
        """A regular file with one of these suffixes. Raises HttpError; `what` describes the path in messages."""
        path = self._below(what, text)
        if not path.name.endswith(suffixes):
            raise HttpError(400, "bad_value", f"{what}: {text!r} is not a *{' or *'.join(suffixes)} file")
        try:
            kind = path.stat().st_mode
        except OSError:
            raise HttpError(404, "unknown_file", f"{what}: no file {text!r} in the root", self._meant(path)) from None
        if not stat.S_ISREG(kind):
            raise HttpError(400, "bad_value", f"{what}: {text!r} is not a regular file")
        return path

    def new(self, what: str, text: object) -> Path:
        """A path that does not exist yet, in an existing folder. Raises HttpError."""
        path = self._below(what, text)
        if path.exists():
            raise HttpError(409, "exists", f"{what}: {text!r} exists already", "name one that does not exist")
        if not path.parent.is_dir():
            raise HttpError(404, "unknown_file", f"{what}: no folder for {text!r} in the root")
        return path

    def relative(self, path: Path) -> str:
        return str(path.relative_to(self.folder))

    def _below(self, what: str, text: object) -> Path:
        if not isinstance(text, str) or not text or len(text.encode(errors="replace")) > PATH_BYTES:
            raise HttpError(400, "bad_value", f"{what}: expected a path of 1 to {PATH_BYTES} bytes")
        if not text.isprintable():
            raise HttpError(400, "bad_value", f"{what}: a path has printable characters only")
        try:
            path = (self.folder / text).resolve()
        except (OSError, RuntimeError):  # circular links, or a name that is too long
            raise HttpError(400, "bad_value", f"{what}: {text!r} cannot be resolved") from None
        if path == self.folder or not path.is_relative_to(self.folder):
            raise HttpError(
                403,
                "outside_root",
                f"{what}: {text!r} is outside the root",
                "name a file below the supervisor's --root",
            )
        return path

    def _meant(self, path: Path) -> str:
        try:
            names = [entry.name for entry in path.parent.iterdir()]
        except OSError:
            return ""
        name = nearest(path.name, names)
        return self.relative(path.parent / name) if name else ""
