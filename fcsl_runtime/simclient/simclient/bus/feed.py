# SPDX-License-Identifier: Apache-2.0
"""Ticks of all machines on a session."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .machine import BusMachine
from .session import Session
from .ticks import Lost, Tick, TickReader


class Feed:
    """The messages of these machines, from now on."""

    def __init__(self, session: Session, machines: Sequence[BusMachine]):
        self._session = session
        self._readers = {machine.prefix: TickReader(machine) for machine in machines}
        session.subscribe(machines)

    def ticks(self) -> Iterator[tuple[BusMachine, Tick] | None]:
        """None where nothing more has come yet. Ends with the session."""
        for message in self._session.messages():
            if message is None:
                yield None
                continue
            prefix, _, name = message.key.rpartition("/")
            reader = self._readers[prefix]
            tick = reader.take(name, message.data)
            if tick is not None:
                yield reader.machine, tick

    def lost(self) -> str:
        """What did not come whole; "" if all did."""
        each = [reader.lost for reader in self._readers.values()]
        lost = Lost(sum(o.ticks for o in each), sum(o.values for o in each), sum(o.refused for o in each))
        unread = f"{self._session.dropped} messages came faster than they were read" if self._session.dropped else ""
        return "; ".join(part for part in (str(lost) if lost else "", unread) if part)
