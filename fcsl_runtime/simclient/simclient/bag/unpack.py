# SPDX-License-Identifier: Apache-2.0
"""Decompression of what nobody vouches for: 64 KB can claim, and yield, gigabytes, so all of it has a limit."""

from __future__ import annotations

import bz2
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import zstandard

#: A chunk, or a message that is compressed by itself, unpacks to no more. Recorders make chunks of some MiB.
LIMIT_BYTES = 256 << 20
#: Of a file that are unpacked at once.
_STEP_BYTES = 1 << 20


class TooLarge(ValueError):
    """What is unpacked exceeds its limit."""

    def __init__(self, limit: int = LIMIT_BYTES):
        super().__init__(f"unpacks to more than {limit / (1 << 20):.0f} MiB, the limit")


def unzstd(packed: Any) -> bytes:
    """The first frame in a buffer. Raises TooLarge, or zstandard.ZstdError when it is damaged."""
    size = zstandard.frame_content_size(packed)
    if size > LIMIT_BYTES:
        raise TooLarge
    if size >= 0:
        return zstandard.ZstdDecompressor().decompress(packed)
    with zstandard.ZstdDecompressor().stream_reader(packed) as stream:
        return _gathered(lambda: stream.read(_STEP_BYTES))


def unlz4(packed: Any) -> bytes:
    """The first frame in a buffer. Raises TooLarge, or RuntimeError or EOFError when it is damaged."""
    return _stepwise(lz4.frame.LZ4FrameDecompressor(), packed)


def unbz2(packed: Any) -> bytes:
    """The first stream in a buffer. Raises TooLarge, or OSError or EOFError when it is damaged."""
    return _stepwise(bz2.BZ2Decompressor(), packed)


def _stepwise(stream: Any, packed: Any) -> bytes:
    """What a decompressor of the standard library's kind makes of a buffer."""
    inputs = iter((packed,))

    def step() -> bytes:
        if stream.eof:
            return b""
        found: bytes = stream.decompress(next(inputs, b""), max_length=_STEP_BYTES)
        if not found and not stream.eof:
            raise EOFError("cut off")
        return found

    return _gathered(step)


def _gathered(step: Callable[[], bytes]) -> bytes:
    """All that `step` gives until it gives nothing. Raises TooLarge."""
    whole = bytearray()
    while data := step():
        whole += data
        if len(whole) > LIMIT_BYTES:
            raise TooLarge
    return bytes(whole)


def unzstd_file(source: Path, target: Path) -> None:
    """Unpacks a file into half of the free space of the target's disk at most.

    Raises TooLarge, or zstandard.ZstdError when it is damaged.
    """
    left = limit = shutil.disk_usage(target.parent).free // 2
    with source.open("rb") as packed, target.open("wb") as unpacked:
        for data in zstandard.ZstdDecompressor().read_to_iter(packed):
            left -= len(data)
            if left < 0:
                raise TooLarge(limit)
            unpacked.write(data)
