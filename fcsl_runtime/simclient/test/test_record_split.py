# SPDX-License-Identifier: Apache-2.0
"""Bags of several files: one bag for every reader, and each file replays alone; the last files, or those around what
happened, are kept; a killed process loses nothing where two files meet."""

from __future__ import annotations

import itertools
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from native import FIXTURE, GYRO, Refused, Run
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from test_record_faults import CUT
from test_requirements import machine

from simclient import AlgTwin
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.replay import replay
from simclient.replay.cut import cut

SECONDS = 30
PILOT = 1


def fly(path: Path, split: str, seconds: int = SECONDS, fault_at: int = -1) -> Path:
    """100 ticks a second, a write before every tenth."""
    run = Run()
    run.record(path, split=split)
    for number in range(seconds * 10):
        run.set(GYRO, struct.pack("<d", number * 0.37 % 1.0), number % 3)
        if number == fault_at * 10:
            run.call("fcsl_run_inject_fault", PILOT)
        run.step(10)
    run.call("fcsl_run_record_stop")
    run.call("fcsl_run_close")
    return path


def metadata(bag: Path) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    return found


def check_metadata(bag: Path) -> list[Path]:
    """metadata.yaml says of each file and of all what two other readers find; returns the files."""
    listed = metadata(bag)
    assert listed["relative_file_paths"] == [entry["path"] for entry in listed["files"]]
    assert sorted(bag.glob("*.mcap")) == sorted(bag / name for name in listed["relative_file_paths"])
    topics: dict[str, int] = {}
    for entry in listed["files"]:
        with (bag / entry["path"]).open("rb") as stream:
            found = [(c.topic, m.log_time) for _, c, m in make_reader(stream, validate_crcs=True).iter_messages()]
        times = [time for _, time in found]
        begin, length = entry["starting_time"]["nanoseconds_since_epoch"], entry["duration"]["nanoseconds"]
        assert (min(times), max(times), len(found)) == (begin, begin + length, entry["message_count"])
        for topic, _ in found:
            topics[topic] = topics.get(topic, 0) + 1
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in listed["topics_with_message_count"]}
    assert {name: count for name, count in counts.items() if count} == topics
    assert listed["message_count"] == sum(topics.values())
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        assert sum(1 for _ in reader.messages()) == reader.message_count == listed["message_count"]
        assert (reader.start_time, reader.end_time - 1) == (
            listed["starting_time"]["nanoseconds_since_epoch"],
            listed["starting_time"]["nanoseconds_since_epoch"] + listed["duration"]["nanoseconds"],
        )
    return [bag / name for name in listed["relative_file_paths"]]


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fly(tmp_path_factory.mktemp("split") / "bag", "seconds=7")


def test_the_files_are_one_bag(split: Path, tmp_path: Path) -> None:
    files = check_metadata(split)
    assert [file.name for file in files] == [f"bag_{number}.mcap" for number in range(len(files))]
    assert 4 <= len(files) <= 5
    verdict = replay(split, library=FIXTURE)
    assert verdict.identical and verdict.ticks == SECONDS * 100
    assert digest(split) == digest(fly(tmp_path / "bag", ""))


def test_every_file_replays_alone_and_begins_with_all_that_shows_on_change(split: Path) -> None:
    ticks = []
    for file in check_metadata(split):
        verdict = replay(file, library=FIXTURE)
        assert verdict.identical, verdict
        ticks.append(verdict.ticks)
        bag = Bag(file)
        assert all(bag.topics[f"{bag.machine().prefix}/{name}"].count for name in ("health", "faults", "state"))
    assert sum(ticks) == SECONDS * 100


def test_only_the_last_files_are_kept(tmp_path: Path) -> None:
    bag = fly(tmp_path / "bag", "seconds=2,files=3")
    files = check_metadata(bag)
    assert len(files) == 3 and files[0].name != "bag_0.mcap"
    verdict = replay(bag, library=FIXTURE)
    assert verdict.identical and 300 < verdict.ticks < SECONDS * 50


def test_files_are_split_by_size(tmp_path: Path) -> None:
    run = Run()
    run.record(tmp_path / "bag", split="megabytes=0.2")
    run.step(15_000)
    run.call("fcsl_run_record_stop")
    files = check_metadata(tmp_path / "bag")
    assert len(files) > 2 and all(file.stat().st_size < 700_000 for file in files)
    assert replay(tmp_path / "bag", library=FIXTURE).identical


