# SPDX-License-Identifier: Apache-2.0
"""The link layer in C and the one in Python, both made of docs/reference/transports.md, over a wire that loses and damages frames."""

from __future__ import annotations

import ctypes
import random
import re
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from simclient.link import End, Full, Policy
from simclient.link.frame import FRAME_MAX, PAYLOAD_MAX, Flag, Frame, FrameError, Kind, crc16
from simclient.link.port import QUEUE, WINDOW, Port

HAL = Path(__file__).resolve().parents[3] / "fcsl_hal"
LATEST, SEQUENCED, RELIABLE, BULK = 0, 3, 7, 15
POLICIES = {LATEST: Policy.LATEST, SEQUENCED: Policy.SEQUENCED, RELIABLE: Policy.RELIABLE, BULK: Policy.RELIABLE}
C_POLICIES = {Policy.LATEST: 1, Policy.SEQUENCED: 2, Policy.RELIABLE: 3}
RETRANSMIT_TICKS = 3
#: More than an fcsl_link_t, and than a decoder, has.
STRUCT_BYTES = 4 << 20


#: Where the counters of a link and of a port are.
COUNTERS_C = """
#include "fcsl/fcsl_link.h"
const void *link_counters(const fcsl_link_t *link) { return &link->counters; }
const void *port_counters(const fcsl_link_t *link, int port) { return &link->ports[port].counters; }
"""


def counter_names(struct: str) -> list[str]:
    header = (HAL / "include/fcsl/fcsl_link.h").read_text()
    (members,) = re.findall(rf"typedef struct {{([^}}]*)}} {struct};", header)
    return re.findall(r"uint64_t (\w+);", members)


