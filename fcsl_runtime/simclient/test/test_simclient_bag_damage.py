# SPDX-License-Identifier: Apache-2.0
"""What the tools tell of bags with flipped bits, lost chunks and chunks that unpack to gigabytes."""

from __future__ import annotations

import os
import re
import resource
import subprocess
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from foreign_bags import number, write_mcap
from mcap.reader import make_reader
from mcap.writer import CompressionType

from simclient import AlgTwin, BagError
from simclient.bag import Bag
from simclient.bag.diff import diff
from simclient.bag.export import select, write
from simclient.bag.formats import open_bag
from simclient.bag.info import describe
from simclient.bag.mcap_file import read_summary
from simclient.replay import replay
from simclient.view.recorded import RecordedRun

START = 100 * 10**9


def small(path: Path) -> Path:
    """One topic of few bytes: a chunk of message 0, one of 1 and 2, and so on up to message 19."""
    messages = [(START + i * 10**9, "/level", number(i)) for i in range(20)]
    return write_mcap(path, messages, CompressionType.ZSTD, 50)


def index_of(file: Path) -> Any:
    summary = make_reader(BytesIO(file.read_bytes())).get_summary()
    assert summary is not None
    return summary


def summary_begin(content: bytes) -> int:
    return int.from_bytes(content[-8 - 20 : -8 - 12], "little")


def flipped(content: bytes, bit: int) -> bytes:
    damaged = bytearray(content)
    damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


def outcome(tool: Callable[[], object]) -> str:
    try:
        return str(tool())
    except BagError as error:
        return f"error: {error}"


def test_every_bit_of_a_summary(tmp_path: Path) -> None:
    """What is left without the index is all the content, so that is told, and that the index is damaged."""
    file = write_mcap(tmp_path / "a.mcap", [(START, "/level", number(1))], CompressionType.ZSTD)
    content = file.read_bytes()
    whole = describe(open_bag(file))
    truth = whole.replace("damage     none", "damage     a.mcap has a damaged summary; its 1 messages are there")
    for bit in range(summary_begin(content) * 8, len(content) * 8):
        file.write_bytes(flipped(content, bit))
        if read_summary(file) is not None or bit % 5 == 0:
            assert outcome(lambda: describe(open_bag(file))) in (whole, truth), bit


