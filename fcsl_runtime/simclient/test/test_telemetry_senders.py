# SPDX-License-Identifier: Apache-2.0
"""Which sender a receiver shows: late joiners, restarts, floods of strangers, and that all of it stays bounded."""

from __future__ import annotations

import random
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from telemetry_packets import Channel, Sender, datagram, text
from test_telemetry_faults import adds_up, assert_truth

from simclient.telemetry.collector import Collector
from simclient.telemetry.configuration import read_configuration
from simclient.telemetry.window import Window

SILENT_S = 1.0


def fed(collector: Collector, *datagrams: bytes, at_s: float = 0.0) -> Collector:
    for one in datagrams:
        collector.take(one, at_s)
    return collector


def window(collector: Collector) -> Window:
    stream = collector.stream
    assert stream is not None
    return Window(stream.configuration, stream.ring, stream.key[0], stream.ring.held(), ())


def data(sender: Sender, first: int, count: int) -> list[bytes]:
    return [d for s in range(first, first + count) for d in sender.data(s)]


def test_data_wait_for_their_configuration() -> None:
    sender = Sender()
    collector = fed(Collector(100), *data(sender, 20, 5))
    assert collector.stream is None and collector.counts().waiting == 5
    fed(collector, *sender.configuration(25), *data(sender, 25, 5))
    assert_truth(window(collector), sender, list(range(20, 30)))
    assert (collector.counts().waiting, collector.counts().lost) == (0, 0)


def test_a_number_that_no_label_names_is_shown_as_one() -> None:
    sender = Sender(channels=(Channel("machine.state", 9),))
    fed_one = fed(Collector(10), *sender.configuration())
    for sequence, state in enumerate((2, 77, -1, 0)):
        body = sender.body(sequence)[:-4] + struct.pack("<i", state)
        fed(fed_one, *sender.cut(2, sequence, body))
    assert window(fed_one)["machine.state"].tolist() == ["DONE", "<invalid 77>", "<invalid -1>", "IDLE"]


def test_data_that_wait_are_bounded_and_counted() -> None:
    sender = Sender()
    collector = Collector(100_000)
    pieces = sender.data(0)
    for sequence in range(20_000):
        collector.take(sender.data(sequence)[0] if sequence > 19_990 else pieces[0], 0.0)
    counts = collector.counts()
    assert counts.before_configuration == 20_000 - counts.waiting and adds_up(counts)
    fed(collector, *sender.configuration())
    assert window(collector).sequence.tolist() == [0, *range(19_991, 20_000)]


def test_a_restart_begins_the_window_anew_and_loses_nothing() -> None:
    before, after = Sender(session=1), Sender(session=2)
    collector = fed(Collector(100), *before.configuration(), *data(before, 0, 10), at_s=5.0)
    fed(collector, *after.configuration(), *data(after, 0, 7), at_s=5.2)
    assert_truth(window(collector), before, list(range(10)))  # it may be another sender's
    fed(collector, *after.data(7), at_s=5.0 + SILENT_S + 0.1)
    assert_truth(window(collector), after, list(range(8)))
    fed(collector, *data(before, 10, 3), at_s=6.2)  # they were long on their way
    counts = collector.counts()
    assert (counts.sessions, counts.other_session, counts.waiting, counts.lost) == (2, 3, 0, 0) and adds_up(counts)


def test_what_a_session_lacked_stays_counted_after_its_end() -> None:
    before, after = Sender(session=1, stride=100), Sender(session=2, stride=100)
    collector = fed(
        Collector(100), *before.configuration(), *before.data(0), *before.data(3, overwritten=4), before.data(4)[0]
    )
    fed(collector, *after.configuration(), *after.data(0, overwritten=1), *after.data(2, overwritten=2), at_s=9.0)
    counts = collector.counts()
    assert (counts.lost, counts.incomplete, counts.overwritten, counts.packets) == (2 + 1, 1, 4 + 2, 4) and adds_up(
        counts
    )


def test_a_session_that_was_paused_comes_back() -> None:
    paused, other = Sender(session=1), Sender(session=2)
    collector = fed(Collector(100), *paused.configuration(), *data(paused, 0, 3))
    fed(collector, *other.configuration(), *data(other, 0, 3), at_s=20.0)
    fed(collector, *paused.configuration(), *data(paused, 3, 1), at_s=20.5)
    assert_truth(window(collector), other, [0, 1, 2])
    fed(collector, *paused.configuration(), *data(paused, 4, 2), at_s=40.0)
    assert_truth(window(collector), paused, [4, 5])
    assert collector.counts().sessions == 3 and adds_up(collector.counts())