@pytest.fixture(scope="session")
def native(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The C implementation as a library."""
    folder = tmp_path_factory.mktemp("link")
    library, counters = folder / "liblink.so", folder / "counters.c"
    counters.write_text(COUNTERS_C)
    sources = [*sorted((HAL / "src/link").glob("*.c")), counters]
    include = ["-I", HAL / "include", "-I", HAL / "src"]
    subprocess.run(["cc", "-std=c11", "-O1", "-fPIC", "-shared", *include, *sources, "-o", library], check=True)
    loaded = ctypes.CDLL(str(library))
    for name in ("fcsl_link_next_frame", "fcsl_cobs_encode", "fcsl_cobs_decode"):
        getattr(loaded, name).restype = ctypes.c_size_t
    loaded.fcsl_crc16.restype = ctypes.c_uint16
    for name in ("link_counters", "port_counters"):
        getattr(loaded, name).restype = ctypes.POINTER(ctypes.c_uint64)
    return loaded


class CEnd:
    """The C implementation with the methods of End."""

    def __init__(self, library: ctypes.CDLL, session: int):
        self._lib, self._link = library, ctypes.create_string_buffer(STRUCT_BYTES)
        policies = [C_POLICIES[POLICIES[port]] if port in POLICIES else 0 for port in range(16)]
        assert library.fcsl_link_open(self._link, (ctypes.c_int * 16)(*policies), session, RETRANSMIT_TICKS) == 0

    def send(self, port: int, message: bytes) -> None:
        status = self._lib.fcsl_link_send(self._link, port, message, ctypes.c_size_t(len(message)))
        assert status in (0, 2)
        if status == 2:
            raise Full

    def receive(self, port: int) -> bytes | None:
        out, size = ctypes.create_string_buffer(1 << 16), ctypes.c_size_t()
        status = self._lib.fcsl_link_receive(self._link, port, out, ctypes.c_size_t(len(out)), ctypes.byref(size))
        assert status in (0, 1)
        return out.raw[: size.value] if status == 0 else None

    def tick(self) -> Iterator[bytes]:
        self._lib.fcsl_link_tick(self._link)
        frame = ctypes.create_string_buffer(FRAME_MAX)
        while size := self._lib.fcsl_link_next_frame(self._link, frame):
            yield frame.raw[:size]

    def counters(self) -> dict[str, int]:
        """Of the link, and of each port behind its number."""
        of_link = self._lib.link_counters(self._link)
        found = {name: of_link[i] for i, name in enumerate(counter_names("fcsl_link_counters_t"))}
        for port in POLICIES:
            of_port = self._lib.port_counters(self._link, port)
            found |= {f"{port} {name}": of_port[i] for i, name in enumerate(counter_names("fcsl_link_port_counters_t"))}
        return found

    def take_frame(self, data: bytes) -> None:
        self._lib.fcsl_link_take_frame(self._link, data, ctypes.c_size_t(len(data)))


Ends = Callable[[int], "End | CEnd"]


@pytest.fixture(params=["c to python", "python to c", "python to python"])
def pair(request: pytest.FixtureRequest, native: ctypes.CDLL) -> tuple[Ends, Ends]:
    made: dict[str, Ends] = {
        "c": lambda session: CEnd(native, session),
        "python": lambda session: End(POLICIES, session, RETRANSMIT_TICKS),
    }
    first, second = request.param.split(" to ")
    return made[first], made[second]


def carry(source: End | CEnd, target: End | CEnd, draw: random.Random, bad: float) -> None:
    """One link tick; of the frames a part is lost, repeated or damaged."""
    for frame in list(source.tick()):
        if draw.random() < bad:
            continue
        if draw.random() < bad:
            at = draw.randrange(len(frame))
            frame = frame[:at] + bytes([frame[at] ^ 1 << draw.randrange(8)]) + frame[at + 1 :]
        for _ in range(2 if draw.random() < bad else 1):
            target.take_frame(frame)


@pytest.mark.parametrize("bad", [0.0, 0.1, 0.3])
def test_messages_arrive_whole_and_in_order(pair: tuple[Ends, Ends], bad: float) -> None:
    draw = random.Random(7)
    ends = [make(number + 1) for number, make in enumerate(pair)]
    messages = [draw.randbytes(draw.choice([0, 1, 239, 240, 241, 480, 3000, 16380])) for _ in range(60)]
    sent, got = [0, 0], [[], []]
    for _ in range(20_000):
        if all(len(arrived) == len(messages) for arrived in got):
            break
        for number, end in enumerate(ends):
            try:
                while sent[number] < len(messages):
                    end.send(RELIABLE, messages[sent[number]])
                    sent[number] += 1
            except Full:
                pass
            while (message := end.receive(RELIABLE)) is not None:
                got[number].append(message)
            carry(end, ends[1 - number], draw, bad)
    assert got == [messages, messages]


def test_a_peer_that_starts_again_is_recognised(pair: tuple[Ends, Ends]) -> None:
    draw = random.Random(1)
    one, other = pair[0](1), pair[1](9)
    for session in (2, 3, 4):
        other.send(RELIABLE, b"to %d" % session)
        one = pair[0](session)
        one.send(RELIABLE, b"from %d" % session)
        one.send(SEQUENCED, b"log")
        for _ in range(200):
            carry(one, other, draw, 0.2)
            carry(other, one, draw, 0.2)
        assert other.receive(RELIABLE) == b"from %d" % session
        assert one.receive(RELIABLE) == b"to %d" % session


def test_the_newest_counts_on_one_port_and_all_do_on_the_other(pair: tuple[Ends, Ends]) -> None:
    one, other = pair[0](1), pair[1](2)
    for number in range(5):
        one.send(LATEST, b"%d" % number)
        one.send(SEQUENCED, b"%d" % number)
        for frame in one.tick():
            other.take_frame(frame)
            other.take_frame(frame)
    assert [other.receive(LATEST), other.receive(LATEST)] == [b"4", None]
    assert [other.receive(SEQUENCED) for _ in range(6)] == [b"0", b"1", b"2", b"3", b"4", None]


@pytest.mark.parametrize("code", ["c", "python"])
def test_no_more_than_a_window_is_under_way(code: str, native: ctypes.CDLL) -> None:
    """16 frames; those that nothing confirms are all sent again, as often as the page says."""
    one = CEnd(native, 1) if code == "c" else End(POLICIES, 1, RETRANSMIT_TICKS)
    other = End(POLICIES, 2, RETRANSMIT_TICKS)
    draw = random.Random(1)
    for _ in range(20):
        carry(one, other, draw, 0.0)
        carry(other, one, draw, 0.0)
    for number in range(40):
        one.send(RELIABLE, bytes([number]))

    def sent() -> list[int]:
        frames.append([frame for frame in one.tick() if Frame.from_bytes(frame).kind is Kind.DATA])
        return [Frame.from_bytes(frame).payload[0] for frame in frames[-1]]

    frames: list[list[bytes]] = []
    window = list(range(WINDOW))
    assert [sent() for _ in range(7)] == [window, [], [], window, [], [], window]
    for frame in frames[0][:5]:
        other.take_frame(frame)
    for _ in range(2):
        for frame in other.tick():
            one.take_frame(frame)
    assert sent() == list(range(WINDOW, WINDOW + 5))


def test_a_queue_takes_a_message_whole_or_not() -> None:
    port = Port(Policy.RELIABLE)
    for number in range(QUEUE - 1):
        port.put(bytes([number]))
    with pytest.raises(Full):
        port.put(bytes(PAYLOAD_MAX + 1))  # two frames, and one has room
    port.put(b"the last")
    with pytest.raises(Full):
        port.put(b"one more")
    assert port.counters["sent"] == QUEUE


def test_both_ends_send_the_same_bytes(native: ctypes.CDLL) -> None:
    """The same calls and the same frames lead to the same frames, byte for byte, and to the same counts."""
    draw = random.Random(3)
    in_c, in_python = CEnd(native, 1), End(POLICIES, 1, RETRANSMIT_TICKS)
    twins = [in_c, in_python]
    other = End(POLICIES, 2, RETRANSMIT_TICKS)
    compared = 0
    for tick in range(600):
        port, message = draw.choice(list(POLICIES)), draw.randbytes(draw.randrange(600 if tick % 2 else 200))
        if len(message) > 240 and port in (LATEST, SEQUENCED):
            port = BULK
        full = [False, False]
        for number, end in enumerate(twins):
            try:
                end.send(port, message)
            except Full:
                full[number] = True
        assert full[0] == full[1]
        native_frames, frames = (list(end.tick()) for end in twins)
        assert sorted(native_frames) == sorted(frames)
        compared += len(frames)
        for frame in frames:
            if draw.random() > 0.1:
                other.take_frame(frame)
        if tick % 3 == 0:
            with_room = draw.randbytes(draw.randrange(500))
            other.send(RELIABLE, with_room)
            other.send(draw.choice((LATEST, SEQUENCED)), with_room[:200])
        if tick == 300:
            other = End(POLICIES, 3, RETRANSMIT_TICKS)
        answers = [frame for frame in other.tick() if draw.random() > 0.1]
        for end in twins:
            for frame in answers:
                end.take_frame(frame)
                if tick % 50 == 7:
                    end.take_frame(frame)
                    end.take_frame(frame[:-1] + bytes([frame[-1] ^ 1]))
            while end.receive(RELIABLE) is not None:
                pass
    assert compared > 600
    counted = {
        **in_python.counters,
        **{f"{n} {k}": v for n, p in in_python.ports.items() for k, v in p.counters.items()},
    }
    counts = in_c.counters()
    assert counted.items() <= counts.items() and all(n == 0 for k, n in counts.items() if k not in counted)
    assert {k for k, n in counts.items() if n} >= {"frames_taken", "wrong_crc", "peer_restarts", f"{RELIABLE} received"}


@given(st.binary(max_size=300))
def test_bytes_that_are_no_frame_are_refused(data: bytes) -> None:
    body = data[:-2]
    for candidate in (data, body + crc16(body).to_bytes(2, "little")):
        try:
            frame = Frame.from_bytes(candidate)
        except FrameError:
            continue
        assert frame.to_bytes() == candidate


@given(data=st.binary(min_size=1, max_size=FRAME_MAX), before=st.binary(max_size=40), piece=st.integers(1, 300))
def test_cobs_is_that_of_the_cobs_package(native: ctypes.CDLL, data: bytes, before: bytes, piece: int) -> None:
    out, decoder = ctypes.create_string_buffer(FRAME_MAX + 8), ctypes.create_string_buffer(4096)
    size = native.fcsl_cobs_encode(data, ctypes.c_size_t(len(data)), out)
    assert out.raw[:size] == cobs.encode(data) + b"\0"
    stream, found = before + b"\0" + out.raw[:size], ctypes.c_size_t(0)
    while stream:
        some = stream[:piece]
        stream = stream[native.fcsl_cobs_decode(decoder, some, ctypes.c_size_t(len(some)), ctypes.byref(found)) :]
    assert decoder.raw[: found.value] == data


@given(st.binary(max_size=300))
def test_the_checksum_is_that_of_the_standard_library(native: ctypes.CDLL, data: bytes) -> None:
    assert native.fcsl_crc16(0xFFFF, data, ctypes.c_size_t(len(data))) == crc16(data)


def test_the_example_of_the_page() -> None:
    example = bytes.fromhex("11 05 03 02 01 00 68 69 25 B1")
    assert Frame.from_bytes(example) == Frame(Kind.LATEST, 0x0203, 1, port=5, payload=b"hi")
    page = (HAL.parent / "docs/reference/transports.md").read_text()
    assert example.hex(" ").upper() in page
    assert Frame(Kind.HELLO, 1, flags=Flag.CONNECTED).to_bytes()[:2] == b"\x10\x40"
