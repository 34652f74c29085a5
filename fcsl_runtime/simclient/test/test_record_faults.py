# SPDX-License-Identifier: Apache-2.0
"""Recordings that end badly: killed at any moment, on a full disk, on one that no longer answers. What is in the file then
opens in every reader and replays bit for bit; and the thread that steps takes no notice."""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from native import FIXTURE
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from simclient.replay import replay

#: argv: bag, policy, hundreds of ticks (0: without end), what becomes of the process then. Writes fields before every hundred.
CHILD = """
import os, struct, sys, threading, time
sys.path.insert(0, {folder!r})
from pathlib import Path
from native import GYRO, Run, Refused
bag, policy, hundreds, then = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), sys.argv[4]
run = Run()
run.record(bag, lossless=policy == "lossless")

def fly():
    number = 0
    while not hundreds or number < hundreds:
        run.set(GYRO, struct.pack("<d", number * 0.37 % 1.0), number % 3)
        run.step(100)
        number += 1
        if number == 10:
            print("flying", flush=True)
        if not hundreds:
            time.sleep(0.001)  # so that what is replayed afterwards is not too much

if then == "stuck":
    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    thread.join(20 if policy == "drop" else 3)
    drops = run.drops()
    print("stands" if thread.is_alive() else "flown", int(drops.ring_full > 0), int(drops.disk_failed > 0), flush=True)
    os._exit(0)
try:
    fly()
    deadline = time.monotonic() + 30  # the writer comes to the end of the disk when it does
    while policy == "drop" and time.monotonic() < deadline:
        run.call("fcsl_run_record_check")
        run.step(1)
        time.sleep(0.001)
    run.call("fcsl_run_record_check")
    print("stepped", flush=True)
except Refused as refused:
    print("step:", refused)
    if policy == "drop":
        run.step(100)
drops = run.drops()
print("drops", drops.ring_full, drops.disk_failed)
try:
    run.call("fcsl_run_record_stop")
except Refused as refused:
    print("stop:", refused)
run.step(10)
print("alive", flush=True)
"""


def child(
    bag: Path,
    hundreds: int,
    policy: str = "lossless",
    then: str = "",
    limit_bytes: int = 0,
    environment: Mapping[str, str] = {},
) -> subprocess.Popen[str]:
    def limit() -> None:
        if limit_bytes:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # the write then fails with EFBIG, much like a full disk
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    code = CHILD.format(folder=str(Path(__file__).parent))
    # -B: no compiled import is cut short for later processes
    arguments = [sys.executable, "-B", "-c", code, str(bag), policy, str(hundreds), then]
    return subprocess.Popen(
        arguments, stdout=subprocess.PIPE, text=True, preexec_fn=limit, env={**os.environ, **environment}
    )


