# SPDX-License-Identifier: Apache-2.0
"""rosbag2's first format: sqlite3, one table of messages per file."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from urllib.parse import quote

import numpy as np

from ..errors import BagError
from .bag import Array, Bag, Topic
from .batch import Message, batch_of
from .files import bag_files
from .sqlite_pages import SqlitePages
from .time_order import Block, Part, in_time_order

#: Messages per batch.
_BATCH = 4096
#: Of a message.
_ROW = np.dtype([("row", "<i8"), ("topic", "<i8"), ("log_ns", "<i8")])
#: Errors that reading a row can raise: sqlite3 allows any kind of value in any column, such as text or 1e300 for a
#: time.
_SQLITE_ERRORS = (sqlite3.Error, TypeError, ValueError, OverflowError)


@dataclass
class _File:
    """A file: its topics by number; of each message in the order of recording its row, topic and time.

    `damage`: why there are no more. `pages` has them where sqlite does not find them.
    """

    path: Path
    topics: dict[int, Topic]
    rows: Array
    damage: str = ""
    pages: SqlitePages | None = None

    def chosen(self, topics: Collection[str] | None) -> Array:
        """The rows of messages of `topics` (None: all)."""
        numbers = [number for number, topic in self.topics.items() if topics is None or topic.name in topics]
        return self.rows[np.isin(self.rows["topic"], numbers)]


class SqliteBag(Bag):
    """A bag of sqlite3 files."""

    def _open(self) -> None:
        self.files = bag_files(self.path)
        self._databases = [self._survey(file) for file in self.files]
        for file in self._databases:
            for number, topic in file.topics.items():
                self._count(replace(topic, count=int(np.count_nonzero(file.rows["topic"] == number))))

    def _survey(self, file: Path) -> _File:
        found = _File(file, {}, np.empty(0, _ROW))
        try:
            with closing(_connect(file)) as database:
                found.topics = _topics(database)
                found.rows, found.damage = _rows(database)
        except _SQLITE_ERRORS as error:
            if file == self.files[0]:
                raise BagError(f"{file}: not an sqlite3 bag, or a damaged one ({error})") from None
            self._damaged(file, f"{file.name} cannot be read ({error})")
        if found.damage:
            pages = SqlitePages(file)
            if len(pages.rows) > len(found.rows):
                found.pages = pages
                found.rows = np.array([row[:3] for row in pages.rows.values()], _ROW)
            self._damaged(file, f"{file.name} breaks off after {len(found.rows)} messages ({found.damage})")
        unmerged = file.with_name(file.name + "-wal")
        if unmerged.is_file() and unmerged.stat().st_size:
            self._damaged(unmerged, f"{unmerged.name}: the recorder was cut off before it put this into {file.name}")
        return found

    def _in_file_order(self, topics: Collection[str] | None, beyond_damage: bool) -> Iterator[Block]:
        self.read_bytes = self.lost = 0
        for number, file in enumerate(self._databases):
            self.reading = number
            yield from self._blocks(file, file.chosen(topics))
            self.lost += bool(file.damage)
            if file.damage and not beyond_damage:
                return

    def _in_time_order(self, topics: Collection[str] | None) -> Iterator[Block]:
        self.read_bytes = 0
        parts = []
        for file in self._databases:
            rows = file.chosen(topics)
            if len(rows):
                rows = rows[np.argsort(rows["log_ns"], kind="stable")]
                parts.append(Part(int(rows["log_ns"][0]), partial(self._blocks, file, rows)))
        return in_time_order(parts, str(self.path))

    def _blocks(self, file: _File, rows: Array) -> Iterator[Block]:
        """The messages of these rows, in their order."""
        lost, why = 0, ""
        with closing(_connect(file.path)) as database:
            for begin in range(0, len(rows), _BATCH):
                some: list[Message] = []
                for row, number, log_ns in rows[begin : begin + _BATCH].tolist():
                    try:
                        some.append((number, log_ns, file.pages.data(row) if file.pages else _data(database, row)))
                    except _SQLITE_ERRORS as error:
                        lost, why = lost + 1, str(error)
                        self.lost += 1
                batch = batch_of(some)
                self.read_bytes += len(batch.data)
                yield batch, file.topics
        if lost:
            self._damaged(file.path, f"{file.path.name} lacks {lost} messages ({why})")


def _connect(file: Path) -> sqlite3.Connection:
    """Immutable: nothing is written beside the file, so that bags on read-only disks can be read."""
    database = sqlite3.connect(f"file:{quote(str(file.absolute()))}?mode=ro&immutable=1", uri=True)
    database.execute("PRAGMA writable_schema = ON")  # opens a file that has been cut off, too
    return database


def _topics(database: sqlite3.Connection) -> dict[int, Topic]:
    definitions: dict[str, tuple[str, str]] = {}
    if database.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'message_definitions'").fetchone():
        rows = database.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        definitions = {name: (encoding, text) for name, encoding, text in rows if text}
    found = {}
    for number, name, kind, encoding in database.execute("SELECT id, name, type, serialization_format FROM topics"):
        found[int(number)] = Topic(str(name), str(kind), 0, str(encoding), *definitions.get(kind, ("", "")))
    return found


def _rows(database: sqlite3.Connection) -> tuple[Array, str]:
    """The rows of messages as far as they can be read, and why there are no more."""
    parts, damage = [np.empty(0, _ROW)], ""
    try:
        cursor = database.execute("SELECT rowid, topic_id, timestamp FROM messages NOT INDEXED ORDER BY rowid")
        while rows := cursor.fetchmany(_BATCH):
            parts.append(np.array(rows, _ROW))
    except _SQLITE_ERRORS as error:
        damage = str(error)
    return np.concatenate(parts), damage


def _data(database: sqlite3.Connection, row: int) -> bytes:
    (data,) = database.execute("SELECT data FROM messages WHERE rowid = ?", (row,)).fetchone()
    return data if isinstance(data, bytes) else b""  # no type accepts empty bytes: text counts as a damaged message
