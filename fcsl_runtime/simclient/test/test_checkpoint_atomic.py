# SPDX-License-Identifier: Apache-2.0
"""Whenever the writer of a checkpoint file is killed, or the disk is full, the file is the old one or the new one, whole."""

from __future__ import annotations

import os
import random
import resource
import select
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from simclient import TwinError
from simclient.checkpoint import write_checkpoint

OLD, NEW = b"old" * 1000, b"new" * 2000
Writer = Callable[[Path, bytes], None]
_KILLS = 25


def killed_at(byte: int, write: Writer, path: Path) -> int:
    """The status of a process that writes NEW to `path` and that the kernel kills when a file grows beyond `byte`."""
    child = os.fork()
    if child == 0:
        try:
            signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_FSIZE, (byte, byte))
            write(path, NEW)
        finally:
            os._exit(0)
    return os.waitpid(child, 0)[1]


def survivors(write: Writer, folder: Path) -> set[bytes]:
    """What the file holds after a kill at each of many bytes."""
    path, found = folder / "checkpoint", set()
    for byte in range(0, len(NEW), 199):
        path.write_bytes(OLD)
        assert os.WTERMSIG(killed_at(byte, write, path)) == signal.SIGXFSZ
        found.add(path.read_bytes())
    return found


def test_a_kill_at_any_byte_leaves_the_old_file(tmp_path: Path) -> None:
    assert survivors(write_checkpoint, tmp_path) == {OLD}
    assert killed_at(len(NEW), write_checkpoint, tmp_path / "checkpoint") == 0  # what the kills left is not in the way
    assert (tmp_path / "checkpoint").read_bytes() == NEW and os.listdir(tmp_path) == ["checkpoint"]


def test_a_writer_that_writes_in_place_is_found_out(tmp_path: Path) -> None:
    """The control."""
    assert survivors(lambda path, content: path.write_bytes(content) and None, tmp_path) - {OLD, NEW}


def test_kill_9_at_random_moments(tmp_path: Path) -> None:
    path, moments = tmp_path / "checkpoint", random.Random(5)
    path.write_bytes(OLD)
    for _ in range(_KILLS):
        told, tell = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                os.write(tell, b".")
                while True:
                    write_checkpoint(path, NEW)
                    write_checkpoint(path, OLD)
            finally:
                os._exit(0)
        os.read(told, 1)  # it is at work
        select.select([], [], [], moments.uniform(0, 0.01))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(told)
        os.close(tell)
        assert path.read_bytes() in (OLD, NEW)
    write_checkpoint(path, NEW)
    assert path.read_bytes() == NEW and os.listdir(tmp_path) == ["checkpoint"]


def test_a_limit_that_does_not_kill_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint"
    path.write_bytes(OLD)

    def write(where: Path, content: bytes) -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        with pytest.raises(TwinError, match="File too large"):
            write_checkpoint(where, content)
        os._exit(7)

    assert os.waitstatus_to_exitcode(killed_at(100, write, path)) == 7
    assert path.read_bytes() == OLD and os.listdir(tmp_path) == ["checkpoint"]


_ON_A_SMALL_DISK = """
import pathlib, subprocess, sys
from simclient import TwinError
from simclient.checkpoint import write_checkpoint
folder = pathlib.Path(sys.argv[1])
if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=32k", "tmpfs", folder], capture_output=True).returncode:
    sys.exit(3)
old = b"old" * 5000
write_checkpoint(folder / "checkpoint", old)
try:
    write_checkpoint(folder / "checkpoint", b"new" * 9000)
except TwinError as error:
    print(error)
assert (folder / "checkpoint").read_bytes() == old
assert [p.name for p in folder.iterdir()] == ["checkpoint"]
write_checkpoint(folder / "checkpoint", b"new")
assert (folder / "checkpoint").read_bytes() == b"new"
"""


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    line = ["unshare", "--mount", sys.executable, "-c", _ON_A_SMALL_DISK, str(tmp_path)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode in (1, 3) and "Traceback" not in done.stderr:
        pytest.skip("no right to mount a small disk")
    assert done.returncode == 0, done.stderr
    assert "No space left on device" in done.stdout
