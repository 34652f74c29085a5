# SPDX-License-Identifier: Apache-2.0
"""Finds a free port of 127.0.0.1 for tests, benchmarks and demonstrations that put programs on a bus."""

from __future__ import annotations

import contextlib
import random
import socket

#: Below the ports that Linux gives to outgoing connections: a client that tries before anybody listens might reach itself.
_FIRST, _LAST = 20_000, 31_999


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """Raises RuntimeError when none is found."""
    for port in random.SystemRandom().sample(range(_FIRST, _LAST + 1), 100):
        with socket.socket(socket.AF_INET, kind) as found, contextlib.suppress(OSError):
            found.bind(("127.0.0.1", port))
            return port
    raise RuntimeError(f"none of 100 ports from {_FIRST} to {_LAST} is free")


def free_endpoint() -> str:
    """tcp:127.0.0.1:PORT."""
    return f"tcp:127.0.0.1:{free_port()}"
