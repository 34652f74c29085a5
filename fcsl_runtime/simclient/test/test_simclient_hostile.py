# SPDX-License-Identifier: Apache-2.0
"""Bags made to do harm: small files that unpack to gigabytes, values of no sense, definitions and metadata that explode."""

from __future__ import annotations

import bz2
import sqlite3
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import pytest
import zstandard
from foreign_bags import imu, number, write, write_mcap
from mcap.writer import CompressionType

from fcsl_compiler.ros.reader import Pick
from simclient import BagError, MapError
from simclient.bag import unpack
from simclient.bag.formats import open_bag
from simclient.ros.reader import Reader
from simclient.ros.types import definitions_of

START = 100 * 10**9
CONTENT = {"/level": [(START + i, number(i)) for i in range(20)], "/imu": [(START, imu(START))]}


def gigabytes(header_says: bool) -> bytes:
    """1 GiB of zeros in zstd."""
    packer = zstandard.ZstdCompressor().compressobj(**({"size": 1 << 30} if header_says else {}))
    return b"".join([*(packer.compress(bytes(1 << 20)) for _ in range(1 << 10)), packer.flush()])


def read_all(bag: Path) -> tuple[int, str]:
    """(messages that are not empty, what is missing)."""
    opened = open_bag(bag)
    return sum(len(data) > 0 for _, _, data in opened.messages()), opened.truncated


