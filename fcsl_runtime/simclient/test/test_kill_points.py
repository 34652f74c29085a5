# SPDX-License-Identifier: Apache-2.0
"""Killed before any of its system calls, a writer leaves the old file or the new one: checkpoints, last states, bags."""

from __future__ import annotations

import functools
import io
import json
import os
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from kill_points import CannotTrace, calls_until_killed
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from native import FIXTURE, GYRO, PROGRAM, Run

OLD = b'{"old": true}'


@pytest.fixture(autouse=True)
def _needs_ptrace() -> None:
    try:
        calls_until_killed(1, lambda: None)
    except CannotTrace:
        pytest.skip("this system does not let a process trace its child")


def survivors(path: Path, action: Callable[[], Any]) -> list[bytes | None]:
    """What `path`, which held OLD, holds after a kill before each call of `action`, and after none; None: nothing."""
    found: list[bytes | None] = []
    call = 1
    while True:
        path.write_bytes(OLD)
        began = calls_until_killed(call, action)
        found.append(path.read_bytes() if path.exists() else None)
        if began < call:
            return found
        call += 1


def changes(found: list[Any]) -> list[Any]:
    """Each of what followed upon another."""
    return [one for n, one in enumerate(found) if n == 0 or found[n - 1] != one]


def test_a_checkpoint_is_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    run, path = Run(), tmp_path / "checkpoint"
    run.set(GYRO, struct.pack("<d", 0.5))
    run.step(3)
    run.save_file(path)
    new = path.read_bytes()
    found = survivors(path, lambda: run.save_file(path))
    assert changes(found) == [OLD, new] and len(found) > 8  # open, write, fsync, close, rename, and the folder
    assert found.count(new) > 2  # the folder is brought to the disk behind the rename
    run.save_file(path)
    assert os.listdir(tmp_path) == ["checkpoint"]  # what the kills left is gone


def in_place(path: Path) -> None:
    path.write_bytes(b"new")


def removed_before(path: Path) -> None:
    path.with_suffix(".tmp").write_bytes(b"new")
    path.unlink()
    path.with_suffix(".tmp").rename(path)


@pytest.mark.parametrize(("write", "left"), [(in_place, b""), (removed_before, None)])
def test_a_writer_that_is_not_atomic_is_found(
    write: Callable[[Path], None], left: bytes | None, tmp_path: Path
) -> None:
    """The control."""
    path = tmp_path / "file"
    assert changes(survivors(path, lambda: write(path))) == [OLD, left, b"new"]


def executed(program: str, *arguments: str | Path) -> None:
    """Becomes the program, which says nothing. Without an environment the loader looks for libraries in few places."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.execve(program, [program, *map(str, arguments)], {})


def test_the_control_holds_for_programs(tmp_path: Path) -> None:
    copy = shutil.which("cp")
    assert copy
    (tmp_path / "new").write_bytes(b"new")
    found = survivors(tmp_path / "file", lambda: executed(copy, tmp_path / "new", tmp_path / "file"))
    assert changes(found) == [OLD, b"", b"new"]


def test_the_last_state_is_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    """Of the flight program, with all its threads."""
    path = tmp_path / "last"
    found = survivors(path, lambda: executed(PROGRAM, FIXTURE, "--ticks", "3", "--rate", "max", "--summary", path))
    read = [json.loads(one) if one is not None else {} for one in found]
    assert read[0] == {"old": True} and read[-1]["tick"] == 3
    assert all(one == {"old": True} or one["tick"] == 3 and one["ended"] for one in read)


def test_a_token_is_whole_or_not_there(tmp_path: Path) -> None:
    token = tmp_path / "token"
    line = (PROGRAM, FIXTURE, "--socket", "tcp:127.0.0.1:0", "--token", token, "--ticks", "1", "--rate", "max")
    found: list[int] = []  # its length; -1: there is none
    while True:
        token.unlink(missing_ok=True)
        began = calls_until_killed(len(found) + 1, lambda: executed(*line))
        found.append(len(token.read_text().strip()) if token.exists() else -1)
        if began < len(found):
            break
    assert changes(found) == [-1, 48]
    token.unlink()
    subprocess.run(line, check=True, capture_output=True)  # what the kills left beside it is not in the way
    assert len(token.read_text().strip()) == 48


@functools.cache
def messages_in(content: bytes) -> int:
    """What a reader finds that goes through a file from its start, and one that begins at its end. Raises what they raise."""
    records = [type(record).__name__ for record in StreamReader(io.BytesIO(content), validate_crcs=True).records]
    assert records[-1] == "Footer"
    seeking = make_reader(io.BytesIO(content), validate_crcs=True).iter_messages(log_time_order=False)
    assert records.count("Message") == sum(1 for _ in seeking)
    return records.count("Message")


def described(bag: Path, messages: int) -> None:
    """metadata.yaml is there with the bag: it gives times and qualities of service, and no messages that are not there."""
    told = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert told["version"] == 9 and told["message_count"] <= messages
    assert told["starting_time"]["nanoseconds_since_epoch"] == 0 <= told["duration"]["nanoseconds"] <= 15 * 10**9
    topics = told["topics_with_message_count"]
    assert len(topics) > 6 and all(topic["topic_metadata"]["offered_qos_profiles"] for topic in topics)


def bags_left(bag: Path, action: Callable[[], Any]) -> list[int]:
    """Messages in the bag after a kill before each call, and after none; -1: it has no file yet."""
    found: list[int] = []
    while True:
        shutil.rmtree(bag, ignore_errors=True)
        began = calls_until_killed(len(found) + 1, action)
        found.append(messages_in((bag / f"{bag.name}_0.mcap").read_bytes()) if bag.exists() else -1)
        if found[-1] >= 0:
            described(bag, found[-1])
        if began < len(found):
            return found


def test_a_bag_opens_whenever_its_writer_was_killed(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    flight = ("--ticks", "1500", "--rate", "max", "--record", bag)
    found = bags_left(bag, lambda: executed(PROGRAM, FIXTURE, *flight))
    assert found[0] == -1 and found[-1] > 1500 * 2
    # Nothing, a recording that is empty, several chunks, all. Threads begin at the same call only about.
    assert {-1, 0, found[-1]} < set(found) and found.count(found[-1]) > 3


def test_a_recording_without_an_end_is_found(tmp_path: Path) -> None:
    """The control: the same content, but what is not yet written is not there, as a file has it that merely grows."""
    bag = tmp_path / "bag"
    subprocess.run(
        [PROGRAM, FIXTURE, "--ticks", "9", "--rate", "max", "--record", bag], check=True, capture_output=True
    )
    content = (bag / "bag_0.mcap").read_bytes()
    metadata = (bag / "metadata.yaml").read_bytes()

    def grow() -> None:
        made = tmp_path / "made"
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir()
        (made / "metadata.yaml").write_bytes(metadata)
        with (made / "bag_0.mcap").open("wb", buffering=0) as file:
            made.rename(bag)
            for begin in range(0, len(content), 1000):
                file.write(content[begin : begin + 1000])

    with pytest.raises((McapError, struct.error)):
        bags_left(bag, grow)
