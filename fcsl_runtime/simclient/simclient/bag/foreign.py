# SPDX-License-Identifier: Apache-2.0
"""Bags that are not MCAP: sqlite3 (.db3) and ROS 1 (.bag), read through the same interface. formats.py chooses the
class.
"""

from __future__ import annotations

import bz2
import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import islice
from pathlib import Path
from urllib.parse import quote

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ..errors import BagError
from .bag import Bag, Topic
from .files import bag_files
from .mcap_file import ENTRY, Batch
from .unpack import TooLarge, unbz2, unlz4, unzstd

#: Messages per batch. Batches of unpacked messages, which can be large, hold fewer.
_BATCH, _BATCH_BYTES = 4096, 64 << 20
#: rosbags' decompressors of chunks, and their replacements with a size limit.
_LIMITED = {bz2.decompress: unbz2, lz4.frame.decompress: unlz4}
_HEADER = "std_msgs/msg/Header"
#: Errors that reading a row can raise: sqlite3 allows any kind of value in any column, such as text or 1e300 for a
#: time.
_SQLITE_ERRORS = (sqlite3.Error, TypeError, ValueError, OverflowError)
#: (number of the topic, time of recording in ns, CDR bytes).
Message = tuple[int, int, bytes]


def batch_of(messages: Sequence[Message]) -> Batch:
    """The messages concatenated into one batch."""
    entries, at = [], 0
    for number, log_ns, data in messages:
        entries.append((number, log_ns, at, at + len(data)))
        at += len(data)
    return Batch(b"".join(data for _, _, data in messages), np.array(entries, ENTRY))


class UnpackedMessages(Bag):
    """Mixin of a Bag whose messages are each compressed with zstd."""

    def batches(self, topics: Collection[str] | None = None) -> Iterator[tuple[Batch, Mapping[int, Topic]]]:
        for batch, announced in super().batches(topics):
            for messages in _unpacked(batch):
                yield batch_of(messages), announced


def _unpacked(batch: Batch) -> Iterator[list[Message]]:
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


