# SPDX-License-Identifier: Apache-2.0
"""What is in the pages of an sqlite3 bag is what sqlite finds, and is found where sqlite has lost its way."""

from __future__ import annotations

import random
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from simclient.bag.sqlite_pages import SqlitePages

SCHEMA = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
                    offered_qos_profiles TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
INSERT INTO topics VALUES (1, '/a', 'x/msg/A', 'cdr', '');
"""
Messages = list[tuple[int, int, int, bytes]]


def made(path: Path, page_bytes: int, most: int, count: int = 300) -> Messages:
    randomly = random.Random(page_bytes + most)
    messages = [
        (
            n,
            randomly.randrange(-3, 400),
            randomly.choice((0, 1, 2**20, 1_700_000_000 * 10**9, -5)),
            randomly.randbytes(size),
        )
        for n, size in enumerate((randomly.randrange(most) for _ in range(count)), start=1)
    ]
    with closing(sqlite3.connect(path)) as database:
        database.execute(f"PRAGMA page_size = {page_bytes}")
        database.executescript(SCHEMA)
        database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", messages)
        database.commit()
    return messages


def found(path: Path) -> Messages:
    pages = SqlitePages(path)
    return [(*row[:3], pages.data(row.row)) for row in pages.rows.values()]


@pytest.mark.parametrize("page_bytes", [512, 1024, 4096, 65536])
@pytest.mark.parametrize("most", [2, 600, 30_000])
def test_messages_of_a_whole_file(page_bytes: int, most: int, tmp_path: Path) -> None:
    messages = made(tmp_path / "a.db3", page_bytes, most)
    assert found(tmp_path / "a.db3") == messages


def test_whatever_the_bytes(tmp_path: Path) -> None:
    """Cut off anywhere, what is found is of the messages; with any bytes changed there is some result."""
    messages = made(tmp_path / "a.db3", 1024, 3000, 60)
    whole, randomly, file = (tmp_path / "a.db3").read_bytes(), random.Random(3), tmp_path / "b.db3"
    counts = []
    for _ in range(40):
        file.write_bytes(whole[: randomly.randrange(100, len(whole))])
        there = found(file)
        assert set(there) <= set(messages)
        counts.append(len(there))
    assert max(counts) > 50 > 5 > min(counts)
    for _ in range(40):
        data = bytearray(whole)
        for _ in range(20):
            data[randomly.randrange(len(data))] = randomly.randrange(256)
        file.write_bytes(data)
        found(file)


def test_a_chain_that_goes_round_in_circles_ends(tmp_path: Path) -> None:
    made(tmp_path / "a.db3", 512, 3000, 9)
    data = bytearray((tmp_path / "a.db3").read_bytes())
    for page in range(512, len(data), 512):
        if data[page] == 0:  # the link of an overflow page
            data[page : page + 4] = (page // 512 + 1).to_bytes(4, "big")
    (tmp_path / "a.db3").write_bytes(data)
    assert len(found(tmp_path / "a.db3")) <= 9
