# SPDX-License-Identifier: Apache-2.0
"""The same messages in a bag of any format give the same run; what is damaged or missing in one is said."""

from __future__ import annotations

import random
import re
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from foreign_bags import (
    FORMATS,
    MS,
    ROS2_FORMATS,
    STORE,
    Content,
    encoded,
    imu,
    in_order,
    make,
    number,
    split,
    write,
    write_mcap,
)
from mcap.writer import CompressionType

from simclient import BagError, MapError
from simclient.bag.digest import digest
from simclient.bag.formats import open_bag
from simclient.bag.ros1_file import Ros1File
from simclient.replay import replay_foreign
from simclient.replay.foreign import ForeignRun

START = 100 * 10**9
MAP = """\
time: log
channels:
  imu.gyro: {topic: /imu, field: angular_velocity}
  imu.attitude: {topic: /imu, field: orientation}
  level: {topic: /level, field: data}
"""


def content(begin: int = 0, end: int = 60) -> dict[str, list[tuple[int, object]]]:
    """/imu at 50 Hz, /level at 10 Hz, from message `begin` to before `end` of /imu."""
    times = [(i, START + 20 * i * MS) for i in range(begin, end)]
    return {
        "/imu": [(time_ns, imu(time_ns, (i, 0.5 * i, -i))) for i, time_ns in times],
        "/level": [(time_ns, number(i)) for i, time_ns in times if i % 5 == 0],
    }


Runs = Callable[[Path], ForeignRun]


@pytest.fixture
def run(probe: Path, tmp_path: Path) -> Runs:
    """Runs the probe on a bag as MAP says."""
    (tmp_path / "map.yaml").write_text(MAP)
    numbers = iter(range(100))

    def of(bag: Path) -> ForeignRun:
        output = tmp_path / f"out{next(numbers)}"
        done = replay_foreign(bag, tmp_path / "map.yaml", library=str(probe), output=output)
        assert done.digest == digest(output)
        return done

    return of


