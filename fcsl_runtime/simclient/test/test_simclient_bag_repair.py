# SPDX-License-Identifier: Apache-2.0
"""`simclient.bag repair`, and the metadata.yaml of a recording whose process was killed."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from foreign_bags import number, write_mcap
from mcap.reader import make_reader
from mcap.writer import CompressionType
from native import FIXTURE, PROGRAM
from rosbags.highlevel import AnyReader

from simclient import BagError
from simclient.bag import Bag
from simclient.bag.repair import repair


def information(bag: Path) -> Any:
    return yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """A bag killed after more than two seconds, with its metadata.yaml at that moment."""
    bag = tmp_path_factory.mktemp("killed") / "run"
    with subprocess.Popen([PROGRAM, FIXTURE, "--record", str(bag)], stdout=subprocess.DEVNULL) as flight:
        until = time.monotonic() + 60
        while time.monotonic() < until:
            if bag.exists() and information(bag)["duration"]["nanoseconds"] > 1_500_000_000:
                break
            time.sleep(0.05)
        with pytest.raises(BagError, match="it is being recorded; end the recording first"):
            repair(bag)
        flight.kill()
    return bag, information(bag)


def test_metadata_of_a_killed_bag_can_be_played(killed: tuple[Path, Any]) -> None:
    bag, told = killed
    assert told["starting_time"]["nanoseconds_since_epoch"] == 0
    assert told["duration"]["nanoseconds"] > 1_500_000_000
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in told["topics_with_message_count"]}
    assert sum(counts.values()) == told["message_count"] > 100
    there = {name: topic.count for name, topic in Bag(bag).topics.items()}
    assert all(0 <= there[name] - count < 2000 for name, count in counts.items())


def test_repair_of_a_killed_bag(killed: tuple[Path, Any]) -> None:
    bag, _ = killed
    before = list(Bag(bag).messages())
    told = information(bag)
    (bag / "metadata.yaml").unlink()
    done = subprocess.run(["fcsl", "bag", "repair", str(bag)], capture_output=True, text=True)
    assert f"run_0.mcap: {len(before)} messages, end rewritten\n" in done.stdout
    assert list(Bag(bag).messages()) == before and Bag(bag).truncated == ""
    with (bag / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert (
            sum(1 for _ in reader.iter_messages(topics=["/fixture/state"])) == Bag(bag).topics["/fixture/state"].count
        )
    with AnyReader([bag]) as other:
        assert sum(1 for _ in other.messages()) == len(before)
    now = information(bag)
    assert now.keys() == told.keys() and now["message_count"] == len(before)
    for was, topic in zip(told["topics_with_message_count"], now["topics_with_message_count"], strict=True):
        assert was["topic_metadata"] == topic["topic_metadata"]
    assert repair(bag)[0].startswith(f"run_0.mcap: {len(before)} messages, in order\n")


def test_repair_of_a_bag_with_a_bad_chunk(tmp_path: Path) -> None:
    bag = tmp_path / "run"
    command = [PROGRAM, FIXTURE, "--ticks", "9000", "--rate", "max", "--record", str(bag)]
    subprocess.run(command, check=True, capture_output=True)
    file = bag / "run_0.mcap"
    content = bytearray(file.read_bytes())
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[3]
    content[chunk.chunk_start_offset + chunk.chunk_length - 3] ^= 1
    file.write_bytes(content)
    left = list(Bag(bag).messages())
    _, missing = repair(bag)
    assert missing.startswith("run_0.mcap lacks ")
    with AnyReader([bag]) as other:
        assert sum(1 for _ in other.messages()) == len(left)
    opened = Bag(bag)
    assert list(opened.messages()) == left
    assert opened.truncated.endswith(" (damaged before a repair)")  # a replay has to end there still


def test_the_end_that_a_repair_writes_is_the_recorder_s(tmp_path: Path) -> None:
    """Players go by the summary: what a file holds, and where the chunks of a time are."""
    bag = tmp_path / "run"
    command = [PROGRAM, FIXTURE, "--ticks", "9000", "--rate", "max", "--record", str(bag)]
    subprocess.run(command, check=True, capture_output=True)
    file = bag / "run_0.mcap"

    def summary() -> Any:
        with file.open("rb") as stream:
            return make_reader(stream).get_summary()

    whole, size = summary(), file.stat().st_size
    assert len(whole.chunk_indexes) > 3 and whole.statistics.message_count > 9000
    with file.open("r+b") as stream:
        stream.truncate(size - 100)
    repair(bag)
    repaired = summary()
    assert repaired.statistics == whole.statistics
    assert repaired.chunk_indexes == whole.chunk_indexes
    assert repaired.schemas == whole.schemas and repaired.channels == whole.channels
    with file.open("rb") as stream:
        last = list(make_reader(stream).iter_messages(starting_at=whole.statistics.message_end_time))
    assert last and all(m.log_time == whole.statistics.message_end_time for _, _, m in last)


@pytest.mark.parametrize(("damaged_bytes", "is_passed_over"), [(9 + 10, True), (9 + 9, False)])
def test_damage_is_passed_over_where_a_record_has_room(
    damaged_bytes: int, is_passed_over: bool, tmp_path: Path
) -> None:
    """A record's head has 9 bytes, and the mark that it is damage 10."""
    start = 100 * 10**9
    messages = [(start + i * 10**9, "/level", number(i)) for i in range(20)]
    (tmp_path / "run").mkdir()
    file = write_mcap(tmp_path / "run/run_0.mcap", messages, CompressionType.ZSTD, 50)
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    at = summary.chunk_indexes[4].chunk_start_offset
    content = file.read_bytes()
    file.write_bytes(content[:at] + bytes(damaged_bytes) + content[at:])
    if not is_passed_over:
        with pytest.raises(BagError, match=f"the damage at byte {at} is too short to be passed over; `cut` makes"):
            repair(tmp_path / "run")
        return
    repair(tmp_path / "run")
    with AnyReader([tmp_path / "run"]) as other:
        assert sum(1 for _ in other.messages()) == len(messages)


@pytest.mark.parametrize(("name", "reason"), [("none", "no such bag"), ("empty", "no .mcap file in it")])
def test_what_cannot_be_repaired(name: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match=reason):
        repair(tmp_path / name)
