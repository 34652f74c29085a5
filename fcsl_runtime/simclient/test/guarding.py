# SPDX-License-Identifier: Apache-2.0
"""Tests of fcsl-guard: the guard as a process, what its driver `log` wrote, and a flight program that writes the slot by hand."""

from __future__ import annotations

import mmap
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from native import GUARD

from simclient.link.message import Channel, Kind, Message, encode

#: Of machines/guarded.c.
TABLE = [Channel(1, False, 6), Channel(513, True, 6), Channel(514, True, 0)]
SAFE = {"number": -1.0, "flag": 1.0}
COMMAND = {"number": 2.5, "flag": 0.0}
TIMEOUT_S = 0.2
PATIENCE_S = 30


@dataclass(frozen=True)
class Write:
    """One write of the driver `log`: when, on the monotonic clock, and what."""

    time_s: float
    values: dict[str, float]


def log_writes(path: Path) -> list[Write]:
    """All complete lines of the file, oldest first. One that changes between two looks is being written."""
    data, again = path.read_bytes(), path.read_bytes()
    found = []
    for at in range(0, len(data), 256):
        line = data[at : at + 256]
        if line.endswith(b"\n") and line == again[at : at + 256]:
            stamp, *values = line.decode().split()
            pairs = (value.split("=") for value in values)
            found.append(Write(int(stamp) / 1e9, {name: float(text) for name, text in pairs}))
    return sorted(found, key=lambda write: write.time_s)


def wait_for(what: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < deadline, "it does not happen"
        time.sleep(0.002)


class Guard:
    """A running fcsl-guard whose channels go to `log`; its lines are collected as they come."""

    def __init__(self, library: Path, folder: Path, *options: str | Path) -> None:
        self.slot, self.log = folder / "slot", folder / f"log{len(list(folder.glob('log*')))}"
        plan = ["--actuator", f"cart.force=log:{self.log}", "--actuator", f"panel.valve=log:{self.log}"]
        self._start(library, *plan, *options)

    def _start(self, library: Path, *options: str | Path) -> None:
        arguments = [GUARD, library, "--slot", self.slot, *options]
        self.process = subprocess.Popen(
            list(map(str, arguments)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        self.wait_line("machine 'guarded'")

    def _read(self) -> None:
        assert self.process.stdout
        self.lines.extend(iter(self.process.stdout.readline, ""))

    def told(self, text: str) -> list[str]:
        return [line for line in self.lines if text in line]

    def wait_line(self, text: str) -> None:
        wait_for(lambda: self.told(text) or self.process.poll() is not None)
        assert self.told(text), self.lines

    def writes(self) -> list[Write]:
        return log_writes(self.log)

    def last(self) -> dict[str, float]:
        return self.writes()[-1].values

    def wait_last(self, values: dict[str, float]) -> None:
        wait_for(lambda: self.last() == values)

    def stays_safe(self, writes: int = 20) -> None:
        """From here on, for so many writes."""
        before = self.writes()[-1].time_s
        wait_for(lambda: sum(w.time_s > before for w in self.writes()) >= writes)
        assert all(w.values == SAFE for w in self.writes() if w.time_s > before)

    def end(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        code = self.process.wait(PATIENCE_S)
        self._reader.join()
        return code


@contextmanager
def guarding(library: Path, folder: Path, *options: str | Path) -> Iterator[Guard]:
    guard = Guard(library, folder, *options)
    try:
        yield guard
    finally:
        guard.end(signal.SIGKILL)


class Slot:
    """The slot as fcsl_guard.h lays it out, and a flight program that does with it what it likes."""

    SEQUENCE, BEGUN, SIZE, MESSAGE = 88, 96, 104, 112

    def __init__(self, path: Path) -> None:
        self.connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.connection.settimeout(PATIENCE_S)
        wait_for(lambda: self.connection.connect_ex(str(path)) == 0)  # the path is there before the guard listens
        said, descriptors, _, _ = socket.recv_fds(self.connection, 128, 1)
        assert said == b"slot\0" and len(descriptors) == 1
        self.memory = mmap.mmap(descriptors[0], 0)
        os.close(descriptors[0])
        assert self.memory[:8] == b"FCSG" + struct.pack("<I", 1)

    def put(self, at: int, value: int) -> None:
        self.memory[at : at + 8] = struct.pack("<Q", value)

    def get(self, at: int) -> int:
        return int.from_bytes(self.memory[at : at + 8], "little")

    def begin(self) -> None:
        self.put(self.SEQUENCE, self.get(self.SEQUENCE) | 1)

    def finish(self) -> None:
        self.put(self.SEQUENCE, self.get(self.SEQUENCE) + 1)

    def write(self, data: bytes, size: int | None = None, begun_ns: int | None = None) -> None:
        self.begin()
        self.put(self.BEGUN, time.monotonic_ns() if begun_ns is None else begun_ns)
        self.put(self.SIZE, len(data) if size is None else size)
        self.memory[self.MESSAGE : self.MESSAGE + len(data)] = data
        self.finish()

    def close(self) -> None:
        self.memory.close()
        self.connection.close()


def command(force: float, tick: int = 1, armed: bool = True) -> bytes:
    """A command to the actuators of machines/guarded.c."""
    return encode(Message(Kind.ACTUATORS, tick, {513: (force,), 514: (False,)}, armed=armed), TABLE)


def die_in_the_middle(path: Path, log: Path) -> None:
    """Commands until the actuators have it, writes half of another command, and is killed."""
    slot = Slot(path)
    slot.write(command(COMMAND["number"]))
    while log_writes(log)[-1].values != COMMAND:
        slot.write(command(COMMAND["number"]))
    half = command(-77.0)
    half = half[: len(half) // 2]
    slot.begin()
    slot.put(Slot.BEGUN, time.monotonic_ns() + 10**12)
    slot.memory[Slot.MESSAGE : Slot.MESSAGE + len(half)] = half
    os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    die_in_the_middle(Path(sys.argv[1]), Path(sys.argv[2]))