def test_a_slow_session_is_not_silent_between_its_packets() -> None:
    slow, other = Sender(session=1, every=2000), Sender(session=2)  # a packet in 2 s
    collector = fed(Collector(100), *slow.configuration(), *data(slow, 0, 3))
    fed(collector, *other.configuration(), *data(other, 0, 3), at_s=7.9)
    assert_truth(window(collector), slow, [0, 1, 2])
    fed(collector, *data(other, 3, 1), at_s=8.1)
    assert_truth(window(collector), other, [0, 1, 2, 3])


@settings(max_examples=15)
@given(st.integers(0, 2**32), st.integers(1, 12))
def test_a_flood_of_sessions_throws_nobody_out(seed: int, each: int) -> None:
    """Strangers with whole configurations, more of them than there is room for, between any two packets of the live one."""
    source = random.Random(seed)
    live = Sender(session=1)
    collector = fed(Collector(1000), *live.configuration())
    for sequence in range(30):
        fed(collector, *live.data(sequence), at_s=sequence * 0.5)
        for _ in range(each):
            stranger = Sender(session=source.getrandbits(64) | 1, name=f"x{source.getrandbits(30)}")
            fed(collector, *stranger.configuration(), *stranger.data(sequence + 5), at_s=sequence * 0.5 + 0.4)
    assert_truth(window(collector), live, list(range(30)))
    counts = collector.counts()
    assert (counts.sessions, counts.packets) == (1, 30) and adds_up(counts)


def test_no_bytes_cost_more_memory_than_is_set_aside() -> None:
    """Datagrams of 60 bytes, with the right CRC, that announce bodies of 16 MiB in as many pieces."""
    source = random.Random(1)
    collector = Collector(1000)
    tracemalloc.start()
    try:
        for _ in range(5_000):
            kind, session = source.choice([1, 2]), source.getrandbits(64) | 1
            collector.take(datagram(kind, 1, 16 << 20, source.randrange(16 << 20), 7, session, 3, b"x"), 0.0)
        assert tracemalloc.get_traced_memory()[1] < 100 << 20
    finally:
        tracemalloc.stop()
    assert adds_up(collector.counts()) and collector.stream is None


def with_crc(raw: bytes) -> bytes:
    return raw[:8] + struct.pack("<I", zlib.crc32(raw[:8] + bytes(4) + raw[12:])) + raw[12:]


NUMBER = zlib.crc32(Sender().announcement)
SIZE = Sender().body_bytes
PIECE = Sender().body(0)


