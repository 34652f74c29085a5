# SPDX-License-Identifier: Apache-2.0
"""The receiver under what a network does: every tick that arrived equals the truth, and the counts equal what was done."""

from __future__ import annotations

import random
import struct
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from telemetry_packets import CHANNELS, LABELS, Channel, Sender

from simclient.telemetry.counts import Counts
from simclient.telemetry.receiver import Telemetry
from simclient.telemetry.window import Window

DATAGRAM_COUNTS = (
    *("malformed", "configurations", "accepted", "duplicated", "too_old", "other_session", "before_configuration"),
    "waiting",
)


def adds_up(counts: Counts) -> bool:
    return counts.received == sum(getattr(counts, name) for name in DATAGRAM_COUNTS)


def assert_truth(window: Window, sender: Sender, sequences: list[int]) -> None:
    """Whether the window has these packets in this order, and of each every value."""
    assert window.sequence.tolist() == sequences
    assert window.tick.tolist() == [s * sender.every for s in sequences]
    assert window.time_ns.tolist() == [s * sender.every * 10**9 // sender.tick_hz for s in sequences]
    assert window.time_s.tolist() == [time_ns / 1e9 for time_ns in window.time_ns.tolist()]
    for number, channel in enumerate(sender.channels):
        got = window[channel.path]
        assert got.shape == (len(sequences), *channel.shape)
        wanted = [sender.values(s)[number] for s in sequences]
        if channel.type in LABELS:
            wanted = [[LABELS[channel.type][int(v)] for v in row] for row in wanted]
        assert got.reshape(len(sequences), channel.count).tolist() == wanted, channel.path


@st.composite
def deliveries(draw: st.DrawFn) -> tuple[Sender, list[tuple[int, int, str]], random.Random]:
    """A sender, and what arrives in order: (sequence or -1 for the configuration, datagram, whole or truncated)."""
    sender = Sender(session=draw(st.integers(1, 2**64 - 1)), stride=draw(st.sampled_from([16, 60, 100, 1360])))
    first = draw(st.sampled_from([0, 1, 1000, 2**40]))
    arriving: list[tuple[int, int, str]] = [(-1, k, "whole") for k in range(len(sender.configuration()))]
    for sequence in range(first, first + draw(st.integers(1, 25))):
        for k in range(len(sender.data(sequence))):
            fate = draw(st.sampled_from(["whole"] * 6 + ["lost", "twice", "truncated", "truncated, then whole"]))
            arriving += [(sequence, k, "truncated")] * fate.startswith("truncated")
            arriving += [(sequence, k, "whole")] * {"whole": 1, "twice": 2, "truncated, then whole": 1}.get(fate, 0)
    source = random.Random(draw(st.integers(0, 2**32)))
    how_far = draw(st.sampled_from([0, 0, 2, 8, 1000]))  # places that a datagram may be late
    order = sorted(range(len(arriving)), key=lambda i: i + source.uniform(0, how_far))
    return sender, [arriving[i] for i in order], source


@settings(max_examples=150)
@given(deliveries())
def test_any_loss_reordering_duplication_and_truncation(
    case: tuple[Sender, list[tuple[int, int, str]], random.Random],
) -> None:
    sender, arriving, source = case
    telemetry = Telemetry(window_ticks=1000)
    for sequence, k, how in arriving:
        whole = (sender.configuration() if sequence < 0 else sender.data(sequence))[k]
        telemetry.feed(whole if how == "whole" else whole[: source.randrange(len(whole))])
    times = Counter((s, k) for s, k, how in arriving if how == "whole" and s >= 0)
    pieces = {s: len(sender.data(s)) for s, _ in times}
    arrived = {s: {k for other, k in times if other == s} for s, _ in times}
    whole_packets = sorted(s for s, have in arrived.items() if len(have) == pieces[s])
    # The order in which packets become complete: each with its last new datagram.
    seen: set[tuple[int, int]] = set()
    completed = []
    for s, k, how in arriving:
        if how == "whole" and s >= 0 and (s, k) not in seen:
            seen.add((s, k))
            if s in whole_packets and all((s, j) in seen for j in range(pieces[s])):
                completed.append(s)
    assert telemetry.counts == Counts(
        received=len(arriving),
        malformed=sum(how == "truncated" for _, _, how in arriving),
        configurations=len(sender.configuration()),
        accepted=len(times),
        duplicated=sum(times.values()) - len(times),
        packets=len(whole_packets),
        reordered=sum(s < max(completed[: i + 1]) for i, s in enumerate(completed)),
        lost=whole_packets[-1] - whole_packets[0] + 1 - len(whole_packets) if whole_packets else 0,
        incomplete=sum(len(have) < pieces[s] for s, have in arrived.items()),
        sessions=1,
    )
    assert_truth(telemetry.window(), sender, whole_packets)


@settings(max_examples=100)
@given(st.lists(st.integers(0, 60), max_size=80), st.integers(1, 20))
def test_a_small_window_has_the_newest(arriving: list[int], rows: int) -> None:
    sender = Sender()
    telemetry = Telemetry(window_ticks=rows)
    telemetry.feed(sender.configuration()[0])
    held: set[int] = set()
    late = duplicated = 0
    for sequence in arriving:
        telemetry.feed(sender.data(sequence)[0])
        late += sequence <= max(held, default=-1) - rows
        duplicated += sequence in held and sequence > max(held) - rows
        if not (held and sequence <= max(held) - rows):
            held.add(sequence)
    counts = telemetry.counts
    assert adds_up(counts) and (counts.too_old, counts.duplicated, counts.packets) == (late, duplicated, len(held))
    assert counts.lost == (max(held) - min(held) + 1 - len(held) if held else 0)
    inside = sorted(s for s in held if s > max(held) - rows)
    assert_truth(telemetry.window(), sender, inside)
    assert_truth(telemetry.window(n=3), sender, inside[-3:])


def test_a_late_packet_is_lost_no_longer() -> None:
    sender = Sender()
    telemetry = Telemetry()
    for sequence in (0, 1, 4, 5):
        for datagram in [*sender.configuration(), *sender.data(sequence)]:
            telemetry.feed(datagram)
    assert telemetry.counts.lost == 2
    before = telemetry.window()
    telemetry.feed(sender.data(3)[0])
    assert (telemetry.counts.lost, telemetry.counts.reordered) == (1, 1)
    assert_truth(telemetry.window(), sender, [0, 1, 3, 4, 5])
    assert_truth(before, sender, [0, 1, 4, 5])  # a window is a copy


def test_of_packets_in_pieces_a_bounded_number_is_on_its_way() -> None:
    sender = Sender(stride=100)
    telemetry = Telemetry()
    for datagram in sender.configuration():
        telemetry.feed(datagram)
    for sequence in range(200):  # none of them is ever complete
        telemetry.feed(sender.data(sequence)[0])
    assert (telemetry.counts.incomplete, telemetry.counts.packets) == (200, 0)
    for datagram in [*sender.data(100)[1:], *sender.data(135)[1:]]:  # given up long ago, and last: 64 are on their way
        telemetry.feed(datagram)
    for datagram in sender.data(150)[1:]:
        telemetry.feed(datagram)
    counts = telemetry.counts
    late = 2 * (len(sender.data(0)) - 1)
    assert (counts.too_old, counts.packets, counts.incomplete) == (late, 1, 199) and adds_up(counts)


def test_ticks_that_the_sender_missed_are_as_it_says() -> None:
    sender = Sender(every=5)
    telemetry = Telemetry()
    for datagram in [
        *sender.configuration(),
        *sender.data(0),
        *sender.data(1, overwritten=3),
        *sender.data(2, overwritten=7),
    ]:
        telemetry.feed(datagram)
    assert (telemetry.counts.overwritten, telemetry.counts.lost) == (7, 0)
    assert telemetry.window().tick.tolist() == [0, 5, 10]


@pytest.mark.parametrize("stride", [100, 1360])
@pytest.mark.parametrize(
    ("tick", "time_ns"), [(2**63, 0), (2**64 - 1, 5), (3, -1), (3, -(2**63)), (3, 2**62 + 1), (3, 2**63 - 1)]
)
def test_a_tick_or_time_that_no_machine_has_is_malformed(stride: int, tick: int, time_ns: int) -> None:
    """A time of -2**63 is none to NumPy and Arrow: a viewer that was given it ended."""
    sender = Sender(stride=stride)
    telemetry = Telemetry()
    wrong = struct.pack("<Qq", tick, time_ns) + sender.body(1)[16:]
    for datagram in [*sender.configuration(), *sender.data(0), *sender.cut(2, 1, wrong), *sender.data(2)]:
        telemetry.feed(datagram)
    counts = telemetry.counts
    assert (counts.malformed, counts.packets, counts.lost) == (1, 2, 1) and adds_up(counts)
    assert_truth(telemetry.window(), sender, [0, 2])


def test_the_last_tick_and_time_are_taken() -> None:
    sender = Sender()
    telemetry = Telemetry()
    last = struct.pack("<Qq", 2**63 - 1, 2**62) + sender.body(1)[16:]
    for datagram in [*sender.configuration(), *sender.data(0), *sender.cut(2, 1, last)]:
        telemetry.feed(datagram)
    window = telemetry.window()
    assert telemetry.counts.malformed == 0
    assert (window.tick.tolist(), window.time_ns.tolist()) == ([0, 2**63 - 1], [0, 2**62])


@pytest.mark.parametrize("stride", [1, 7, 1360, 65_000])
def test_a_large_configuration_and_large_packets(stride: int) -> None:
    channels = [*CHANNELS, *(Channel(f"big.outputs.c{i}", 6, (4, 2, 5), "m/s²") for i in range(40))]
    if stride == 1:
        channels = channels[:9]
    sender = Sender(channels=tuple(channels), stride=stride)
    telemetry = Telemetry()
    datagrams = sender.configuration()
    for sequence in range(3):
        datagrams += sender.data(sequence)
    random.Random(3).shuffle(datagrams)
    for datagram in datagrams:
        telemetry.feed(datagram)
    assert_truth(telemetry.window(), sender, [0, 1, 2])
    assert len(datagrams) == telemetry.counts.received == telemetry.counts.accepted + telemetry.counts.configurations


def test_a_receiver_that_is_wrong_by_one_value_would_be_found() -> None:
    """The control of assert_truth: another session's values are not these."""
    sender = Sender()
    telemetry = Telemetry()
    for datagram in [*sender.configuration(), *sender.data(0)]:
        telemetry.feed(datagram)
    with pytest.raises(AssertionError):
        assert_truth(telemetry.window(), replace(sender, session=2), [0])
