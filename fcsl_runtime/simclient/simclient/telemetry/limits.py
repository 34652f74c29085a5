# SPDX-License-Identifier: Apache-2.0
"""Every limit of the telemetry receiver. docs/guide/monitoring.md shows this table (test/test_limits.py)."""

#: bytes of a body
BODY_BYTES_MAX = 16 << 20
#: bytes of a datagram
DATAGRAM_BYTES_MAX = 65_535
#: channels of a configuration
CHANNELS_MAX = 16_384
#: axes of a channel
RANK_MAX = 8
#: characters of a path
PATH_CHARACTERS_MAX = 1024
#: packets in pieces of the sender that is shown; of more the oldest is given up
PARTIAL_MAX = 64
#: bytes of packets in pieces
PARTIAL_BYTES_MAX = 32 << 20
#: configurations of senders that are not shown; of more the one without progress for longest is dropped
OFFERS_MAX = 64
#: bytes of configurations of senders that are not shown
OFFER_BYTES_MAX = 32 << 20
#: data datagrams that wait for a configuration
WAITING_MAX = 16_384
#: bytes of data that waits for a configuration
WAITING_BYTES_MAX = 16 << 20
#: bytes of a window; with larger bodies it keeps fewer ticks
WINDOW_BYTES_MAX = 256 << 20
#: former sessions whose datagrams are recognised
FORMER_MAX = 16
