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


def test_a_path_without_room_for_the_temporary_file_is_refused(tmp_path: Path) -> None:
    longest = os.pathconf(tmp_path, "PC_PATH_MAX") - len(".tmp") - 1  # and the byte that ends it
    for length, reason in ((longest, "File name too long|No such file"), (longest + 1, "is too long")):
        with pytest.raises(TwinError, match=reason):
            write_checkpoint("/" + "x" * (length - 1), b"data")


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


#: Notes in the file $NOTES what is brought to the disk, and what gets a new name.
NOTES = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static void note(const char *what, const char *first, const char *second)
{
    char line[9000];
    const int length = snprintf(line, sizeof line, "%s %s %s\n", what, first, second);
    const int fd = open(getenv("NOTES"), O_WRONLY | O_CREAT | O_APPEND, 0644);
    if (write(fd, line, (size_t)length) != length || close(fd) != 0) {
        abort();
    }
}

int fsync(int fd)
{
    char link[64], path[4096] = "";
    (void)snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    if (readlink(link, path, sizeof path - 1) < 0) {
        abort();
    }
    const int result = ((int (*)(int))dlsym(RTLD_NEXT, "fsync"))(fd);
    note("fsync", path, "");
    return result;
}

int rename(const char *from, const char *to)
{
    const int result = ((int (*)(const char *, const char *))dlsym(RTLD_NEXT, "rename"))(from, to);
    note("rename", from, to);
    return result;
}
"""


def test_a_file_is_on_the_disk_before_it_gets_its_name_and_the_name_before_the_end(tmp_path: Path) -> None:
    """A killed writer does not show what a power failure leaves: only what fsync has brought to the disk is sure to last."""
    (tmp_path / "notes.c").write_text(NOTES)
    line = ["cc", "-shared", "-fPIC", tmp_path / "notes.c", "-o", tmp_path / "notes.so", "-ldl"]
    subprocess.run(line, check=True)
    folder = tmp_path.resolve() / "flight"
    folder.mkdir()
    write = "import sys; from simclient.checkpoint import write_checkpoint; write_checkpoint(sys.argv[1], b'new')"
    environment = {"LD_PRELOAD": str(tmp_path / "notes.so"), "NOTES": str(tmp_path / "notes")}
    line = [sys.executable, "-c", write, folder / "checkpoint"]
    subprocess.run(line, check=True, env={**os.environ, **environment})
    noted = [words.split() for words in (tmp_path / "notes").read_text().splitlines()]
    assert [words for words in noted if str(folder) in " ".join(words)] == [
        ["fsync", str(folder / "checkpoint.tmp")],
        ["rename", str(folder / "checkpoint.tmp"), str(folder / "checkpoint")],
        ["fsync", str(folder)],
    ]
