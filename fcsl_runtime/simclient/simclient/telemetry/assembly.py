# SPDX-License-Identifier: Apache-2.0
"""Assemblies of bodies that arrive in pieces. Memory is bounded by the received bytes, never by announced sizes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from enum import Enum
from typing import Generic, TypeVar

from .datagram import Datagram

Key = TypeVar("Key")
#: Approximate overhead of a piece in bytes.
_PIECE_BYTES = 200


class Piece(Enum):
    """The effect of a datagram on its packet. CONTRADICTION: its split differs from the packet's other datagrams."""

    NEW = 0
    AGAIN = 1
    CONTRADICTION = 2


class _Assembly:
    """The pieces of one body, by offset."""

    def __init__(self, first: Datagram):
        self.total, self.stride = first.total, first.stride
        self.pieces: dict[int, bytes] = {}
        self.cost = 0

    def add(self, datagram: Datagram) -> Piece:
        if datagram.total != self.total or datagram.stride != self.stride:
            return Piece.CONTRADICTION
        if datagram.offset in self.pieces:
            return Piece.AGAIN
        self.pieces[datagram.offset] = datagram.piece
        self.cost += len(datagram.piece) + _PIECE_BYTES
        return Piece.NEW

    def body(self) -> bytes | None:
        if len(self.pieces) < -(-self.total // self.stride):
            return None
        return b"".join(self.pieces[at] for at in range(0, self.total, self.stride))


class Assemblies(Generic[Key]):
    """A bounded number of packets and bytes, by key. The packet that received nothing for longest is dropped first."""

    def __init__(self, packets_max: int, bytes_max: int):
        self._packets_max, self._bytes_max = packets_max, bytes_max
        self._held: OrderedDict[Key, _Assembly] = OrderedDict()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._held)

    def __contains__(self, key: Key) -> bool:
        return key in self._held

    def add(self, key: Key, datagram: Datagram) -> Piece:
        """Adds a piece; the caller must call `shrink` afterwards."""
        packet = self._held.get(key)
        if packet is None:
            packet = self._held[key] = _Assembly(datagram)
        before = packet.cost
        piece = packet.add(datagram)
        if piece is Piece.NEW:
            self._bytes += packet.cost - before
            self._held.move_to_end(key)
        return piece

    def body(self, key: Key) -> bytes | None:
        """The body, once it is complete; None before."""
        packet = self._held.get(key)
        return None if packet is None else packet.body()

    def drop(self, key: Key) -> None:
        self._bytes -= self._held.pop(key).cost

    def shrink(self) -> Iterator[Key]:
        """Drops packets beyond the limits; yields their keys."""
        while len(self._held) > self._packets_max or self._bytes > self._bytes_max:
            key = next(iter(self._held))
            self.drop(key)
            yield key