class SqliteBag(Bag):
    """rosbag2's first format: one table of messages per file, in the order of recording."""

    def _open(self) -> None:
        self.files = bag_files(self.path)
        self._announced: dict[Path, dict[int, Topic]] = {}
        for file in self.files:
            try:
                with closing(_connect(file)) as database:
                    self._announced[file] = _sqlite_topics(database)
                    counts = dict(database.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id"))
            except _SQLITE_ERRORS as error:
                if not self.topics:
                    raise BagError(f"{file}: not an sqlite3 bag, or a damaged one ({error})") from None
                self.truncated = f"{file.name} cannot be read ({error})"
                return
            for number, topic in self._announced[file].items():
                known = self.topics.setdefault(topic.name, topic)
                self.topics[topic.name] = replace(known, count=known.count + int(counts.get(number, 0)))
            if (unmerged := file.with_name(file.name + "-wal")).is_file() and unmerged.stat().st_size:
                self.truncated = f"{unmerged.name}: the recorder was cut off before it put this into {file.name}"

    def batches(self, topics: Collection[str] | None = None) -> Iterator[tuple[Batch, Mapping[int, Topic]]]:
        self.read_bytes = 0
        for file, announced in self._announced.items():
            wanted = [number for number, topic in announced.items() if topics is None or topic.name in topics]
            query = (
                "SELECT topic_id, timestamp, data FROM messages "
                f"WHERE topic_id IN ({', '.join(map(str, wanted))}) ORDER BY id"
            )
            count = 0
            try:
                with closing(_connect(file)) as database:
                    cursor = database.execute(query)
                    while rows := cursor.fetchmany(_BATCH):
                        batch = batch_of(rows)
                        self.read_bytes += len(batch.data)
                        yield batch, announced
                        count += len(rows)
            except _SQLITE_ERRORS as error:
                self.truncated = f"{file.name} breaks off after {count} messages ({error})"
                return


def _connect(file: Path) -> sqlite3.Connection:
    # Immutable: nothing is written beside the file, so that bags on read-only disks can be read.
    return sqlite3.connect(f"file:{quote(str(file.absolute()))}?mode=ro&immutable=1", uri=True)


def _sqlite_topics(database: sqlite3.Connection) -> dict[int, Topic]:
    definitions: dict[str, tuple[str, str]] = {}
    if database.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'message_definitions'").fetchone():
        rows = database.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        definitions = {name: (encoding, text) for name, encoding, text in rows if text}
    found = {}
    for number, name, kind, encoding in database.execute("SELECT id, name, type, serialization_format FROM topics"):
        found[int(number)] = Topic(str(name), str(kind), 0, str(encoding), *definitions.get(kind, ("", "")))
    return found


class Ros1Bag(Bag):
    """ROS 1 bags; each message is converted to the CDR of the same fields in ROS 2 (whose header has no `seq`)."""

    def _open(self) -> None:
        self.files = bag_files(self.path)
        self._stores1: dict[tuple[str, str], Typestore] = {}
        for file in self.files:
            try:
                with Ros1Reader(file) as reader:
                    for connection in reader.connections:
                        topic = self._topic_of(connection)
                        known = self.topics.setdefault(topic.name, topic)
                        self.topics[topic.name] = replace(known, count=known.count + connection.msgcount)
            except BagError:
                raise
            except Exception as error:  # noqa: BLE001  a damaged index can make rosbags raise anything
                if not self.topics:
                    text = f"{file}: not a ROS 1 bag, or a damaged one ({error}); `rosbag reindex` mends those"
                    raise BagError(text) from None
                self.truncated = f"{file.name} cannot be read ({error})"
                return

    def batches(self, topics: Collection[str] | None = None) -> Iterator[tuple[Batch, Mapping[int, Topic]]]:
        self.read_bytes = 0
        for file in self.files:
            count = 0
            try:
                with Ros1Reader(file) as reader:
                    for at, chunk in reader.chunks.items():
                        limited = _LIMITED.get(chunk.decompressor, chunk.decompressor)
                        reader.chunks[at] = chunk._replace(decompressor=limited)
                    wanted = [c for c in reader.connections if topics is None or c.topic in topics]
                    announced = {connection.id: self._topic_of(connection) for connection in wanted}
                    found = self._messages(reader, wanted) if wanted else iter(())
                    while messages := list(islice(found, _BATCH)):
                        batch = batch_of(messages)
                        self.read_bytes += len(batch.data)
                        yield batch, announced
                        count += len(messages)
            except Exception as error:  # noqa: BLE001  damaged chunks can make rosbags raise anything
                self.truncated = f"{file.name} breaks off after {count} messages ({error})"
                return

    def _messages(self, reader: Ros1Reader, wanted: list[Connection]) -> Iterator[Message]:
        for connection, log_ns, data in reader.messages(wanted):
            try:
                cdr = bytes(self._types_of(connection).ros1_to_cdr(data, connection.msgtype))
            except SerdeError:
                cdr = b""  # no type accepts empty bytes, so the message counts as damaged
            yield connection.id, log_ns, cdr

    def _topic_of(self, connection: Connection) -> Topic:
        schema = self._types_of(connection).generate_msgdef(connection.msgtype, ros_version=2)[0]
        return Topic(connection.topic, connection.msgtype, 0, "cdr", "ros2msg", schema)

    def _types_of(self, connection: Connection) -> Typestore:
        """The types of a connection, with ROS 2's header. Raises BagError."""
        kind, text = connection.msgtype, connection.msgdef.data
        store = self._stores1.get((kind, text))
        if store is None:
            store = self._stores1[kind, text] = get_typestore(Stores.EMPTY)
            try:
                types = get_types_from_msg(text, kind)
                if _HEADER in types:
                    types[_HEADER] = get_typestore(Stores.ROS2_JAZZY).fielddefs[_HEADER]
                store.register(types)
            except Exception as error:  # noqa: BLE001  damaged text can make the parser below raise anything
                raise BagError(f"{self.path}: the definition of {kind} is not valid: {error}") from None
        return store


class PackedMcapBag(UnpackedMessages, Bag):
    """MCAP whose messages are each compressed."""


class PackedSqliteBag(UnpackedMessages, SqliteBag):
    """sqlite3 whose messages are each compressed."""
