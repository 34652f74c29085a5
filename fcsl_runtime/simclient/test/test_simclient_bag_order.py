# SPDX-License-Identifier: Apache-2.0
"""Messages come in the order of their log times, in whatever order the files of a bag have them."""

from __future__ import annotations

import random
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import MS, imu, make, number, split, write_as_given, write_mcap
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType

from simclient import AlgTwin, BagError
from simclient.bag import Bag, columns
from simclient.bag.digest import digest
from simclient.bag.formats import open_bag
from simclient.bag.info import describe
from simclient.replay import replay_foreign

START = 100 * 10**9
MAP = """\
channels:
  imu.gyro: {topic: /imu, field: angular_velocity}
  level: {topic: /level, field: data}
"""
#: A message: log time in ms, what its stamp lies behind that in ms, value; of /imu, or of /level, which has no stamp.
MESSAGES = st.lists(
    st.tuples(st.integers(0, 60), st.integers(0, 20), st.integers(0, 5), st.booleans()), min_size=1, max_size=24
)
Given = Sequence[tuple[int, int, int, bool]]
Made = list[tuple[int, str, Any]]


def made(given: Given) -> Made:
    """The first message of both topics makes any content usable."""
    found: Made = [(START, "/imu", imu(START)), (START, "/level", number(0))]
    for at_ms, behind_ms, value, is_imu in given:
        log_ns = START + at_ms * 100 * MS
        stamp_ns = log_ns - behind_ms * 100 * MS
        found.append((log_ns, *(("/imu", imu(stamp_ns, (value, 0, 0))) if is_imu else ("/level", number(value)))))
    return found


def write_in(form: str, path: Path, messages: Made) -> Path:
    if form == "chunks":
        return write_mcap(path.with_suffix(".mcap"), messages, CompressionType.ZSTD, 700)
    if form == "no chunks":
        return write_mcap(path.with_suffix(".mcap"), messages, chunk_bytes=0)
    return write_as_given(path, messages, form)