@pytest.mark.parametrize(
    "broken",
    [
        datagram(3, 1360, SIZE, 0, NUMBER, 1, 0, PIECE),
        datagram(0, 1360, SIZE, 0, NUMBER, 1, 0, PIECE),
        datagram(2, 0, SIZE, 0, NUMBER, 1, 0, PIECE),
        datagram(2, 1360, 0, 0, NUMBER, 1, 0, b""),
        datagram(2, 1360, SIZE, 0, NUMBER, 0, 0, PIECE),
        datagram(2, 1360, SIZE, 0, NUMBER, 1, 0, PIECE[:-1]),
        datagram(2, 1360, SIZE, 0, NUMBER, 1, 0, PIECE + b"x"),
        datagram(2, 1360, SIZE - 1, 0, NUMBER, 1, 0, PIECE[:-1]),
        datagram(2, 1360, SIZE + 1, 0, NUMBER, 1, 0, PIECE + b"x"),
        datagram(2, 60, SIZE, 59, NUMBER, 1, 0, PIECE[59:119]),
        datagram(2, 60, SIZE, SIZE // 60 * 60 + 60, NUMBER, 1, 0, PIECE[:60]),
        datagram(2, 60, SIZE, 60, NUMBER, 1, 5, PIECE[60:120]),
        datagram(2, 1360, (16 << 20) + 1, 0, NUMBER, 1, 0, bytes(1360)),
        with_crc(b"FCSU" + Sender().data(0)[0][4:]),
        with_crc(b"FCST\x01" + Sender().data(0)[0][5:]),
        with_crc(Sender().data(0)[0][:40]),
        Sender().data(0)[0][:-1] + b"\xff",
    ],
    ids=[
        *("kind 3", "kind 0", "stride 0", "total 0", "session 0", "a byte too few", "a byte too many"),
        *("a smaller body", "a larger body", "offset between", "offset behind", "cut otherwise", "17 MiB"),
        *("magic", "version", "no piece", "another byte"),
    ],
)
def test_datagrams_that_are_malformed(broken: bytes) -> None:
    """Each by one thing, with the right CRC, of the session that is shown; packet 5 is on its way in pieces of 30."""
    begun = datagram(2, 30, SIZE, 0, NUMBER, 1, 5, PIECE[:30])
    collector = fed(Collector(10), *Sender().configuration(), begun, broken)
    counts = collector.counts()
    assert (counts.malformed, counts.accepted, counts.incomplete, counts.packets) == (1, 1, 1, 0) and adds_up(counts)
    fed(collector, *Sender().data(0))
    assert_truth(window(collector), Sender(), [0])


def test_the_highest_sequence() -> None:
    sender = Sender()
    collector = fed(Collector(10), *sender.configuration(), *sender.cut(2, 2**63 - 2, sender.body(0)))
    assert window(collector).sequence.tolist() == [2**63 - 2]
    for beyond in (2**63 - 1, 2**63, 2**64 - 1):
        fed(collector, *sender.cut(2, beyond, sender.body(0)))
    assert collector.counts().malformed == 3 and len(window(collector)) == 1


def test_labels_are_read_once_and_are_the_same_for_a_type() -> None:
    """Thousands of states with their names: announced in megabytes, read in as many steps as there are channels."""
    sender = Sender(channels=tuple(Channel(f"a.outputs.s{i}", 9) for i in range(20)))
    body = sender.announcement
    names = struct.pack("<H", 3) + b"".join(map(text, ("IDLE", "RUN", "DONE")))
    assert body.count(names) == 20
    for count, whole in ((0, True), (1, True), (2, True), (20, False)):  # "none" is said by a model's
        none = body.replace(names, struct.pack("<H", 0), count) if whole else body.replace(b"DONE", b"GONE", 1)
        read = read_configuration(none)
        assert (read is not None) == whole
        if read is not None:
            kinds = [c.type for c in read.channels.values()]
            assert kinds == ["i32"] * count + ["state"] * (20 - count) and read.machine.states == (
                "IDLE",
                "RUN",
                "DONE",
            )


def test_views_are_those_of_the_sender() -> None:
    """Of any length that a text can have; what they say is for those who draw."""
    for views in ("", "{}", "[" * 65_535):
        collector = fed(Collector(10), *Sender(views=views).configuration())
        assert collector.stream is not None and collector.stream.configuration.machine.views == views
    body = bytearray(Sender(views="{}").announcement)
    at = body.index(b"\2\0{}")
    body[at : at + 2] = b"\xff\xff"  # longer than what is there
    assert read_configuration(bytes(body)) is None


def test_a_window_of_huge_packets_is_smaller() -> None:

    huge = Sender(channels=(Channel("a.outputs.b", 6, (2**20, 2 - 1)),), stride=60_000)
    collector = fed(Collector(10**6), *huge.configuration())
    assert collector.stream is not None and collector.stream.ring.raw.nbytes <= 256 << 20


@settings(max_examples=300)
@given(st.data())
def test_no_configuration_with_the_right_crc_makes_it_raise(drawn: st.DataObject) -> None:
    """Mutated ones, each with the CRCs that it should have: shown or malformed, and never an exception."""
    body = bytearray(Sender().announcement)
    for _ in range(drawn.draw(st.integers(1, 4))):
        at = drawn.draw(st.integers(0, len(body) - 1))
        how = drawn.draw(st.sampled_from(["set", "cut", "insert", "repeat"]))
        if how == "set":
            body[at] = drawn.draw(st.integers(0, 255))
        elif how == "cut":
            del body[at : at + drawn.draw(st.integers(0, 20))]
        elif how == "insert":
            body[at:at] = drawn.draw(st.binary(max_size=8))
        else:
            body[at:at] = body[at : at + 40]
        body = body or bytearray(b"x")
    raw = bytes(body[:60_000])
    one = datagram(1, 65_000, len(raw), 0, zlib.crc32(raw), 5, 0, raw)
    collector = fed(Collector(10), one)
    counts = collector.counts()
    assert adds_up(counts) and (collector.stream is not None) == (counts.malformed == 0)
    if collector.stream is not None:
        assert collector.stream.configuration.machine.size == 24 + sum(
            f.size for f in collector.stream.configuration.machine.fields.values()
        )


@pytest.mark.parametrize(
    "broken",
    [
        lambda s: replace(s, tick_hz=0),
        lambda s: replace(s, every=0),
        lambda s: replace(s, channels=()),
        lambda s: replace(s, channels=(s.channels[0], s.channels[0])),
        lambda s: replace(s, name="a\nb"),
        lambda s: replace(s, views="{\n}"),
        lambda s: replace(s, channels=(replace(s.channels[1], path="a b"),)),
        lambda s: replace(s, channels=(replace(s.channels[1], shape=(0,)),)),
        lambda s: replace(s, channels=(replace(s.channels[1], shape=(1,) * 9),)),
    ],
    ids=[
        "no rate",
        "no ticks",
        "no channels",
        "twice",
        "line break",
        "line break in views",
        "no path",
        "empty array",
        "rank 9",
    ],
)
def test_configurations_that_are_refused(broken: Callable[[Sender], Sender]) -> None:
    sender = broken(Sender())
    collector = fed(Collector(10), *sender.configuration())
    assert collector.stream is None and collector.counts().malformed == 1 and adds_up(collector.counts())
