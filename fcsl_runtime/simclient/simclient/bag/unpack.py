# SPDX-License-Identifier: Apache-2.0
"""Decompression of untrusted data: 64 KB can unpack to gigabytes, so every function has a size limit."""

from __future__ import annotations

import bz2
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import zstandard

#: Most bytes of an unpacked chunk or message. Recorders make chunks of some MiB.
LIMIT_BYTES = 256 << 20
#: Bytes of a file that are unpacked in one call.
_STEP_BYTES = 1 << 20


class TooLarge(ValueError):
    """The unpacked data exceed the limit."""

    def __init__(self, limit: int = LIMIT_BYTES, text: str = ""):
        super().__init__(text or f"unpacks to more than {limit / (1 << 20):.0f} MiB, the limit")


def unzstd(packed: Any, limit: int | None = None) -> bytes:
    """Unpacks the first frame in a buffer. Raises TooLarge, or zstandard.ZstdError if it is damaged.

    `limit` (here and below) is the most bytes that it may unpack to; None: LIMIT_BYTES.
    """
    size = zstandard.frame_content_size(packed)
    if size > (LIMIT_BYTES if limit is None else limit):
        raise TooLarge
    if size >= 0:
        return zstandard.ZstdDecompressor().decompress(packed)
    with zstandard.ZstdDecompressor().stream_reader(packed) as stream:
        return _gathered(lambda: stream.read(_STEP_BYTES), limit)


def unlz4(packed: Any, limit: int | None = None, part: bool = False) -> bytes:
    """Unpacks the first frame in a buffer, or what there is of it. Raises TooLarge, or RuntimeError or EOFError if it is
    damaged.
    """
    return _stepwise(lz4.frame.LZ4FrameDecompressor(), packed, limit, part)


def unbz2(packed: Any, limit: int | None = None, part: bool = False) -> bytes:
    """Unpacks the first stream in a buffer, or what there is of it. Raises TooLarge, or OSError or EOFError if it is
    damaged.
    """
    return _stepwise(bz2.BZ2Decompressor(), packed, limit, part)


def _stepwise(stream: Any, packed: Any, limit: int | None, part: bool) -> bytes:
    """Unpacks a buffer with a decompressor that has the standard library's interface."""
    inputs = iter((packed,))

    def step() -> bytes:
        if stream.eof:
            return b""
        found: bytes = stream.decompress(next(inputs, b""), max_length=_STEP_BYTES)
        if not found and not stream.eof and not part:
            raise EOFError("cut off")
        return found

    return _gathered(step, limit)


def _gathered(step: Callable[[], bytes], limit: int | None = None) -> bytes:
    """Concatenates the results of `step` up to the first empty one. Raises TooLarge."""
    whole = bytearray()
    while data := step():
        whole += data
        if len(whole) > (LIMIT_BYTES if limit is None else limit):
            raise TooLarge
    return bytes(whole)


def unzstd_file(source: Path, target: Path) -> None:
    """Unpacks a file into at most half of the free space of the target's disk.

    Raises TooLarge, or zstandard.ZstdError when it is damaged.
    """
    left = limit = shutil.disk_usage(target.parent).free // 2
    with source.open("rb") as packed, target.open("wb") as unpacked:
        for data in zstandard.ZstdDecompressor().read_to_iter(packed):
            left -= len(data)
            if left < 0:
                raise TooLarge(limit)
            unpacked.write(data)
