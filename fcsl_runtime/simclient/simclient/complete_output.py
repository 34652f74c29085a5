# SPDX-License-Identifier: Apache-2.0
"""Output that is complete or absent."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import BagError, TwinError

#: Errors that only writing raises; they name no file.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def check_target(target: str | Path, is_new: bool = False) -> None:
    """Raises BagError if nothing can be written there; `is_new`: nor if something is there. For tools to call before
    they work.
    """
    wanted = Path(target).absolute()
    if is_new and (wanted.exists() or wanted.is_symlink()):
        raise BagError(f"{target}: exists already; name a new one")
    if not wanted.parent.is_dir():
        raise BagError(f"{wanted.parent}: no such directory")
    if wanted.is_dir():
        raise BagError(f"{target}: a directory; name the file to write")


@contextmanager
def complete_or_absent(target: str | Path) -> Iterator[Path]:
    """A temporary path for a file or directory: renamed to `target` if the block succeeds, deleted if it fails.

    The last component of the path is that of `target`, because bags name their files after their directory. Errors of
    the operating system name `target`, because the temporary path means nothing to a user.
    """
    check_target(target)
    wanted = Path(target).absolute()
    try:
        scratch = Path(tempfile.mkdtemp(prefix=f".{wanted.name}.", dir=wanted.parent))
    except OSError as error:
        raise BagError(f"{target}: cannot be written: {error.strerror}") from None
    try:
        partial = scratch / wanted.name
        yield partial
        partial.replace(wanted)
    except OSError as error:
        if error.errno not in _NO_ROOM and str(scratch) not in str(error.filename):
            raise
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise BagError(f"{target}: cannot be written: {reason}") from None
    except (BagError, TwinError) as error:
        if str(scratch) not in str(error):
            raise
        raise type(error)(str(error).replace(str(scratch), str(wanted.parent))) from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
