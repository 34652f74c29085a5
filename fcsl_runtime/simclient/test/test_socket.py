# SPDX-License-Identifier: Apache-2.0
"""Whose socket a path is: of several programs that find a stale one, and of another user; TCP clients that vanish."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from native import FIXTURE, PROGRAM, flying
from test_vars_clients import address_of, tcp

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


# ---- TCP


def keepalive_s(client: socket.socket) -> float | None:
    """After how long the kernel asks this client of a server on loopback whether it is there; None: it does not."""
    ends = [f"0100007F:{port:04X}" for port in (client.getpeername()[1], client.getsockname()[1])]
    kind, ticks = "01", ""
    deadline = time.monotonic() + 10
    while kind == "01":  # what was sent last is not acknowledged yet
        assert time.monotonic() < deadline
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()]
        ((kind, ticks),) = [row[5].split(":") for row in rows if row[1:3] == ends]
    return int(ticks, 16) / os.sysconf("SC_CLK_TCK") if kind == "02" else None


def test_a_remote_client_is_asked_whether_it_is_there(tmp_path: Path) -> None:
    with flying("--socket", "tcp:127.0.0.1:0", "--token", tmp_path / "token", "--paused") as fc:
        client = tcp(address_of(fc))
        assert client.ok("authenticate", token=(tmp_path / "token").read_text().strip())
        asked = keepalive_s(client.socket)
        assert asked is not None and asked <= 10


#: With a network of its own, whose loopback is what vanishes.
VANISHING = """
import fcntl, os, socket, struct, sys, time
from pathlib import Path

sys.path.insert(0, sys.argv[1])
from native import flying
from test_vars_clients import address_of, descriptors, tcp

SIOCSIFFLAGS, IFF_UP = 0x8914, 1


def loopback(flags):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", flags))


loopback(IFF_UP)
token = Path(sys.argv[2])
with flying("--socket", "tcp:127.0.0.1:0", "--token", token) as fc:
    address = address_of(fc)
    none = descriptors(fc.process.pid)
    silent, reading = tcp(address), tcp(address)
    for client in (silent, reading):
        client.ok("authenticate", token=token.read_text().strip())
    reading.ok("subscribe", paths=["machine.tick"])
    assert descriptors(fc.process.pid) == none + 2
    loopback(0)
    begun = time.monotonic()
    while descriptors(fc.process.pid) > none:
        assert time.monotonic() < begun + 60, "it keeps them"
        time.sleep(0.1)
    print(time.monotonic() - begun)
"""


@pytest.mark.skipif(os.environ.get("FCSL_VERIFY", "") in ("", "0"), reason="takes 20 s: FCSL_VERIFY=1")
def test_clients_that_vanish_free_their_places(tmp_path: Path) -> None:
    """One that was sent nothing, and one that is sent samples; docs/reference/variables.md says when."""
    alone = ["unshare", "--user", "--map-root-user", "--net"]
    if shutil.which("unshare") is None or subprocess.run([*alone, "true"], check=False).returncode != 0:
        pytest.skip("no network of one's own can be made here")
    line = [*alone, sys.executable, "-c", VANISHING, str(Path(__file__).parent), str(tmp_path / "token")]
    done = subprocess.run(line, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 30