def test_bits_of_a_recordings_summary_in_all_tools(probe: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run")
        twin.tick(3)
    bag, file = tmp_path / "run", tmp_path / "run/run_0.mcap"
    content = file.read_bytes()
    intact = tmp_path / "intact.mcap"
    intact.write_bytes(content)
    tools: list[Callable[[], object]] = [
        lambda: describe(open_bag(bag)),
        lambda: write(select(open_bag(bag), (), ""), str(tmp_path / "out.csv")),
        lambda: diff(open_bag(bag), open_bag(intact)),
        lambda: (run := RecordedRun(Bag(bag))).read(run.catalogue.values.values()),
        lambda: replay(bag, library=str(probe)),
    ]
    first = summary_begin(content) * 8
    for bit in range(first, len(content) * 8):
        if bit % 4001:
            continue
        file.write_bytes(flipped(content, bit))
        for tool in tools:
            outcome(tool)
    for bit in range(first, len(content) * 8 - 64, 11):  # but for the magic behind it, no bit of it is left unchecked
        file.write_bytes(flipped(content, bit))
        assert read_summary(file) is None, bit


def test_what_is_behind_a_bad_chunk_is_read(tmp_path: Path) -> None:
    file = small(tmp_path / "a.mcap")
    content = bytearray(file.read_bytes())
    chunk = index_of(file).chunk_indexes[4]
    content[chunk.chunk_start_offset + chunk.chunk_length - 3] ^= 1
    file.write_bytes(content)
    bag = open_bag(file)
    assert [(t - START) // 10**9 for _, t, _ in bag.messages()] == [*range(7), *range(9, 20)]
    begin, end = chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length
    expected = f"a.mcap lacks 107.000000000 s to 108.000000000 s, bytes {begin} to {end} (a damaged chunk)"
    assert bag.truncated == expected and expected in describe(bag)
    assert [(t - START) // 10**9 for _, t, _ in bag.messages_before_damage()] == [*range(7)]


def test_what_is_behind_bytes_without_sense_is_read(tmp_path: Path) -> None:
    file = small(tmp_path / "a.mcap")
    content = bytearray(file.read_bytes())
    chunk, behind = (index_of(file).chunk_indexes[n] for n in (4, 6))
    content[chunk.chunk_start_offset : behind.chunk_start_offset] = bytes(
        behind.chunk_start_offset - chunk.chunk_start_offset
    )
    file.write_bytes(content)
    bag = open_bag(file)
    assert [(t - START) // 10**9 for _, t, _ in bag.messages()] == [*range(7), *range(11, 20)]
    span = f"bytes {chunk.chunk_start_offset} to {behind.chunk_start_offset} (no record of MCAP)"
    assert bag.truncated == f"a.mcap lacks {span}"


def test_definitions_of_a_bad_first_chunk_come_from_the_index(tmp_path: Path) -> None:
    file = small(tmp_path / "a.mcap")
    content = bytearray(file.read_bytes())
    first = index_of(file).chunk_indexes[0]
    content[first.chunk_start_offset + first.chunk_length - 3] ^= 1
    file.write_bytes(content)
    assert len(list(open_bag(file).messages())) == 19


def test_messages_whose_definition_is_lost_are_counted(tmp_path: Path) -> None:
    file = small(tmp_path / "a.mcap")
    content = bytearray(file.read_bytes())
    first = index_of(file).chunk_indexes[0]
    content[first.chunk_start_offset + first.chunk_length - 3] ^= 1
    file.write_bytes(content[: summary_begin(bytes(content))])  # the index has the definitions, too
    bag = open_bag(file)
    assert list(bag.messages()) == []
    assert "a.mcap has 19 messages of topics whose definitions are lost" in bag.truncated.replace(
        "; has", "; a.mcap has"
    )


def test_a_bad_file_does_not_cost_the_next(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    one, two = (small(tmp_path / f"run/run_{n}.mcap") for n in range(2))
    one.write_bytes(one.read_bytes()[:600])
    bag = open_bag(tmp_path / "run")
    assert len(list(bag.messages())) > 20
    assert bag.truncated.startswith("run_0.mcap breaks off after ") and "run_1" not in bag.truncated
    assert len(list(bag.messages_before_damage())) < 20


def test_a_replay_ends_where_messages_are_missing(probe: Path, tmp_path: Path) -> None:
    """What the host wrote may be among them, so that going on would show differences that are none."""
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run")
        for _ in range(30):
            twin.tick(1000)
    file = tmp_path / "run/run_0.mcap"
    content = bytearray(file.read_bytes())
    chunk = index_of(file).chunk_indexes[2]
    content[chunk.chunk_start_offset + chunk.chunk_length - 3] ^= 1
    file.write_bytes(content)
    verdict = replay(tmp_path / "run", library=str(probe))
    assert verdict.divergence is None and 0 < verdict.ticks < 30000 and not verdict.identical
    assert "the bag is incomplete: run_0.mcap lacks " in str(verdict)


def test_a_file_of_chunks_that_unpack_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simclient.bag.mcap_file._FREE_BYTES", 0)
    monkeypatch.setattr("simclient.bag.mcap_file._RATIO", 0)
    bag = open_bag(small(tmp_path / "a.mcap"))
    assert not list(bag.messages())
    assert "(a chunk that takes the file beyond 0 GiB and 0 times its size when unpacked)" in bag.truncated
    assert "; and 8 more parts, " in bag.truncated


def test_a_chunk_may_unpack_to_the_limit_and_not_to_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = small(tmp_path / "a.mcap")
    largest = max(chunk.uncompressed_size for chunk in index_of(file).chunk_indexes)
    monkeypatch.setattr("simclient.bag.mcap_file.LIMIT_BYTES", largest)
    assert len(list(open_bag(file).messages())) == 20
    monkeypatch.setattr("simclient.bag.mcap_file.LIMIT_BYTES", largest - 1)
    assert len(list(open_bag(file).messages())) < 20


def bomb(bag: Path, chunks: int) -> Path:
    """Chunks of 250 MB of records without content, in some KB each."""
    import zstandard

    packer = zstandard.ZstdCompressor(level=1)
    packed = packer.compress(bytes(249_999_993))
    head = bytes(16) + (249_999_993).to_bytes(8, "little") + bytes(4) + b"\x04\0\0\0zstd"
    body = head + len(packed).to_bytes(8, "little") + packed
    chunk = b"\x06" + len(body).to_bytes(8, "little") + body
    end = b"\x0f\x04" + bytes(11) + b"\x02\x14" + bytes(27) + b"\x89MCAP0\r\n"
    bag.write_bytes(b"\x89MCAP0\r\n" + chunk * chunks + end)
    return bag


def test_a_bomb_takes_seconds(tmp_path: Path) -> None:
    """60 GB in less than 2 MB."""
    bag = bomb(tmp_path / "bomb.mcap", 240)
    assert bag.stat().st_size < 2_000_000
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(["fcsl", "bag", "info", str(bag)], capture_output=True, text=True, env=os.environ)
    assert done.returncode == 1 and "takes the file beyond 1 GiB and 1000 times its size" in done.stdout
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime < 120


def test_reading_for_long_shows_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("simclient.cli._PROGRESS_PERIOD_S", 0.0)
    describe(Bag(bomb(tmp_path / "bomb.mcap", 3)))
    assert re.search(r"^reading bomb.mcap: \d+ % \(\d+ of \d+\)$", capsys.readouterr().err, re.MULTILINE)
