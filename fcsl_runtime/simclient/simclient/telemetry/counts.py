# SPDX-License-Identifier: Apache-2.0
"""Counts: what became of every datagram, and of the packets that they carry."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Counts:
    """Since the receiver began. Every datagram is in one of those from `malformed` to `waiting`: they add up to `received`."""

    received: int = 0
    #: Too short, another magic or version, a wrong CRC, a header or a configuration that contradicts itself or what came before.
    malformed: int = 0
    #: Of configurations, first and repeated ones.
    configurations: int = 0
    #: Of data packets, each for the first time.
    accepted: int = 0
    #: Of data packets, but had already.
    duplicated: int = 0
    #: Of data packets so old that the window has no place for them any more.
    late: int = 0
    #: Of the session before this one, or of another sender.
    other_session: int = 0
    #: Data dropped before any configuration had told what they mean.
    before_configuration: int = 0
    #: Data that wait for their configuration, or for the end of the session that is shown.
    waiting: int = 0

    #: Data packets that are complete: one for each tick that was, or is, in the window.
    packets: int = 0
    #: Of those, packets that came after one with a higher sequence.
    reordered: int = 0
    #: Packets that are missing between the first and the newest of a session. One that comes late is lost no longer.
    lost: int = 0
    #: Packets of which some datagrams came and others did not, or not yet.
    incomplete: int = 0
    #: Ticks that the sender itself did not get to see, as the packets say.
    missed: int = 0
    #: Sessions that were shown: 1, and one more for every restart of the sender.
    sessions: int = 0
