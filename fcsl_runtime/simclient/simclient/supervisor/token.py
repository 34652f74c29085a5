# SPDX-License-Identifier: Apache-2.0
"""The token file: as the variable server's (docs/protocol.md)."""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from pathlib import Path

from ..errors import TwinError

_LEAST, _MOST, _RANDOM_BYTES = 16, 128, 24


def read_token(path: Path) -> str:
    """The token in a file that nobody else can read; one that does not exist is made. Raises TwinError."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        return _make(path)
    except OSError as error:
        raise TwinError(f"cannot read token file {path}: {error.strerror}") from None
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid() or stat.S_IMODE(found.st_mode) & 0o077:
            raise TwinError(f"token file {path} must be a file of yours that nobody else can read: chmod 600 it")
        token = file.read(_MOST + 2).rstrip(b" \r\n")
    if not _LEAST <= len(token) <= _MOST or not all(33 <= byte < 127 for byte in token):
        raise TwinError(f"token file {path} must hold {_LEAST} to {_MOST} printable characters")
    return token.decode()


def _make(path: Path) -> str:
    """The file gets its name when it is whole: one that was killed in between is in nobody's way."""
    token = secrets.token_hex(_RANDOM_BYTES)
    part = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        part.unlink(missing_ok=True)
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600), "w") as file:
            file.write(token + "\n")
        os.link(part, path)
    except OSError as error:
        raise TwinError(f"cannot make token file {path}: {error.strerror}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return token