def test_what_is_around_a_fault_is_kept(tmp_path: Path) -> None:
    """A fault at 30 s of 60 s: from 26 s to 34 s, and the last 4 s; not the rest."""
    bag = fly(tmp_path / "bag", "around=4", 60, fault_at=30)
    check_metadata(bag)
    opened = Bag(bag)
    state = opened.machine().state
    ticks = [opened.decode(state, data).tick for _, _, data in opened.messages({state})]
    assert {*range(2600, 3400), *range(5600, 6000)} <= set(ticks)
    assert not set(ticks) & {*range(0, 1900), *range(4100, 5000)}
    verdict = replay(bag, library=FIXTURE)
    assert verdict.divergence is None and verdict.ticks == len(ticks)
    (missing,) = verdict.missing
    gap = next(b for a, b in itertools.pairwise(ticks) if b != a + 1)
    assert missing.startswith("ticks ") and f"to {gap - 1} were not verified: no file" in missing
    cut(opened, tmp_path / "cut", 0, 10**12)
    (missing,) = replay(tmp_path / "cut", library=FIXTURE).missing
    assert f"to {gap - 1} were not verified: the bag does not have them" in missing


def test_what_is_around_a_violation_is_kept(tmp_path: Path) -> None:
    """x is too large for 0.1 s, at 30 s of 60 s."""
    required = [{"id": "LOW-1", "text": "x is low.", "then": "src.outputs.x < 2.0"}]
    twin = AlgTwin.from_config(machine(tmp_path, required))
    hz = twin.machine.tick_hz
    twin.record(tmp_path / "bag", split="around=4")
    for x, ticks in ((1.0, 30 * hz), (3.0, hz // 10), (1.0, 30 * hz)):
        twin.set("src.outputs.x", x)
        twin.tick(ticks)
    twin.stop_recording()
    assert [verdict.violations for verdict in twin.requirements.values()] == [1]
    bag = Bag(tmp_path / "bag")
    state = bag.machine().state
    seconds = {bag.decode(state, data).tick // hz for _, _, data in bag.messages({state})}
    assert {*range(26, 34), *range(56, 60)} <= seconds and not seconds & {*range(0, 19), *range(41, 50)}


@pytest.mark.parametrize(
    "text",
    ["x", "seconds", "seconds=", "seconds=0", "seconds=-1", "seconds=1,", ",seconds=1", "seconds=1s", "hours=1",
     "seconds=1e3", "files=2.5,seconds=1", "files=1001,seconds=1", "files=3", "seconds=9999999999999999999999"],
)  # fmt: skip
def test_what_is_no_split_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(Refused, match="seconds"):
        Run().record(tmp_path / "bag", split=text)
    assert list(tmp_path.iterdir()) == []


#: argv: bag. A file a second, without end.
ENDLESS = """
import struct, sys
sys.path.insert(0, {folder!r})
from pathlib import Path
from native import GYRO, Run
run, number = Run(), 0
run.record(Path(sys.argv[1]), split="seconds=1")
while True:
    run.set(GYRO, struct.pack("<d", number * 0.37 % 1.0), number % 3)
    run.step(100)
    number += 1
"""


def test_killed_where_two_files_meet(tmp_path: Path) -> None:
    """Within each of the calls that write, of which a file has some ten."""
    library = tmp_path / "cut.so"
    (tmp_path / "cut.c").write_text(CUT)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, tmp_path / "cut.c"], check=True)
    code = ENDLESS.format(folder=str(Path(__file__).parent))
    counts = []
    for call in range(30, 46):
        bag = tmp_path / str(call)
        environment = {**os.environ, "LD_PRELOAD": str(library), "CUT": str(call)}
        done = subprocess.run([sys.executable, "-B", "-c", code, bag], env=environment, timeout=60, check=False)
        assert done.returncode in (9, 10)
        listed = metadata(bag)["relative_file_paths"]
        assert {file.name for file in bag.glob("*.mcap")} - set(listed) <= {f"{call}_{len(listed)}.mcap"}
        verdict = replay(bag, library=FIXTURE)
        assert verdict.divergence is None, verdict
        assert not [text for text in verdict.missing if "verified" in text]
        assert verdict.ticks >= 100 * (len(listed) - 1)  # all of every file but the last
        counts.append(len(listed))
    assert len(set(counts)) > 1
