# SPDX-License-Identifier: Apache-2.0
"""Feeds the receiver of telemetry what libFuzzer (atheris) invents, between the packets of a sender that is known.

An input is a list of steps: packets of that sender that come, come late, twice, cut off or not at all; datagrams of
strangers, of which some are bytes as they are and others have the right CRC, configurations as well; time that passes.
The receiver's limits are made so small that an input reaches them. At the end must hold: all that came is counted once;
memory is bounded; what is shown of the known sender is what it sent, unless it was silent for long enough.
"""

from __future__ import annotations

import struct
import sys
import zlib
from pathlib import Path

import atheris
from must_hold import demand, held_bytes, search

sys.path.insert(0, str(Path(__file__).resolve().parents[4] / "fcsl_runtime/simclient/test"))
from telemetry_packets import CHANNELS, Sender, datagram  # noqa: E402

from simclient.twin import trace  # noqa: E402, F401 -- before what is instrumented

with atheris.instrument_imports(include=["simclient.telemetry"]):
    from simclient.telemetry import collector as collecting
    from simclient.telemetry import configuration, ring, stream
    from simclient.telemetry.receiver import Telemetry

ROWS = 8
_SEQUENCES = 64
_END = 2**63
_STEPS_MAX = 80
_BURST, _BURST_PIECE, _BURSTS_MAX = 40, bytes(2_000), 3
#: Time without a packet of the known sender that does not end its session, s.
_PATIENCE_S = 0.9
#: Besides the window: of what waits, what is announced, what is told about channels.
_MEMORY_MAX = 100_000

collecting.OFFERS_MAX, collecting.OFFER_BYTES_MAX = 6, 30_000
collecting.WAITING_MAX, collecting.WAITING_BYTES_MAX = 12, 6_000
stream.PARTIAL_MAX, stream.PARTIAL_BYTES_MAX = 4, 10_000
configuration.CHANNELS_MAX = 12
ring.WINDOW_BYTES_MAX = 65_536

_CHANNELS = (CHANNELS[0], CHANNELS[2], CHANNELS[4], CHANNELS[5])
KNOWN = (Sender(1, _CHANNELS), Sender(1, _CHANNELS, stride=30))
DATA = [[sender.data(s) for s in range(_SEQUENCES)] for sender in KNOWN]
BODIES = [[sender.body(s) for s in range(_SEQUENCES)] for sender in KNOWN]
ANNOUNCED = [sender.configuration() for sender in KNOWN]
STRANGERS = [Sender(s, _CHANNELS) for s in range(2, 6)]


class Input:
    """The bytes of an input, one after another; zeros behind its end."""

    def __init__(self, data: bytes):
        self._data = data
        self._at = 0

    def left(self) -> bool:
        return self._at < len(self._data)

    def take(self, size: int) -> bytes:
        taken = self._data[self._at : self._at + size]
        self._at += size
        return taken

    def byte(self) -> int:
        return (self.take(1) or b"\0")[0]

    def word(self) -> int:
        return int(struct.unpack("<I", self.take(4).ljust(4, b"\0"))[0])


