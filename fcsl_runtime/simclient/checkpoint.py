# SPDX-License-Identifier: Apache-2.0
"""A checkpoint as bytes for a file or another process: which layout it is of, then the machine struct."""

from __future__ import annotations

from .descriptor import Machine
from .errors import TwinError

_MAGIC = b"FCSC"


def _head(machine: Machine) -> bytes:
    return _MAGIC + machine.layout_hash.encode() + b"\n"


def pack_checkpoint(machine: Machine, data: bytes) -> bytes:
    """`data` is the machine struct, as Run.save gives it."""
    return _head(machine) + data


def unpack_checkpoint(machine: Machine, checkpoint: bytes) -> bytes:
    """The machine struct. Raises TwinError for what is no checkpoint, and for one of another layout."""
    if not isinstance(checkpoint, (bytes, bytearray)) or not checkpoint.startswith(_MAGIC):
        raise TwinError("restore: not a checkpoint made by save()")
    head = _head(machine)
    if not checkpoint.startswith(head):
        raise TwinError(f"restore: the checkpoint is of a machine of another layout than `{machine.name}`")
    return bytes(checkpoint[len(head) :])
