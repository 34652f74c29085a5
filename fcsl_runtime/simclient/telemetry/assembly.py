# SPDX-License-Identifier: Apache-2.0
"""A body that comes in pieces, and the configurations that came, of which a bounded number is held."""

from __future__ import annotations

import zlib
from collections import OrderedDict

import numpy as np

from .datagram import Datagram

#: (session, configuration)
Key = tuple[int, int]
#: Of all offers together.
_OFFERS_MAX = 64
_OFFER_BYTES_MAX = 32 << 20


class Assembly:
    """The body of one packet. Its pages are mapped as they are written: a datagram that announces 16 MiB costs none of it."""

    def __init__(self, first: Datagram):
        self.total, self.stride = first.total, first.stride
        self._missing = -(-first.total // first.stride)
        self._have = np.zeros(self._missing, np.uint8).data
        self._body = np.zeros(first.total, np.uint8).data

    @property
    def cost(self) -> int:
        """Bytes that it may come to hold."""
        return self.total + len(self._have)

    @property
    def complete(self) -> bool:
        return not self._missing

    @property
    def body(self) -> memoryview:
        """Zeros where nothing came yet."""
        return self._body

    def fits(self, datagram: Datagram) -> bool:
        """Whether this is cut as the others are."""
        return datagram.total == self.total and datagram.stride == self.stride

    def add(self, datagram: Datagram) -> bool:
        """Whether it was new."""
        number = datagram.offset // self.stride
        if self._have[number]:
            return False
        self._have[number] = 1
        self._missing -= 1
        self._body[datagram.offset : datagram.offset + len(datagram.piece)] = datagram.piece
        return True


class Offers:
    """Configurations of senders that are not shown, complete or not; the one that nothing came for longest makes room.

    So a flood of invented senders can delay a true one, which repeats its configuration, but cannot keep it out by
    being there first.
    """

    def __init__(self) -> None:
        self._held: OrderedDict[Key, Assembly] = OrderedDict()
        self._bytes = 0

    def add(self, datagram: Datagram) -> bool:
        """Takes a piece. False for one that contradicts the others, or completes what has not the CRC that it is named by."""
        key = (datagram.session, datagram.configuration)
        offer = self._held.get(key)
        if offer is None:
            offer = Assembly(datagram)
            self._held[key] = offer
            self._bytes += offer.cost
            while len(self._held) > _OFFERS_MAX or self._bytes > _OFFER_BYTES_MAX:
                self.drop(next(iter(self._held)))
        if not offer.fits(datagram):
            return False
        self._held.move_to_end(key)
        if offer.add(datagram) and offer.complete and zlib.crc32(offer.body) != datagram.configuration:
            self.drop(key)
            return False
        return True

    def complete(self, key: Key) -> bytes | None:
        """The configuration's body, once all of it came."""
        offer = self._held.get(key)
        return bytes(offer.body) if offer is not None and offer.complete else None

    def drop(self, key: Key) -> None:
        self._bytes -= self._held.pop(key).cost