@pytest.mark.parametrize("header_says", [True, False])
def test_little_that_unpacks_to_much_takes_no_memory(header_says: bool, tmp_path: Path) -> None:
    """In a process that may not have more than 1 GiB, of which the limit is a quarter."""
    (tmp_path / "packed").write_bytes(gigabytes(header_says))
    script = """
        import resource, sys
        from simclient.bag.unpack import TooLarge, unzstd
        data = open(sys.argv[1], "rb").read()
        resource.setrlimit(resource.RLIMIT_DATA, (1 << 30, 1 << 30))
        try:
            unzstd(data)
        except TooLarge as error:
            print(error)
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(tmp_path / "packed")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "unpacks to more than 256 MiB, the limit\n", done.stderr


@pytest.mark.parametrize(
    ("unpacker", "packed"),
    [
        (unpack.unzstd, zstandard.ZstdCompressor().compress),
        (unpack.unlz4, lz4.frame.compress),
        (unpack.unbz2, bz2.compress),
    ],
)
def test_the_limit(
    unpacker: Callable[[bytes], bytes], packed: Callable[[bytes], bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unpack, "LIMIT_BYTES", 3 << 20)
    for size in (0, 1, 1 << 20, 3 << 20):
        assert unpacker(packed(bytes(size))) == bytes(size)
    with pytest.raises(unpack.TooLarge):
        unpacker(packed(bytes((3 << 20) + 1)))
    with pytest.raises((EOFError, zstandard.ZstdError)):
        unpacker(packed(bytes(range(256)))[:-20])


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_a_chunk_that_is_too_large(
    compression: CompressionType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = [(START + i, "/level", number(i)) for i in range(20)]
    bag = write_mcap(tmp_path / "bag.mcap", messages, compression, 1 << 20)
    assert read_all(bag) == (20, "")
    monkeypatch.setattr("simclient.bag.mcap_file.LIMIT_BYTES", 100)
    count, missing = read_all(bag)
    assert count == 0 and missing.startswith("bag.mcap lacks 100.000000000 s to 100.000000019 s, bytes ")
    assert missing.endswith(" (a chunk that unpacks to more than 256 MiB, the limit)")


@pytest.mark.parametrize("form", ["mcap-message", "sqlite3-message"])
def test_a_message_that_is_too_large_is_empty(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = write(tmp_path / "bag", CONTENT, form)
    monkeypatch.setattr(unpack, "LIMIT_BYTES", 100)
    assert read_all(bag) == (20, "")  # all but that of the IMU


def test_large_messages_come_in_several_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = write(tmp_path / "bag", CONTENT, "sqlite3-message")
    monkeypatch.setattr("simclient.bag.packed._BATCH_BYTES", 30)
    assert max(len(batch.entries) for batch, _ in open_bag(bag).batches()) == 3
    assert read_all(bag) == (21, "")


@pytest.mark.parametrize("form", ["ros1-bz2", "ros1-lz4"])
def test_a_chunk_of_ros1_that_is_too_large(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = write(tmp_path / "bag", CONTENT, form)
    monkeypatch.setattr(unpack, "LIMIT_BYTES", 100)
    count, missing = read_all(bag)
    assert count == 0 and missing.startswith("bag.bag lacks bytes ")
    assert missing.endswith(" (a chunk that unpacks to more than 256 MiB, the limit)")


def test_a_file_that_does_not_fit_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = write(tmp_path / "bag", CONTENT, "mcap-file")
    assert read_all(bag) == (21, "")
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 2000}))
    with pytest.raises(BagError, match=r"mcap\.zstd: unpacks to more than 0 MiB.* set TMPDIR to a larger disk"):
        open_bag(bag)


@pytest.mark.parametrize("value", ["abc", 1e300, b"", None, -(2**63)])
@pytest.mark.parametrize("column", ["timestamp", "topic_id", "data"])
def test_values_of_no_sense_in_sqlite(column: str, value: object, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", CONTENT, "sqlite3")
    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("CREATE TABLE anything AS SELECT * FROM messages")
        database.execute("DROP TABLE messages")
        database.execute("ALTER TABLE anything RENAME TO messages")
        database.execute(f"UPDATE messages SET {column} = ? WHERE id = 7", (value,))
    database.close()
    count, missing = read_all(bag)
    assert count >= 20 or missing.startswith("bag.db3 breaks off after 0 messages (")


def test_topics_of_no_sense_in_sqlite(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", CONTENT, "sqlite3")
    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("CREATE TABLE anything AS SELECT * FROM topics")
        database.execute("DROP TABLE topics")
        database.execute("ALTER TABLE anything RENAME TO topics")
        database.execute("UPDATE topics SET id = 1e999")
    database.close()
    with pytest.raises(BagError, match="not an sqlite3 bag, or a damaged one"):
        open_bag(bag)


def aliases(name: str, item: str, joined: str) -> str:
    """A list of nine of a list of nine of …, ten deep, as the value of `name`."""
    lines = [f"x0: &x0 {item}"]
    lines += [f"x{i + 1}: &x{i + 1} {joined.format(', '.join([f'*x{i}'] * 9))}" for i in range(10)]
    return "\n".join([*lines, f"rosbag2_bagfile_information: {{{name}: *x10}}"])


@pytest.mark.parametrize(
    "text",
    [
        "a: " + "[" * 3000,
        "a: 2024-99-99",
        "a: " + "1:" * 400 + "1.0",
        "rosbag2_bagfile_information: {compression_mode: message}\n#" + "x" * (1 << 20),
        aliases("compression_mode", "[message]", "[{}]"),
        aliases("relative_file_paths", "[bag.mcap]", "[{}]"),
        aliases("compression_mode", "{a: 1}", "{{<<: [{}]}}"),
    ],
)
def test_metadata_of_no_sense_is_as_if_missing(text: str, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", CONTENT, "mcap")
    (bag / "metadata.yaml").write_text(text)
    begun = time.process_time()
    assert read_all(bag) == (21, "")
    assert time.process_time() - begun < 15


def test_a_definition_that_explodes(tmp_path: Path) -> None:
    line = "=" * 80
    text = f"B[100000] b\nfloat64 data\n{line}\nMSG: a_msgs/B\nC[100000] c\n{line}\nMSG: a_msgs/C\nuint8 d\n"
    bag = write_mcap(tmp_path / "bag.mcap", [(START, "/level", (b"\0\1\0\0", "a_msgs/msg/A", text))])
    begun = time.process_time()
    definitions = definitions_of(open_bag(bag).store("/level").fielddefs)
    with pytest.raises(MapError, match="has too many parts"):
        Reader(definitions, "a_msgs/msg/A", [Pick(name="level", fields=("data",), type="f64", count=1)])
    assert time.process_time() - begun < 15


def test_a_layout_that_explodes(tmp_path: Path) -> None:
    """Messages of up to 2^18 members have a fixed layout, larger ones none: in no time, and no memory."""
    line = "=" * 80
    for count, fits in ((511, True), (513, False), (100000, False)):
        text = f"B[{count}] b\n{line}\nMSG: a_msgs/B\nC[170] c\n{line}\nMSG: a_msgs/C\nuint8 d\nuint8 e\n"
        bag = write_mcap(tmp_path / f"{count}.mcap", [(START, "/level", (b"\0\1\0\0", "a_msgs/msg/A", text))])
        begun = time.process_time()
        layout = open_bag(bag).layout("/level")
        assert (layout is not None) == fits
        assert layout is None or len(layout.leaves) == layout.size - 4 == 2 * 170 * count
        assert time.process_time() - begun < 15


def test_a_definition_of_ros1_that_lacks_a_type(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", CONTENT, "ros1")
    bag.write_bytes(bag.read_bytes().replace(b"MSG: std_msgs/Header", b"MSG: std_msgs/Leader"))
    with pytest.raises(BagError, match="the definition of .* is not valid: .*std_msgs/msg/Header"):
        open_bag(bag)
