# SPDX-License-Identifier: Apache-2.0
"""Bags whose messages are each compressed with zstd."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import zstandard

from .bag import Bag
from .batch import Batch, Message, batch_of
from .sqlite_bag import SqliteBag
from .time_order import Block
from .unpack import TooLarge, unzstd

#: Unpacked messages can be large, so batches hold about this many bytes.
_BATCH_BYTES = 64 << 20


class _Packed(Bag):
    """Mixin that unpacks the messages of a Bag."""

    def _in_file_order(self, topics: Collection[str] | None, beyond_damage: bool) -> Iterator[Block]:
        return _unpacked(super()._in_file_order(topics, beyond_damage))

    def chunks_of(self, topic: str) -> None:
        """Their places are of use to no pass that unpacks messages."""

    def _in_time_order(self, topics: Collection[str] | None) -> Iterator[Block]:
        return _unpacked(super()._in_time_order(topics))


def _unpacked(blocks: Iterator[Block]) -> Iterator[Block]:
    for batch, announced in blocks:
        for messages in _unpacked_messages(batch):
            yield batch_of(messages), announced


def _unpacked_messages(batch: Batch) -> Iterator[list[Message]]:
    """Splits a batch into unpacked ones. A damaged or too large message becomes empty, which no type accepts."""
    messages: list[Message] = []
    size = 0
    for number, log_ns, begin, end in batch.entries.tolist():
        try:
            data = unzstd(batch.data[begin:end])
        except (zstandard.ZstdError, TooLarge):
            data = b""
        messages.append((number, log_ns, data))
        size += len(data)
        if size > _BATCH_BYTES:
            yield messages
            messages, size = [], 0
    yield messages


class PackedMcapBag(_Packed, Bag):
    """MCAP whose messages are each compressed."""


class PackedSqliteBag(_Packed, SqliteBag):
    """sqlite3 whose messages are each compressed."""
