# SPDX-License-Identifier: Apache-2.0
"""Ticks of a machine, of its values and commits on the bus (docs/reference/transports.md).

Zenoh may drop any message on the way to a slow observer. A value belongs to the next commit of its direction if no
commit between was lost; so the values of a tick count if its commit follows that of the tick before.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from ..c_machine import DIRECTION_NAMES
from .machine import BusChannel, BusMachine

_COMMIT = struct.Struct("<QQIBBH")


@dataclass(frozen=True)
class Tick:
    """The values of one direction in a tick, little-endian, in the order of the table."""

    tick: int
    values: list[tuple[BusChannel, bytes]]


@dataclass(frozen=True)
class Lost:
    """What did not come whole: ticks, values of ticks that came, and messages that are none."""

    ticks: int = 0
    values: int = 0
    refused: int = 0

    def __str__(self) -> str:
        return f"{self.ticks} ticks and {self.values} values were lost, {self.refused} messages refused"

    def __bool__(self) -> bool:
        return bool(self.ticks or self.values or self.refused)


@dataclass
class _Direction:
    last: int | None = None  # tick of the last commit
    is_known: bool = False  # that nothing of the tick that comes was missed
    lost: int = 0  # ticks
    waiting: dict[str, list[bytes]] = field(default_factory=dict)  # since then


class TickReader:
    """Takes the messages of a machine in their order."""

    def __init__(self, machine: BusMachine):
        self.machine = machine
        self._missing = self._refused = 0
        self._channels = {channel.name: channel for channel in machine.channels}
        self._directions = {name: _Direction() for name in DIRECTION_NAMES}
        self._commit_bytes = _COMMIT.size + (len(machine.channels) + 7) // 8

    @property
    def lost(self) -> Lost:
        """Until now."""
        return Lost(max(state.lost for state in self._directions.values()), self._missing, self._refused)

    def take(self, name: str, data: bytes) -> Tick | None:
        """A message under the key `name` of the machine; the tick that it completes."""
        if name == "tick":
            return self._commit(data)
        channel = self._channels.get(name)
        if channel is None:
            self._refused += 1
            return None
        values = self._directions[channel.direction].waiting.setdefault(name, [])
        if len(values) < 2:  # more than one is none: nobody knows which
            values.append(data)
        return None

    def jump(self) -> None:
        """A checkpoint was restored: the next tick may be any."""
        for state in self._directions.values():
            state.last, state.waiting, state.is_known = None, {}, True

    def _commit(self, data: bytes) -> Tick | None:
        if len(data) != self._commit_bytes:
            self._refused += 1
            return None
        tick, _, table, direction, _, count = _COMMIT.unpack_from(data)
        bits = int.from_bytes(data[_COMMIT.size :], "little")
        if direction >= len(DIRECTION_NAMES) or table != self.machine.table_hash or count != len(self.machine.channels):
            self._refused += 1
            return None
        state = self._directions[DIRECTION_NAMES[direction]]
        last, waiting, is_known = state.last, state.waiting, state.is_known or tick == 0
        state.last, state.waiting, state.is_known = tick, {}, False
        if last is None and not is_known:  # what came before it may be a part
            return None
        if last is not None and tick != last + 1:
            state.lost += max(1, tick - last)
            return None
        return Tick(tick, self._values(bits, waiting))

    def _values(self, bits: int, waiting: dict[str, list[bytes]]) -> list[tuple[BusChannel, bytes]]:
        found = []
        for channel in self.machine.channels:
            if bits >> channel.index & 1:
                came = waiting.get(channel.name, [])
                values = channel.values(came[0]) if len(came) == 1 else None
                if values is not None:
                    found.append((channel, values))
                else:
                    self._missing += 1
        return found
