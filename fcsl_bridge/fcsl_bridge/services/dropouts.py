# SPDX-License-Identifier: Apache-2.0
"""Injected dropouts: sensor channels without samples for some ticks."""

from __future__ import annotations

from simclient.descriptor import Machine
from simclient.errors import did_you_mean

from ..errors import BridgeError


class Dropouts:
    """The channels that get no sample in the next tick."""

    def __init__(self, machine: Machine):
        self._numbers = {c.name: c.index for c in machine.channels if c.direction == "sensor"}
        self._left: dict[str, int] = {}

    def add(self, channel: str, ticks: int) -> None:
        """The channel gets no sample in the next `ticks` ticks. Raises BridgeError for an unknown one."""
        if channel not in self._numbers:
            hint = did_you_mean(channel, self._numbers) or f"; there are {', '.join(self._numbers) or 'none'}"
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

    def take(self) -> list[tuple[int, int]]:
        """Channels, by number, and their ticks without a sample, for somebody else to count; none is left."""
        taken = [(self._numbers[name], ticks) for name, ticks in self._left.items()]
        self._left = {}
        return taken
