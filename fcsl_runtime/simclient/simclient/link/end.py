# SPDX-License-Identifier: Apache-2.0
"""One end of a link (docs/reference/transports.md): ticks, sessions, and what goes to which port. It does no I/O and has no clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from .frame import Flag, Frame, FrameError, Kind
from .port import Full, Policy, Port

__all__ = ["End", "Full", "Policy"]

PORTS = 16
HELLO_TICKS, HELLO_TRIES = 8, 8


class End:
    """`ports` maps numbers to policies; `session` is from 1 to 65535 and another one at every start; `retransmit_ticks` is
    at least 1, and more than a round trip takes. Raises ValueError."""

    def __init__(self, ports: Mapping[int, Policy], session: int, retransmit_ticks: int):
        if not 0 < session < 65536 or retransmit_ticks < 1 or not all(0 <= port < PORTS for port in ports):
            raise ValueError("a session is from 1 to 65535, retransmit_ticks at least 1, a port from 0 to 15")
        self.ports = {number: Port(policy) for number, policy in sorted(ports.items())}
        self.counters: Counter[str] = Counter()
        self.session = session
        self.peer = 0
        self._retransmit_ticks = retransmit_ticks
        self._challenge = 1
        self._peer_challenge = self._candidate = self._candidate_challenge = 0
        self._answer = False
        self._ticks = self._tries = 0

    def send(self, port: int, message: bytes) -> None:
        """To be sent from the next tick on. Raises ValueError for a message that never fits, KeyError for an unused
        port, and Full."""
        self.ports[port].put(message)

    def receive(self, port: int) -> bytes | None:
        """The oldest message of a port; None if there is none. Raises KeyError."""
        inbox = self.ports[port].inbox
        return inbox.popleft() if inbox else None

    # ---- what is sent ----------------------------------------------------------------------------------------

    def tick(self) -> Iterator[bytes]:
        """One link tick passes: the frames of this tick."""
        hellos = list(self._hellos())
        for port in self.ports.values():
            port.tick(self._retransmit_ticks)
        yield from (frame.to_bytes() for frame in hellos)
        for number, port in self.ports.items():
            while (frame := port.next_frame(number, self.session, self.peer)) is not None:
                yield frame.to_bytes()

    def _hellos(self) -> Iterator[Frame]:
        if self._answer:
            self._answer = False
            yield self._hello(self.peer, self._peer_challenge, Flag.CONNECTED)
        if self.peer and not self._candidate:
            return
        if self._ticks:
            self._ticks -= 1
            return
        self._ticks = HELLO_TICKS - 1
        self._tries += 1
        if self._candidate and self._tries > HELLO_TRIES:
            self._candidate = 0
        else:
            yield self._hello(self._candidate, self._candidate_challenge if self._candidate else 0, Flag.NONE)

    def _hello(self, to: int, challenge: int, flags: Flag) -> Frame:
        return Frame(Kind.HELLO, self.session, self._challenge, to, challenge, 0, flags)

    # ---- what arrives ----------------------------------------------------------------------------------------

    def take_frame(self, data: bytes) -> None:
        """A frame that came over the wire, or anything else."""
        try:
            frame = Frame.from_bytes(data)
        except FrameError as error:
            self.counters[error.reason] += 1
            return
        if frame.kind is Kind.HELLO:
            self._take_hello(frame)
            return
        port = self.ports.get(frame.port)
        kind = Kind.DATA if frame.kind is Kind.ACKNOWLEDGEMENT else frame.kind
        if port is None or port.policy.value is not kind:
            self.counters["malformed"] += 1
        elif not port.reliable:
            self.counters["frames_taken"] += 1
            port.take_message(frame)
        elif self._is_of_peer(frame):
            self.counters["frames_taken"] += 1
            port.confirm(frame.acknowledge)
            if frame.kind is Kind.DATA and not port.take_data(frame):
                self.counters["malformed"] += 1

    def _take_hello(self, frame: Frame) -> None:
        self.counters["frames_taken"] += 1
        if frame.session == self.session:
            self.counters["other_session"] += 1  # an echo, or a peer that chose the same number
            return
        if frame.session != self.peer and frame.to == self.session and frame.acknowledge == self._challenge:
            self._connect(frame.session)
        if frame.session == self.peer:
            self._peer_challenge = frame.sequence
            self._answer |= Flag.CONNECTED not in frame.flags or frame.to != self.session
        else:
            self._suspect(frame.session)
            self._candidate_challenge = frame.sequence

    def _connect(self, peer: int) -> None:
        self.counters["peer_restarts"] += bool(self.peer)
        self.peer, self._candidate = peer, 0
        self._challenge = self._challenge % 65535 + 1
        for port in self.ports.values():
            if port.reliable:
                port.restart()

    def _suspect(self, session: int) -> None:
        """A session other than the peer's speaks."""
        if session != self._candidate:
            self._candidate, self._candidate_challenge = session, 0
            self._tries = self._ticks = 0

    def _is_of_peer(self, frame: Frame) -> bool:
        if (frame.session, frame.to) == (self.peer, self.session):
            return True
        self.counters["other_session"] += 1
        if frame.session == self.peer:
            self._answer = True
        elif frame.session != self.session:
            self._suspect(frame.session)
        return False
