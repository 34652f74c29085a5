# SPDX-License-Identifier: Apache-2.0
"""Round trips to another process: works that take turns, and an echo that they are compared with."""

from __future__ import annotations

import socket
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .native import compile_program
from .size import sized

#: Works take turns in blocks, so that a busy computer is busy for all of them.
_BLOCKS, _TRIPS = sized((60, 100), (1, 10))


def in_turns(works: dict[str, Callable[[], object]]) -> dict[str, dict[str, float]]:
    """us per call of each: median, quartiles and 99th percentile."""
    found: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(_BLOCKS):
        for name, work in works.items():
            for _ in range(_TRIPS):
                begun = time.perf_counter_ns()
                work()
                found[name].append((time.perf_counter_ns() - begun) / 1e3)
    return {name: _summary(values) for name, values in found.items()}


def _summary(values: list[float]) -> dict[str, float]:
    cuts = statistics.quantiles(values, n=100)
    return {"low": cuts[24], "median": cuts[49], "high": cuts[74], "p99": cuts[98]}


def trip(connected: socket.socket, request: bytes) -> bytes:
    """Sends a request; returns its reply, a line."""
    connected.sendall(request)
    reply = connected.recv(4096)
    while not reply.endswith(b"\n"):
        reply += connected.recv(4096)
    return reply


def connect(path: Path) -> socket.socket:
    """Waits until somebody listens."""
    client = socket.socket(socket.AF_UNIX)
    client.settimeout(20)
    deadline = time.monotonic() + 20
    while client.connect_ex(str(path)) != 0:
        if time.monotonic() > deadline:
            raise RuntimeError(f"nobody listens at {path}")
        time.sleep(0.01)
    client.settimeout(None)  # with one, Python polls before each call
    return client


@contextmanager
def echo(folder: Path, reply: bytes) -> Iterator[socket.socket]:
    """A connection to a C program that answers whatever comes with as many bytes as `reply` has."""
    program = compile_program(["peers/echo.c"], folder / "echo")
    path = folder / "echo.sock"
    with subprocess.Popen([str(program), str(path), str(len(reply))]) as process, connect(path) as client:
        yield client
        client.close()
        process.wait(20)
