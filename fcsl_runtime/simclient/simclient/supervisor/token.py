# SPDX-License-Identifier: Apache-2.0
"""The token file: the same format as the variable server's (docs/reference/variables.md)."""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from pathlib import Path

from ..errors import TwinError

_LEAST, _MOST, _RANDOM_BYTES = 16, 128, 24


def read_token(path: Path) -> str:
    """The token in a file that only its owner can read; a missing file is created. Raises TwinError."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        return _make(path)
    except OSError as error:
        raise TwinError(f"cannot read token file {path}: {error.strerror}") from None
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid() or stat.S_IMODE(found.st_mode) & 0o077:
            raise TwinError(f"token file {path} must belong to you and be readable by you alone: chmod 600")
        token = file.read(_MOST + 2).rstrip(b" \r\n")
    if not _LEAST <= len(token) <= _MOST or not all(33 <= byte < 127 for byte in token):
        raise TwinError(f"token file {path} must contain {_LEAST} to {_MOST} printable characters")
    return token.decode()


def _make(path: Path) -> str:
    """Renames the complete file into place, so that an interrupted process leaves no partial token file."""
    token = secrets.token_hex(_RANDOM_BYTES)
    part = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        part.unlink(missing_ok=True)
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600), "w") as file:
            file.write(token + "\n")
        os.link(part, path)
    except OSError as error:
        raise TwinError(f"cannot create token file {path}: {error.strerror}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return token
