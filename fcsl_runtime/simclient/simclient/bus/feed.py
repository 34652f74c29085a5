# SPDX-License-Identifier: Apache-2.0
"""What comes of all machines on a session: ticks, and who asks for them gets the host's writes, too."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .machine import BusMachine
from .session import Session
from .ticks import Lost, Tick, TickReader
from .writes import WRITES, WRITTEN, Write, Written, read_writes


class Feed:
    """The messages of these machines, from now on."""

    def __init__(self, session: Session, machines: Sequence[BusMachine], writes: bool = False):
        self._session = session
        self._readers = {machine.prefix: TickReader(machine) for machine in machines}
        # In this order: who has heard the first `Written` hears every write behind it.
        session.subscribe(machines, *((WRITES, WRITTEN) if writes else ()))

    def events(self) -> Iterator[tuple[BusMachine, Tick | Write | Written] | None]:
        """In their order: of a tick the writes that it saw, how many there were, then the values. None where nothing
        more has come yet. Ends with the session."""
        for message in self._session.messages():
            if message is None:
                yield None
                continue
            prefix, _, name = message.key.rpartition("/")
            reader = self._readers[prefix]
            found = read_writes(name, message.data) or reader.take(name, message.data)
            if isinstance(found, Write) and found.is_restore:
                reader.jump()
            if found is not None:
                yield reader.machine, found

    def ticks(self) -> Iterator[tuple[BusMachine, Tick] | None]:
        """The values alone."""
        for event in self.events():
            if event is None:
                yield None
            elif isinstance(event[1], Tick):
                yield event[0], event[1]

    def lost(self) -> str:
        """What did not come whole; "" if all did."""
        each = [reader.lost for reader in self._readers.values()]
        lost = Lost(sum(o.ticks for o in each), sum(o.values for o in each), sum(o.refused for o in each))
        unread = f"{self._session.dropped} messages came faster than they were read" if self._session.dropped else ""
        return "; ".join(part for part in (str(lost) if lost else "", unread) if part)