@pytest.fixture
def wanted(run: Runs, tmp_path: Path) -> str:
    """The digest of the run on an MCAP bag."""
    done = run(write(tmp_path / "reference", content()))
    assert [fate.coverage.used for fate in done.fates.values()] == [60, 60, 12]
    return done.digest


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_gives_the_same_run(form: str, run: Runs, wanted: str, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", content(), form)
    first = run(bag)
    assert first.digest == wanted and not first.truncated and not first.notes
    assert run(bag).digest == wanted
    if bag.is_dir():
        file = next(file for file in bag.iterdir() if file.name != "metadata.yaml")
        assert run(file).digest == wanted
        (bag / "metadata.yaml").unlink()
        if not form.endswith("-message"):
            assert run(bag).digest == wanted


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
@pytest.mark.parametrize("chunk_bytes", [0, 500, 1 << 20])
def test_chunks_of_mcap(compression: CompressionType, chunk_bytes: int, run: Runs, wanted: str, tmp_path: Path) -> None:
    file = write_mcap(tmp_path / "bag.mcap", in_order(content()), compression, chunk_bytes)
    assert run(file).digest == wanted


@pytest.mark.parametrize("form", ROS2_FORMATS)
def test_split_bags_are_read_in_the_order_of_the_metadata(form: str, run: Runs, wanted: str, tmp_path: Path) -> None:
    parts = {"run_9": content(0, 30), "run_10": content(30, 60)}
    bag = split(tmp_path / "bag", parts, form)
    if form.endswith("-message"):
        metadata = yaml.safe_load((bag / "metadata.yaml").read_text())
        metadata["rosbag2_bagfile_information"]["compression_mode"] = "MESSAGE"
        (bag / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    done = run(bag)
    assert done.digest == wanted and done.fates["imu.gyro"].messages == 60
    if not form.endswith("-message"):
        (bag / "metadata.yaml").unlink()
        assert run(bag).digest == wanted


def test_ros1_bags_in_a_directory_are_one(run: Runs, wanted: str, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    write(tmp_path / "bag/run_0", content(0, 30), "ros1")
    write(tmp_path / "bag/run_1", content(30, 60), "ros1-bz2")
    assert run(tmp_path / "bag").digest == wanted


def test_how_a_bag_interleaves_its_topics_does_not_matter(run: Runs, wanted: str, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", dict(reversed(content().items())), ordered=False)
    assert run(bag).digest == wanted


def _without_definitions(bag: Path) -> Path:
    database = sqlite3.connect(next(bag.glob("*.db3")))
    database.execute("DROP TABLE message_definitions")
    database.commit()
    database.close()
    return bag


def test_definitions_that_a_bag_lacks_are_said(run: Runs, wanted: str, tmp_path: Path) -> None:
    done = run(_without_definitions(write(tmp_path / "bag", content(), "sqlite3")))
    assert done.digest == wanted
    note = "the bag does not define its types; ROS 2 Jazzy's are taken for sensor_msgs/msg/Imu, std_msgs/msg/Float64"
    assert done.notes == (note,) and f"note: {note}" in str(done)


def test_a_topic_that_changes_its_type(run: Runs, tmp_path: Path) -> None:
    others: Content = {"/level": [(START + 7 * MS, make("std_msgs/msg/Int32", data=99))]}
    mixed = sorted([*in_order(content()), *in_order(others)], key=lambda entry: entry[0])
    done = run(write_mcap(tmp_path / "bag.mcap", mixed))
    assert done.fates["level"].refused == {"type": (1, 1)} and done.fates["level"].coverage.used == 12
    assert "level: refused: 1 of another type than most of the topic's (first: message 1)" in str(done)


def test_definitions_that_differ_in_comments_are_one(run: Runs, wanted: str, tmp_path: Path) -> None:
    """Files of two distributions, merged."""

    def with_comments(message: object) -> object:
        data, kind, text = encoded(message)
        lines = [
            line if line.startswith(("=", "MSG:")) else f"  {line}   # {n}" for n, line in enumerate(text.splitlines())
        ]
        return data, kind, "# ours\n\n" + "\n".join(lines)

    messages = [(at, topic, with_comments(m) if n % 2 else m) for n, (at, topic, m) in enumerate(in_order(content()))]
    assert run(write_mcap(tmp_path / "bag.mcap", messages)).digest == wanted
    swapped = [(at, topic, m if n % 2 else with_comments(m)) for n, (at, topic, m) in enumerate(in_order(content()))]
    assert run(write_mcap(tmp_path / "swapped.mcap", swapped)).digest == wanted


def test_a_type_of_ones_own(run: Runs, wanted: str, tmp_path: Path) -> None:
    """The definition in the bag counts, not the name of the type."""
    text = "string why\nfloat64 data\n"

    def level(value: float) -> tuple[bytes, str, str]:
        return b"\0\1\0\0" + struct.pack("<I4sd", 4, b"own\0", value), "mine/msg/Level", text

    messages = [
        (time_ns, topic, level(message.data) if topic == "/level" else message)
        for time_ns, topic, message in in_order(content())
    ]
    assert run(write_mcap(tmp_path / "bag.mcap", messages)).digest == wanted


def long(count: int) -> dict[str, list[tuple[int, object]]]:
    """More than one chunk of ROS 1."""
    times = [START + i * MS for i in range(count)]
    return {
        "/imu": [(time_ns, imu(time_ns, (i, 0, 0))) for i, time_ns in enumerate(times)],
        "/level": [(START, number(0))],
    }


@pytest.mark.parametrize("form", ["sqlite3", "sqlite3-message", "ros1", "ros1-bz2", "ros1-lz4"])
def test_a_bag_that_is_cut_off_runs_as_far_as_it_goes(form: str, run: Runs, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", long(9000), form)
    file = bag if bag.is_file() else next(bag.glob("*.db3"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 6 // 10])
    done = run(bag)
    assert 2000 < done.fates["imu.gyro"].messages < 6500 and not done.fates["imu.gyro"].refused
    assert file.name in done.truncated


@pytest.mark.parametrize("form", ["ros1", "ros1-lz4"])
def test_a_bag_of_ros1_that_ends_within_its_first_chunk(form: str, run: Runs, tmp_path: Path) -> None:
    """Of bz2 a part of a chunk is lost, because it unpacks nothing of a block of 900 kB before its end."""
    bag = write(tmp_path / "bag", long(9000), form)
    first = Ros1File(bag).pieces[0]
    bag.write_bytes(bag.read_bytes()[: first.begin + (first.end - first.begin) * 19 // 20])
    done = run(bag)
    assert 1500 < done.fates["imu.gyro"].messages < 3000 and not done.fates["imu.gyro"].refused
    assert re.fullmatch(r"bag\.bag breaks off after [0-9]+ messages", done.truncated)


def test_a_bag_of_ros1_that_was_not_closed(run: Runs, tmp_path: Path) -> None:
    """The recorder was killed: the header names no index, and the last chunk has no length yet."""
    bag, active = write(tmp_path / "bag", long(9000), "ros1"), tmp_path / "bag.bag.active"
    data, last = bytearray(bag.read_bytes()), Ros1File(bag).pieces[-1]
    index = data.index(b"index_pos=") + len(b"index_pos=")
    data[index : index + 8] = bytes(8)
    data[last.begin - 4 : last.begin] = bytes(4)
    active.write_bytes(data[: last.end - 100])
    done = run(active)
    assert done.fates["imu.gyro"].messages > 8900
    assert done.truncated.startswith("bag.bag.active breaks off after 9000 messages")


@pytest.mark.parametrize("form", ["ros1", "ros1-bz2"])
def test_what_is_behind_a_bad_chunk_of_ros1_is_read(form: str, run: Runs, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", long(9000), form)
    data, first = bytearray(bag.read_bytes()), Ros1File(bag).pieces[0]
    data[first.begin : first.begin + 40] = b"\xff" * 40
    bag.write_bytes(data)
    done = run(bag)
    assert 1000 < done.fates["imu.gyro"].messages < 9000
    assert f"bag.bag lacks bytes {first.begin} to {first.end} (a damaged chunk)" in done.truncated


@pytest.mark.parametrize("form", ["sqlite3", "ros1", "ros1-lz4"])
def test_bags_that_break_off(form: str, run: Runs, wanted: str, tmp_path: Path) -> None:
    """Cut at any byte: a message that names the file, or what there is and that it is not all."""
    bag = write(tmp_path / "bag", content(), form)
    file = bag if bag.is_file() else next(bag.glob("*.db3"))
    whole = file.read_bytes()
    outcomes = set()
    for part in (0, 1, 20, len(whole) // 3, len(whole) // 2, len(whole) - 4096, len(whole) - 1):
        file.write_bytes(whole[:part])
        try:
            done = run(bag)
            assert done.truncated or done.digest == wanted
            outcomes.add("run")
        except ValueError as error:
            assert file.name in str(error) or "no topic" in str(error), error
            outcomes.add("refused")
    assert "refused" in outcomes


def test_messages_that_are_damaged_are_counted(run: Runs, tmp_path: Path) -> None:
    messages = in_order(content())
    whole = bytes(STORE.serialize_cdr(messages[0][2], "sensor_msgs/msg/Imu"))
    definition = STORE.generate_msgdef("sensor_msgs/msg/Imu", ros_version=2)[0]
    for i, data in {5: whole[:-30], 6: b"", 8: b"\0\0" + whole[2:]}.items():
        assert messages[i][1] == "/imu"
        messages[i] = (messages[i][0], "/imu", (data, "sensor_msgs/msg/Imu", definition))
    done = run(write_mcap(tmp_path / "bag.mcap", messages))
    for channel in ("imu.gyro", "imu.attitude"):
        assert {reason: count for reason, (count, _) in done.fates[channel].refused.items()} == {
            "encoding": 1,
            "truncated": 2,
        }
        assert done.fates[channel].coverage.used == 57


def test_damage_anywhere_is_a_message(probe: Path, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    files = []
    for form in FORMATS:
        bag = write(tmp_path / form, content(), form)
        files += [bag] if bag.is_file() else list(bag.iterdir())
    files.append(write_mcap(tmp_path / "loose.mcap", in_order(content()), chunk_bytes=0))
    files.append(write_mcap(tmp_path / "lz4.mcap", in_order(content()), CompressionType.LZ4))
    random_of, outcomes = random.Random(6), set()
    for file in files * 4:
        whole = file.read_bytes()
        damaged = bytearray(whole)
        if random_of.random() < 0.2:
            del damaged[random_of.randrange(len(whole)) :]
        for _ in range(random_of.choice((0, 1, 3, 50))):
            damaged[random_of.randrange(len(damaged))] = random_of.randrange(256)
        file.write_bytes(damaged)
        bag = file.parent if (file.parent / "metadata.yaml").is_file() else file
        try:
            replay_foreign(bag, tmp_path / "map.yaml", library=str(probe))
            outcomes.add("run")
        except (BagError, MapError):
            outcomes.add("refused")
        file.write_bytes(whole)
    assert outcomes == {"run", "refused"}


def test_what_is_no_bag(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.db3").write_text("hello")
    (tmp_path / "text.bag").write_text("hello")
    (tmp_path / "text.mcap.zstd").write_text("hello")
    (tmp_path / "text.txt").write_text("hello")
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    (mixed / "a.mcap").touch()
    (mixed / "b.db3").touch()
    for name, reason in {
        "absent": "no such bag",
        "empty": "not a bag",
        "text.db3": "not an sqlite3 bag",
        "text.bag": "not a ROS 1 bag",
        "text.mcap.zstd": "not a zstd file",
        "text.txt": "its name should end in",
        "mixed": "several formats",
    }.items():
        with pytest.raises(BagError, match=reason):
            open_bag(tmp_path / name)
