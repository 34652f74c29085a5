# SPDX-License-Identifier: Apache-2.0
"""Injected dropouts: sensor channels without samples for some ticks."""

from __future__ import annotations

from simclient.descriptor import Machine
from simclient.errors import did_you_mean
from simclient.link.message import MessageError, without

from .errors import BridgeError


class Dropouts:
    """The channels that get no sample in the next tick."""

    def __init__(self, machine: Machine):
        self._ids = {c.name: c.id for c in machine.channels if c.direction == "sensor"}
        self._left: dict[str, int] = {}

    def add(self, channel: str, ticks: int) -> None:
        """The channel gets no sample in the next `ticks` ticks. Raises BridgeError for an unknown one."""
        if channel not in self._ids:
            hint = did_you_mean(channel, self._ids) or f"; there are {', '.join(self._ids) or 'none'}"
            raise BridgeError(f"no sensor channel `{channel}`{hint}")
        self._left[channel] = ticks

    def clear(self) -> None:
        """Ends all dropouts."""
        self._left = {}

    def missing(self) -> frozenset[str]:
        """The channels without a sample in the next tick; call once per tick."""
        if not self._left:
            return frozenset()
        names = frozenset(name for name, ticks in self._left.items() if ticks > 0)
        self._left = {name: ticks - 1 for name, ticks in self._left.items() if ticks > 1}
        return names

    def strip(self, message: bytes) -> bytes:
        """A sensor message (docs/wire.md) without the channels that are missing in its tick.

        Other bytes are returned unchanged.
        """
        missing = {self._ids[name] for name in self.missing()}
        if not missing:
            return message
        try:
            return without(message, missing)
        except MessageError:
            return message
