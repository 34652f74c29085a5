# SPDX-License-Identifier: Apache-2.0
"""Files of checkpoints (docs/checkpoints.md). Their bytes are the runtime's: Run.checkpoint and Run.restore_checkpoint."""

from __future__ import annotations

import ctypes
import functools
import os
import stat
import struct
from ctypes import byref, c_char_p, c_int, c_size_t
from pathlib import Path

from .c_run import CError
from .errors import TwinError
from .library import bind_runtime, runtime_library

#: Of the largest machine that the runtime hosts, 256 MiB, with all simulated hardware.
LONGEST = (256 << 20) + (1 << 17)


#: Magic, format, ABI, bytes, tick, tick_hz, bytes of the machine struct, hardware, byte order, bytes of the name.
_HEAD = struct.Struct("<8sIIQQQIIII")
_HEAD_BYTES = 248


def tick_of(checkpoint: bytes) -> int:
    """The tick that a checkpoint was saved at, as its head says."""
    return int(_HEAD.unpack_from(checkpoint)[4])


def struct_of(checkpoint: bytes) -> bytes:
    """The machine struct in a checkpoint that is whole."""
    head = _HEAD.unpack_from(checkpoint)
    at = _HEAD_BYTES + head[9]
    return checkpoint[at : at + head[6]]


@functools.cache
def _runtime(path: Path) -> ctypes.CDLL:
    return bind_runtime(path, {"fcsl_replace_file": (c_int, [c_char_p, c_char_p, c_size_t, ctypes.POINTER(CError)])})


def _check_name(path: str | Path) -> None:
    if "\0" in str(path):
        raise TwinError(f"{str(path)!r} is no name of a file: it holds a null character")


def write_checkpoint(path: str | Path, checkpoint: bytes) -> None:
    """Replaces the file `path`: whatever happens meanwhile, it is the old file or the new one, whole. Raises TwinError."""
    _check_name(path)
    error = CError()
    if _runtime(runtime_library()).fcsl_replace_file(os.fsencode(path), checkpoint, len(checkpoint), byref(error)) < 0:
        raise TwinError(error.text.decode("utf-8", "replace"))


def read_checkpoint(path: str | Path) -> bytes:
    """The file's bytes, of which the longest checkpoint has no more than LONGEST. Raises TwinError for what cannot be read, and
    for what is no regular file (a FIFO could keep its reader for ever)."""
    _check_name(path)
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                return file.read(LONGEST + 1)
    except OSError as error:
        raise TwinError(f"cannot be read: {error.strerror}") from None
    raise TwinError("cannot be read: not a regular file")
