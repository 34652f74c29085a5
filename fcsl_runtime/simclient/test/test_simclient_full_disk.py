# SPDX-License-Identifier: Apache-2.0
"""Tools that write a file when the disk takes no more: one error that names the file, and nothing left of it."""

from __future__ import annotations

import os
import random
import resource
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from foreign_bags import MS, imu
from foreign_bags import write as write_bag
from mcap.reader import make_reader

from simclient import AlgTwin
from simclient.bag.native_bag import NativeBag
from simclient.errors import BagError

START = 100 * 10**9


def limited(size: int) -> Callable[[], None]:
    """Files of the process cannot grow beyond `size` bytes, as on a disk that is full then."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def tool(size: int, *arguments: object) -> subprocess.CompletedProcess[str]:
    unwritten = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}  # no compiled import is cut short for later processes
    command = ["fcsl", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=unwritten, preexec_fn=limited(size))


@pytest.fixture
def bag(probe: Path, tmp_path: Path) -> Path:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run")
        twin.tick(300)
    return tmp_path / "run"


def is_one_error(done: subprocess.CompletedProcess[str], name: str, target: Path) -> None:
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr == f"{name}: error: {target}: cannot be written: File too large\n"


def nothing_is_left(target: Path) -> None:
    assert [path for path in target.parent.iterdir() if target.name in path.name] == []


@pytest.mark.parametrize(
    ("verb", "file"),
    [("rerun", "x.rrd"), ("plot", "x.png"), ("plot", "x.svg"), ("plot", "x.pdf")]
    + [("bag", f"x.{suffix}") for suffix in ("csv", "parquet", "npz")],
)
def test_a_file_is_whole_or_absent(verb: str, file: str, bag: Path, tmp_path: Path) -> None:
    target = tmp_path / file
    done = tool(1000, verb, *(["export"] if verb == "bag" else []), bag, "-o", target)
    is_one_error(done, f"fcsl {verb}", target)
    nothing_is_left(target)


def test_a_recording_for_rerun_without_its_end_is_noticed(bag: Path, tmp_path: Path) -> None:
    """rerun's own writer would log that, and go on. The size differs by some 2 kB from one to the next."""
    target = tmp_path / "x.rrd"
    assert tool(1 << 30, "rerun", bag, "-o", target).returncode == 0
    size = target.stat().st_size
    target.unlink()
    is_one_error(tool(size - 20_000, "rerun", bag, "-o", target), "fcsl rerun", target)
    nothing_is_left(target)


def test_a_bag_is_whole_or_absent(bag: Path, probe: Path, tmp_path: Path) -> None:
    part = tmp_path / "part"
    is_one_error(tool(1000, "bag", "cut", bag, "-o", part), "fcsl bag", part)
    nothing_is_left(part)
    (tmp_path / "map.yaml").write_text("channels: {imu.gyro: {topic: /imu, field: angular_velocity}}")
    foreign = write_bag(
        tmp_path / "foreign", {"/imu": [(START + i * 10 * MS, imu(START + i * 10 * MS)) for i in range(900)]}
    )
    target = tmp_path / "out"
    arguments = (foreign, "--library", probe, "--map", tmp_path / "map.yaml", "-o", target)
    done = tool(20_000, "replay", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("fcsl replay: error: ") and done.stderr.count("\n") == 1
    assert f"'{target}" in done.stderr and "File too large" in done.stderr
    nothing_is_left(target)


def test_a_bag_whose_disk_is_full_keeps_what_was_written_and_closes_its_files(tmp_path: Path) -> None:
    path = tmp_path / "run"
    numbers = random.Random(1)
    before = os.listdir("/proc/self/fd")
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.raises(BagError, match=f"cannot write to bag '{path}': File too large"), NativeBag(path) as bag:
        topic = bag.add("/numbers", "std_msgs/msg/UInt8MultiArray", "uint8[] data")
        bag.publish()
        resource.setrlimit(resource.RLIMIT_FSIZE, (5_000_000, most))
        try:
            for tick in range(100):
                bag.write(topic, tick, numbers.randbytes(1_000_000))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    assert os.listdir("/proc/self/fd") == before
    assert [file.suffix for file in sorted(path.iterdir())] == [".yaml", ".mcap"]
    with (path / "run_0.mcap").open("rb") as file:
        times = [message.log_time for _, _, message in make_reader(file).iter_messages()]
    assert len(times) >= 3 and times == list(range(len(times)))