@pytest.mark.parametrize("form", ["chunks", "no chunks", "sqlite3", "sqlite3-message", "ros1", "ros1-bz2"])
def test_a_permuted_bag_gives_the_run_of_the_sorted_one(form: str, probe: Path, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    numbers = count()

    @settings(max_examples=12, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(given=MESSAGES, seed=st.integers(0, 1000))
    def check(given: Given, seed: int) -> None:
        messages = sorted(made(given), key=lambda message: message[0])
        permuted = random.Random(seed).sample(messages, len(messages))
        name = tmp_path / str(next(numbers))
        runs = [
            replay_foreign(bag, tmp_path / "map.yaml", library=str(probe), output=bag.with_suffix(".out"))
            for bag in (write_mcap(name.with_suffix(".sorted.mcap"), messages), write_in(form, name, permuted))
        ]
        assert str(runs[1]) == str(runs[0])  # the digest, and what became of each message

    check()


@pytest.mark.parametrize("form", ["chunks", "sqlite3"])
def test_a_topic_has_the_type_of_most_of_its_messages(form: str, tmp_path: Path) -> None:
    other = [(START + i * MS, "/level", imu(START + i * MS)) for i in range(3)]
    most = [(START + i * MS, "/level", number(i)) for i in range(5)]
    for name, messages in (("first", other + most), ("last", most + other)):
        topic = open_bag(write_in(form, tmp_path / name, messages)).topics["/level"]
        assert (topic.type, topic.count) == ("std_msgs/msg/Float64", 8)


def ramp(begin: int = 0, end: int = 120) -> Made:
    times = [(i, START + i * 25 * MS) for i in range(begin, end)]
    return [(time_ns, "/imu", imu(time_ns, (i, 0, 0))) for i, time_ns in times]


def seen(bag: Path) -> list[int]:
    return [int(x) for x in columns(open_bag(bag), "/imu:angular_velocity.x")[1]]


@pytest.mark.parametrize("form", ["mcap", "sqlite3", "ros1"])
def test_later_messages_first(form: str, tmp_path: Path) -> None:
    """As a merge of two files leaves them."""
    assert seen(write_as_given(tmp_path / "bag", ramp(60) + ramp(0, 60), form)) == list(range(120))


def test_files_in_another_order(tmp_path: Path) -> None:
    parts = {"a": ramp(80), "b": ramp(20, 80), "c": ramp(0, 40)}
    bag = split(tmp_path / "bag", {name: {"/imu": [(t, m) for t, _, m in part]} for name, part in parts.items()})
    assert seen(bag) == sorted([*range(120), *range(20, 40)])


def test_channels_of_several_files_keep_their_topics(tmp_path: Path) -> None:
    """Both files number their only topic alike."""
    parts: dict[str, Any] = {
        "a": {"/level": [(START + i * 20 * MS, number(i)) for i in range(9)]},
        "b": {"/other": [(START + i * 20 * MS + 1, number(-i)) for i in range(9)]},
    }
    bag = open_bag(split(tmp_path / "bag", parts))
    found = [(topic, log_ns) for topic, log_ns, _ in bag.messages()]
    assert found == sorted(found, key=lambda entry: entry[1]) and len({*found}) == 18
    assert [topic for topic, _ in found] == ["/level", "/other"] * 9


def test_chunks_are_not_all_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simclient.bag.time_order.HELD_BYTES_MAX", 8000)
    backwards = [message for begin in range(100, -1, -20) for message in ramp(begin, begin + 20)]
    assert seen(write_mcap(tmp_path / "backwards.mcap", backwards)) == list(range(120))
    shuffled = random.Random(1).sample(ramp(), 120)
    with pytest.raises(BagError, match=r"shuffled\.mcap: its messages are not in the order of time.*`mcap sort`"):
        seen(write_mcap(tmp_path / "shuffled.mcap", shuffled))
    assert "messages   120" in describe(open_bag(tmp_path / "shuffled.mcap"))


def test_of_chunks_that_overlap_only_what_is_wanted_is_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = make("sensor_msgs/msg/Image", data=np.zeros(5000, np.uint8))
    messages = ramp() + [(START + i * 25 * MS, "/image", image) for i in range(120)]
    bag = write_mcap(tmp_path / "bag.mcap", random.Random(1).sample(messages, len(messages)), chunk_bytes=20_000)
    monkeypatch.setattr("simclient.bag.time_order.HELD_BYTES_MAX", 120_000)
    assert seen(bag) == list(range(120))
    with pytest.raises(BagError, match="not in the order of time"):
        list(open_bag(bag).messages())


def test_a_chunk_that_gives_a_wrong_time_is_told(tmp_path: Path) -> None:
    bag = write_mcap(tmp_path / "bag.mcap", ramp())
    data = bytearray(bag.read_bytes())
    with bag.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    at = summary.chunk_indexes[1].chunk_start_offset + 9  # behind opcode and length
    data[at : at + 16] = (START + 10**12).to_bytes(8, "little") * 2
    bag.write_bytes(data)
    opened = open_bag(bag)
    assert sum(1 for _ in opened.messages()) == 120
    assert "messages of before the first time of their chunk" in opened.truncated


def test_a_record_of_a_machine_keeps_the_order_of_its_file(probe: Path, tmp_path: Path) -> None:
    """Its clock may have been set back, its ticks were not."""
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run")
        twin.tick(9)
    bag, kept = Bag(tmp_path / "run"), tmp_path / "kept.mcap"
    messages = [
        (10**9 * (5 - n // 50), topic, (data, bag.topics[topic].type, bag.topics[topic].schema))
        for n, (topic, _, data) in enumerate(bag.messages())
    ]
    write_mcap(kept, messages)
    assert digest(Bag(kept)) == digest(bag)
