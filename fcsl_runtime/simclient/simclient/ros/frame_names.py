# SPDX-License-Identifier: Apache-2.0
"""The frames that a message names, for texts about one that has others than its channels."""

from __future__ import annotations

import struct

#: Where a message has its frame: behind the encapsulation and the stamp; its length stands before it.
_FRAMES_AT, _LENGTH = 12, struct.Struct("<I")
#: Bytes of a frame that are shown.
_SHOWN = 80


def differing(data: bytes, frame: str, child_frame: str) -> tuple[str, str]:
    """The frames of a message, whose CDR may be cut, and those that its channels want: ("'map' -> 'body'", "'odom' -> 'body'").
    Empty ones are not wanted, and not shown."""
    wanted = [text for text in (frame, child_frame) if text]
    came = _frames(data, 2 if child_frame else 1)[-len(wanted) :]
    return " -> ".join(came), " -> ".join(map(repr, wanted))


def _frames(data: bytes, count: int) -> list[str]:
    """The first strings of a message behind its stamp: of the header, then of the child."""
    found, at = [], _FRAMES_AT
    for _ in range(count):
        at += -at % _LENGTH.size
        (size,) = _LENGTH.unpack_from(data, at) if at + _LENGTH.size <= len(data) else (0,)
        at += _LENGTH.size
        found.append(repr(data[at : at + size].rstrip(b"\0")[:_SHOWN].decode(errors="replace")))
        at += size
    return found