class Case:
    """One input at work. `strict`: the known sender has to be the one that is shown."""

    def __init__(self, data: bytes):
        self.input = Input(data)
        kind = self.input.byte()
        self.which = kind & 1
        self.collector = collecting.Collector(ROWS)
        self.now_s = self.heard_s = 100.0
        self.next = self.bursts = 0
        self.strict = not kind & 2
        #: Of the known sender: packets that came whole, in this order.
        self.came: list[int] = []
        #: Of its packets, the pieces that came by themselves: once they are all there, the packet may be too.
        self.pieces: dict[int, set[int]] = {}
        if self.strict:
            self.live(ANNOUNCED[self.which])

    def feed(self, raw: bytes) -> None:
        self.collector.take(raw, self.now_s)

    def live(self, datagrams: list[bytes]) -> None:
        for raw in datagrams:
            self.feed(raw)
        self.heard_s = self.now_s

    def run(self) -> None:
        steps = (
            *(self.coming, self.skipped, self.earlier, self.a_piece, self.announced, self.truncated, self.flipped),
            *(self.raw, self.made, self.announcement, self.stranger, self.burst, self.a_while, self.silence),
        )
        for _ in range(_STEPS_MAX):
            if not self.input.left():
                break
            steps[self.input.byte() % len(steps)]()
        self.check()

    # ---- the known sender --------------------------------------------------------------------------------------------

    def whole(self, sequence: int) -> None:
        self.live(DATA[self.which][sequence])
        self.came.append(sequence)

    def coming(self) -> None:
        if self.next < _SEQUENCES:
            self.whole(self.next)
            self.next += 1

    def skipped(self) -> None:
        self.next = min(self.next + 1, _SEQUENCES - 1)

    def earlier(self) -> None:
        """Late, or a second time."""
        self.whole(max(0, self.next - 1 - self.input.byte() % 12))

    def a_piece(self) -> None:
        sequence = max(0, min(self.next - self.input.byte() % 12, _SEQUENCES - 1))
        pieces = DATA[self.which][sequence]
        if len(pieces) > 1:  # else it would be a packet that came
            piece = self.input.byte() % len(pieces)
            self.pieces.setdefault(sequence, set()).add(piece)
            self.live([pieces[piece]])

    def announced(self) -> None:
        self.live(ANNOUNCED[self.which])

    def truncated(self) -> None:
        raw = DATA[self.which][0][0]
        self.malformed(raw[: self.input.byte() % len(raw)])

    def flipped(self) -> None:
        raw = bytearray(DATA[self.which][0][0])
        raw[self.input.byte() % len(raw)] ^= self.input.byte() or 1
        self.malformed(bytes(raw))

    def malformed(self, raw: bytes) -> None:
        before = self.collector.counts().malformed
        self.feed(raw)
        demand(self.collector.counts().malformed == before + 1, "a damaged datagram is counted as malformed")

    # ---- strangers ---------------------------------------------------------------------------------------------------

    def raw(self) -> None:
        self.feed(self.input.take(self.input.byte()))

    def made(self) -> None:
        """Any header, with the right CRC."""
        shape = self.input.byte()
        piece = self.input.take(shape >> 2)
        stride = max(1, len(piece)) if shape & 2 else self.input.word() & 0xFFFF
        total = stride * (self.input.byte() % 5) + len(piece) if shape & 2 else self.input.word()
        offset = total - len(piece) if shape & 1 else stride * (self.input.byte() % 5)
        session = 2 + self.input.byte() % 6
        self.feed(
            datagram(
                1 + shape % 2, stride, total, max(0, offset), self.input.byte() % 4, session, self.input.word(), piece
            )
        )

    def announcement(self) -> None:
        """A configuration with some bytes changed, cut off or put in, whole, with the CRCs that it has to have."""
        body = bytearray(KNOWN[0].announcement)
        for _ in range(self.input.byte() % 4):
            where, size = self.input.byte(), self.input.byte()
            at = where if where < 64 else where * 16 + self.input.byte()  # numbers and names stand first
            body[at % len(body) : at % len(body) + size % 16] = self.input.take(size >> 4)
            body = body or bytearray(1)
        self.announce(bytes(body))

    def announce(self, body: bytes) -> None:
        """A whole configuration, with the CRCs that it has to have, and a packet of as many bytes as it promises."""
        number, session = zlib.crc32(body), 10 + len(body) % 5
        self.feed(datagram(1, 60_000, len(body), 0, number, session, 0, body))
        size = struct.unpack_from("<I", body[24:28].ljust(4, b"\0"))[0] % 2_000 or 1
        self.feed(datagram(2, 60_000, size, 0, number, session, 0, b"\x03" * size))

    def stranger(self) -> None:
        which = self.input.byte()
        one = STRANGERS[which % len(STRANGERS)]
        sequence = self.input.byte() % _SEQUENCES
        far = one.cut(2, _END - sequence % 4, one.body(0))  # about where numbers end
        for raw in [*one.configuration(), *(far if which & 128 else one.data(sequence))]:
            self.feed(raw)

    def burst(self) -> None:
        if self.bursts == _BURSTS_MAX:  # they take time
            return
        self.bursts += 1
        session, kind = 1000 + self.input.byte(), 1 + self.input.byte() % 2
        for k in range(_BURST):
            self.feed(datagram(kind, 2_000, 4_000, 0, k, session + k, k, _BURST_PIECE))

    def a_while(self) -> None:
        self.now_s = max(self.now_s, min(self.now_s + self.input.byte() / 500, self.heard_s + _PATIENCE_S))

    def silence(self) -> None:
        self.now_s += 2.0
        self.strict = False

    # ---- what must hold ----------------------------------------------------------------------------------------------

    def check(self) -> None:
        counts = self.collector.counts()
        ended = counts.malformed + counts.configurations + counts.accepted + counts.duplicated + counts.too_old
        ended += counts.other_session + counts.before_configuration + counts.waiting
        demand(ended == counts.received, "every datagram is counted once")
        demand(min(counts.lost, counts.incomplete, counts.overwritten) >= 0, "no count is negative")
        shown = self.collector.stream
        demand((shown is None) == (counts.sessions == 0), "a session is counted when it is shown")
        window_bytes = 0
        if shown is not None:
            demand(shown.ring.rows <= ROWS, "the window has no more rows than were asked for")
            window_bytes = shown.ring.raw.nbytes
            used = sum(field.size for field in shown.configuration.machine.fields.values())
            demand(used + 24 == shown.configuration.body_bytes, "channels fill a packet")
            demand(window_bytes <= max(65_536, shown.configuration.body_bytes), "the window's memory is bounded")
            self.read(self.collector)
        demand(held_bytes(self.collector) <= window_bytes + _MEMORY_MAX, "memory is bounded")
        if self.strict:
            self.check_known(shown)

    def read(self, collector: collecting.Collector) -> None:
        """All that a user may ask for, without an exception."""
        telemetry = Telemetry()
        telemetry._collector = collector
        window = telemetry.window()
        if len(window):
            telemetry.latest(next(iter(telemetry.channels)))
        for field in window.fields:
            demand(len(window[field.path]) == len(window.tick), f"{field.path} has a row for each tick")

    def check_known(self, shown: stream.Stream | None) -> None:
        demand(shown is not None and shown.key[0] == 1, "no stranger throws out the sender that is heard")
        assert shown is not None
        held = shown.ring.held().tolist()
        bodies = BODIES[self.which]
        demand(all(shown.ring.row(s) == bodies[s] for s in held), "every row is what was sent")
        newest = max(self.came, default=-1)
        if self.which == 0:
            inside = sorted({s for s in self.came if s > newest - ROWS})
            demand(held == inside, f"the window has every packet that came: {held}, not {inside}")
            self.check_counts(newest)
        elif self.came and self.came[-1] == newest and not self.made_of_pieces(newest):
            demand(newest in held, "a packet that came whole, and newer than all others, is in the window")

    def made_of_pieces(self, newest: int) -> bool:
        """Whether a packet behind this one may have come piece by piece, and pushed it out of the window."""
        return any(s > newest and len(p) == len(DATA[self.which][s]) for s, p in self.pieces.items())

    def check_counts(self, newest: int) -> None:
        """Of packets of one datagram, exactly what was done to them."""
        seen: set[int] = set()
        late = again = reordered = 0
        for sequence in self.came:
            top = max(seen, default=-1)
            if sequence <= top - ROWS:
                late += 1
            elif sequence in seen:
                again += 1
            else:
                reordered += sequence < top
                seen.add(sequence)
        counts = self.collector.counts()
        lost = newest - min(seen) + 1 - len(seen) if seen else 0
        got = (counts.too_old, counts.duplicated, counts.reordered, counts.packets, counts.lost)
        wanted = (late, again, reordered, len(seen), lost)
        demand(got == wanted, f"late, duplicated, reordered, packets, lost are {wanted}: {got}")


if __name__ == "__main__":
    search(lambda data: Case(data).run())
