# SPDX-License-Identifier: Apache-2.0
"""Whose socket a path is: of several programs that find a stale one, and of another user."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from native import FIXTURE, PROGRAM, flying

SLOW_UNLINK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

int unlink(const char *path)
{
    static const struct timespec pause = {.tv_nsec = 700000000};
    int (*next)(const char *) = (int (*)(const char *))dlsym(RTLD_NEXT, "unlink");
    close(open(getenv("UNLINKING"), O_CREAT | O_WRONLY, 0600));
    (void)nanosleep(&pause, NULL);
    return next(path);
}
"""


@pytest.fixture
def folder() -> Iterator[Path]:
    """One that everybody may write to, behind folders that everybody may enter."""
    path = Path(tempfile.mkdtemp(prefix="fcsl-socket-"))
    path.chmod(0o777)
    yield path
    shutil.rmtree(path)


def leave_stale(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))


def test_of_two_that_find_a_stale_socket_one_serves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first is slow between its look and its removal of the stale socket; the second starts in between and must not
    listen there, since its socket would be removed."""
    (tmp_path / "slow.c").write_text(SLOW_UNLINK)
    slow, path = tmp_path / "slow.so", tmp_path / "s"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(slow), str(tmp_path / "slow.c"), "-ldl"], check=True)
    leave_stale(path)
    monkeypatch.setenv("LD_PRELOAD", str(slow))
    monkeypatch.setenv("UNLINKING", str(tmp_path / "unlinking"))
    with flying("--socket", path, "--paused") as first:
        monkeypatch.delenv("LD_PRELOAD")
        while not (tmp_path / "unlinking").exists() and first.process.poll() is None:
            pass
        with flying("--socket", path, "--paused") as second:
            assert first.process.stdout is not None
            assert first.process.stdout.readline().startswith("fcsl-fc: machine")
            code, _, err = second.wait()
        assert code == 1 and "is in use by another process" in err
        assert first.client(path).ok("state")["paused"]


def test_a_socket_of_another_user_is_left_alone(folder: Path) -> None:
    """The message does not say that somebody uses it, which nobody can know."""
    path = folder / "s"
    leave_stale(path)
    path.chmod(0)

    def become_somebody() -> None:
        if os.geteuid() == 0:
            os.setresuid(65534, 65534, 65534)

    command = [PROGRAM, FIXTURE, "--socket", str(path), "--ticks", "1"]
    result = subprocess.run(
        command, capture_output=True, text=True, timeout=30, check=False, preexec_fn=become_somebody
    )
    assert (
        result.returncode == 1
        and result.stderr == f"fcsl-fc: socket '{path}' belongs to another user; it is left alone\n"
    )
    assert path.is_socket()
