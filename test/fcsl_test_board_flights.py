# SPDX-License-Identifier: Apache-2.0
"""Flights with a board, for tests: fcsl-fc with a client, drivers that are compiled for a test."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fcsl_compiler.base.packages import package_prefix
from simclient import VarClient

ROOT = Path(__file__).resolve().parents[1]
#: The check with sanitizers has its own.
PROGRAM = Path(os.environ.get("FCSL_TEST_FC", package_prefix("fcsl_runtime") / "bin/fcsl-fc"))
LONG_S = 60


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LONG_S
    while not holds():
        assert time.monotonic() < deadline, "it does not happen"
        time.sleep(0.005)


def compile_driver(source: str, name: str, folder: Path) -> Path:
    """folder/lib<name>.so of this C text."""
    (folder / f"{name}.c").write_text(source)
    includes = [f"-I{ROOT / package / 'include'}" for package in ("fcsl_hal", "fcsl_compiler")]
    library = folder / f"lib{name}.so"
    subprocess.run(["cc", "-shared", "-fPIC", *includes, folder / f"{name}.c", "-o", library], check=True)
    return library


def refusal(line: Sequence[str], environment: Mapping[str, str], status: int = 1) -> str:
    """What a flight says that cannot begin."""
    done = subprocess.run(
        [*line, "--ticks", "5"], env=environment, capture_output=True, text=True, timeout=LONG_S, check=False
    )
    assert done.returncode == status and done.stderr.startswith("fcsl-fc: "), done
    return done.stderr


class Flight:
    """fcsl-fc that serves its variables on `socket`."""

    def __init__(self, line: Sequence[str], socket: Path, environment: Mapping[str, str]):
        pipe = subprocess.PIPE
        words = [*line, "--socket", str(socket)]
        self.process = subprocess.Popen(words, env=environment, stdout=pipe, stderr=pipe, text=True)
        until(lambda: self.process.poll() is not None or socket.exists())
        assert self.process.poll() is None, self.process.communicate()
        self.client = VarClient(socket)

    def get(self, path: str) -> Any:
        return self.client.get(path)[path]

    def until_value(self, path: str, value: object) -> None:
        until(lambda: self.get(path) == value)

    def end(self) -> str:
        self.client.close()
        self.process.send_signal(signal.SIGTERM)
        out, complaint = self.process.communicate(timeout=LONG_S)
        assert self.process.returncode == 0, complaint
        return out + complaint


@contextmanager
def flying(begin: Callable[..., Flight]) -> Iterator[Callable[..., Flight]]:
    """Begins flights that do not outlive the block."""
    flights: list[Flight] = []

    def fly(*options: str | Path) -> Flight:
        flights.append(begin(*options))
        return flights[-1]

    try:
        yield fly
    finally:
        for flight in flights:
            flight.process.kill()
            flight.process.communicate()
