# SPDX-License-Identifier: Apache-2.0
"""What reproduces a machine's run, as it comes over the bus (docs/reference/transports.md): host writes, how many there are, a checkpoint."""

from __future__ import annotations

import struct
from dataclasses import dataclass

WRITES, WRITTEN, CHECKPOINT = "@writes", "@written", "@checkpoint"
#: HostWrite.kind
_RESTORE = 2
_NUMBER = struct.Struct("<Q")
_WRITTEN = struct.Struct("<QQ")
#: How messages of fcsl_msgs begin: stamp, length and zero of an empty frame, tick.
_HEAD = struct.Struct("<4xiIIB3xQ")


@dataclass(frozen=True)
class Write:
    """A host write: its number, and fcsl_msgs/HostWrite as CDR."""

    number: int
    message: bytes

    @property
    def is_restore(self) -> bool:
        return self.message[_HEAD.size : _HEAD.size + 1] == bytes((_RESTORE,))


@dataclass(frozen=True)
class Written:
    """After `ticks` ticks the next write has the number `next_write`."""

    ticks: int
    next_write: int


@dataclass(frozen=True)
class Checkpoint:
    """The machine after `tick` ticks, as CDR of fcsl_msgs/Checkpoint; the writes from `next_write` on follow."""

    tick: int
    next_write: int
    message: bytes


def read_writes(name: str, data: bytes) -> Write | Written | None:
    """The message under the key `name` of a machine; None if it is none."""
    if name == WRITTEN and len(data) == _WRITTEN.size:
        return Written(*_WRITTEN.unpack(data))
    if name == WRITES and len(data) >= _NUMBER.size + _HEAD.size:
        return Write(_NUMBER.unpack_from(data)[0], data[_NUMBER.size :])
    return None


def read_checkpoint(data: bytes) -> Checkpoint | None:
    """The answer to a query; None if it is none."""
    if len(data) < _NUMBER.size + _HEAD.size:
        return None
    (next_write,), message = _NUMBER.unpack_from(data), data[_NUMBER.size :]
    return Checkpoint(tick_of(message), next_write, message)


def tick_of(message: bytes) -> int:
    """Of a message of fcsl_msgs that has at least the head."""
    return int(_HEAD.unpack_from(message)[-1])
