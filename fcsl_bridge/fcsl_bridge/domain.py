# SPDX-License-Identifier: Apache-2.0
"""Reserves a ROS 2 domain for tests, benchmarks and demonstrations that start nodes."""

from __future__ import annotations

import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

#: Above domains that are usually chosen by hand, below Linux's ephemeral ports.
_FIRST, _LAST = 20, 99


def _has_participant(domain: int) -> bool:
    """Whether a DDS participant of this machine is in the domain: the first one binds this port (RTPS 2.2, 9.6.1.1)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", 7400 + 250 * domain + 10))
        except OSError:
            return True
    return False


@contextmanager
def _reserved(domain: int) -> Iterator[bool]:
    """Reserves the domain; yields False if another process has it. The kernel frees it when the process ends."""
    path = Path(tempfile.gettempdir()) / f"fcsl-{os.getuid()}-ros-domain-{domain}.lock"
    with path.open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        yield True


@contextmanager
def own_domain(start: int = 0) -> Iterator[int]:
    """The number of a domain that no process on this computer uses, reserved until the context ends.

    The search begins with the `start`-th and wraps around. Raises RuntimeError if all are taken.
    """
    span = _LAST - _FIRST + 1
    for offset in range(span):
        domain = _FIRST + (start + offset) % span
        with ExitStack() as held:
            if held.enter_context(_reserved(domain)) and not _has_participant(domain):
                yield domain
                return
    raise RuntimeError(f"none of the ROS 2 domains {_FIRST} to {_LAST} is free")