def messages_in(bag: Path, whole: bool = True) -> int:
    """Messages that three independent readers find: one goes through the file from its start, one begins at its end, and
    rosbags, which wants the `whole` file to make sense. Raises what they raise when the file does not end as MCAP does."""
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        records = [type(record).__name__ for record in StreamReader(stream, validate_crcs=True).records]
    assert records[-1] == "Footer"
    with file.open("rb") as stream:
        seeking = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False))
    assert records.count("Message") == seeking
    if whole:
        with AnyReader([file], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            assert sum(1 for _ in reader.messages()) == seeking
    return seeking


def check_what_is_left(bag: Path, whole: bool = True) -> int:
    """The bag opens, and replays bit for bit as far as it goes; returns its ticks."""
    assert yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["version"] == 9
    assert messages_in(bag, whole) > 0
    verdict = replay(bag, library=FIXTURE)
    assert verdict.divergence is None, verdict
    return verdict.ticks


@pytest.mark.parametrize("seed", range(6))
def test_killed_at_any_moment(seed: int, tmp_path: Path) -> None:
    """The writer writes all the time here: nothing waits in it for long."""
    process = child(tmp_path / "bag", 0)
    assert process.stdout is not None and process.stdout.readline() == "flying\n"
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(random.Random(seed).uniform(0, 0.3))
    process.kill()
    process.communicate()
    check_what_is_left(tmp_path / "bag")


def test_a_file_that_breaks_off_is_noticed(tmp_path: Path) -> None:
    """Control: what the tests here ask of a file, not every file grants."""
    child(tmp_path / "bag", 30).communicate(timeout=60)
    assert check_what_is_left(tmp_path / "bag") == 3000
    file = tmp_path / "bag/bag_0.mcap"
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(Exception):  # noqa: B017, PT011  each reader has its own way to say so
        messages_in(tmp_path / "bag")


#: Stands before the C library's pwrite and dies within the CUT-th one: a large one is half written, a small one, which the
#: kernel does in one piece, is not. Exits with 10 when the call before wrote a tail (50 bytes).
CUT = """
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>

ssize_t pwrite64(int file, const void *data, size_t size, off_t at) {
    static int count;
    static size_t before;
    if (++count == atoi(getenv("CUT"))) {
        if (size > 64) {
            syscall(SYS_pwrite64, file, data, size / 2, at);
        }
        _exit(before == 50 ? 10 : 9);
    }
    before = size;
    return syscall(SYS_pwrite64, file, data, size, at);
}
"""

#: Stands before pwrite, too: from the STUCK-th on it never returns.
STUCK = """
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>

ssize_t pwrite64(int file, const void *data, size_t size, off_t at) {
    static int count;
    while (++count >= atoi(getenv("STUCK"))) {
        pause();
    }
    return syscall(SYS_pwrite64, file, data, size, at);
}
"""


@pytest.fixture(scope="module")
def interposed(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """Name to library."""
    folder = tmp_path_factory.mktemp("interposed")
    libraries = {}
    for name, source in (("CUT", CUT), ("STUCK", STUCK)):
        (folder / f"{name}.c").write_text(source)
        libraries[name] = str(folder / f"{name}.so")
        subprocess.run(["cc", "-shared", "-fPIC", "-o", libraries[name], str(folder / f"{name}.c")], check=True)
    return libraries


#: Call 1 begins the file, calls 2 to 5 put the first chunk, a checkpoint, into it.
CUTS = range(6, 18)


def test_killed_within_a_write(interposed: Mapping[str, str], tmp_path: Path) -> None:
    """At every call that writes. Between two of them a tail stands twice in the file: rosbags alone goes on at the first."""
    codes, ticks = [], []
    for cut in CUTS:
        bag = tmp_path / str(cut)
        process = child(bag, 100, environment={"LD_PRELOAD": interposed["CUT"], "CUT": str(cut)})
        process.communicate(timeout=60)
        codes.append(process.returncode)
        ticks.append(check_what_is_left(bag, whole=process.returncode == 9))
    assert set(codes) == {9, 10} and codes.count(10) <= 3
    assert ticks[-1] > 500


@pytest.mark.parametrize(("policy", "said"), [("drop", "flown 1 0"), ("lossless", "stands 0 0")])
def test_a_disk_that_does_not_answer(policy: str, said: str, interposed: Mapping[str, str], tmp_path: Path) -> None:
    """In real time no tick waits for it. A simulation does: without that, this test would show nothing."""
    environment = {"LD_PRELOAD": interposed["STUCK"], "STUCK": "5"}
    out, _ = child(tmp_path / "bag", 1000, policy, "stuck", environment=environment).communicate(timeout=60)
    assert out.splitlines()[-1] == said


def test_full_disk_ends_a_simulation(tmp_path: Path) -> None:
    out, _ = child(tmp_path / "bag", 5000, limit_bytes=50_000).communicate(timeout=60)
    assert "step: recording failed" in out and "stop: recording failed" in out and "File too large" in out
    assert out.endswith("alive\n")
    check_what_is_left(tmp_path / "bag")


def check_flown_on(out: str, reason: str) -> None:
    """All ticks were made, the reason was told, and what is missing was counted for what it is."""
    lines = out.splitlines()
    assert lines[0] == "flying" and "step: recording failed" in lines[1] and reason in lines[1]
    (drops,) = [line.split() for line in lines if line.startswith("drops")]
    assert int(drops[2]) > 0
    assert "stop: recording failed" in out and out.endswith("alive\n")


def test_full_disk_in_real_time(tmp_path: Path) -> None:
    out, _ = child(tmp_path / "bag", 1000, "drop", limit_bytes=50_000).communicate(timeout=60)
    check_flown_on(out, "File too large")
    check_what_is_left(tmp_path / "bag")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 400 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    line = ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", str(folder)]
    if subprocess.run(line, capture_output=True, check=False).returncode != 0:
        pytest.skip("no file system may be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_disk_without_space(small_disk: Path) -> None:
    out, _ = child(small_disk / "bag", 1000, "drop").communicate(timeout=60)
    check_flown_on(out, "No space left on device")
    check_what_is_left(small_disk / "bag")
