# SPDX-License-Identifier: Apache-2.0
"""Checkpoint files (docs/guide/recording.md). The runtime makes their bytes: Run.checkpoint and Run.restore_checkpoint."""

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

#: Largest size in bytes: the runtime's largest machine, 256 MiB, with all simulated hardware.
LONGEST = (256 << 20) + (1 << 17)


#: Magic, format, ABI, bytes, tick, tick_hz, bytes of the machine struct, hardware, byte order, bytes of the name.
_HEAD = struct.Struct("<8sIIQQQIIII")
_HEAD_BYTES = 248


def tick_of(checkpoint: bytes) -> int:
    """The tick at which a checkpoint was saved, from its header."""
    return int(_HEAD.unpack_from(checkpoint)[4])


def struct_of(checkpoint: bytes) -> bytes:
    """The machine struct in an intact checkpoint."""
    head = _HEAD.unpack_from(checkpoint)
    at = _HEAD_BYTES + head[9]
    return checkpoint[at : at + head[6]]


@functools.cache
def _runtime(path: Path) -> ctypes.CDLL:
    return bind_runtime(path, {"fcsl_replace_file": (c_int, [c_char_p, c_char_p, c_size_t, ctypes.POINTER(CError)])})


def _check_name(path: str | Path) -> None:
    if "\0" in str(path):
        raise TwinError(f"{str(path)!r} is not a valid file name: it contains a null character")


def write_checkpoint(path: str | Path, checkpoint: bytes) -> None:
    """Replaces the file `path` atomically: after a crash it holds the old or the new checkpoint. Raises TwinError."""
    _check_name(path)
    error = CError()
    if _runtime(runtime_library()).fcsl_replace_file(os.fsencode(path), checkpoint, len(checkpoint), byref(error)) < 0:
        raise TwinError(error.text.decode("utf-8", "replace"))


def read_checkpoint(path: str | Path) -> bytes:
    """The file's bytes, at most LONGEST. Raises TwinError if it cannot be read or is not a regular file.

    A FIFO could block its reader indefinitely.
    """
    _check_name(path)
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                return file.read(LONGEST + 1)
    except OSError as error:
        raise TwinError(f"cannot be read: {error.strerror}") from None
    raise TwinError("cannot be read: not a regular file")
