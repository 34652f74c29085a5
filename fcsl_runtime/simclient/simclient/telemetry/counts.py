# SPDX-License-Identifier: Apache-2.0
"""Counts of received datagrams by result, and of the packets that they carry."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Counts:
    """Counts since the receiver began. `malformed` to `waiting` are disjoint and add up to `received`."""

    received: int = 0
    #: Too short, wrong magic, version or CRC, or an inconsistent header or configuration.
    malformed: int = 0
    #: Datagrams of configurations, first and repeated ones.
    configurations: int = 0
    #: Datagrams of data packets, received for the first time.
    accepted: int = 0
    #: Datagrams of data packets, received before.
    duplicated: int = 0
    #: Datagrams of data packets that are too old for the window.
    too_old: int = 0
    #: Datagrams of the previous session, or of another sender.
    other_session: int = 0
    #: Data dropped because no configuration had been received.
    before_configuration: int = 0
    #: Data buffered until their configuration is complete, or until the shown session ends.
    waiting: int = 0

    #: Complete data packets: one for each tick that is or was in the window.
    packets: int = 0
    #: Of these, packets received after one with a higher sequence number.
    reordered: int = 0
    #: Missing packets between the first and the newest of a session. A packet that arrives late is subtracted.
    lost: int = 0
    #: Packets of which only some datagrams have arrived so far.
    incomplete: int = 0
    #: Packets that the sender never made, because its history was overwritten first; as its packets report.
    overwritten: int = 0
    #: Sessions shown: 1, plus one for every restart of the sender.
    sessions: int = 0
