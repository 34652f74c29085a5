# SPDX-License-Identifier: Apache-2.0
"""What the tests of the C side share: the fixture machine, fcsl_run.h as far as they need it, a client of fcsl-fc."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_BUILD = Path(os.environ.get("FCSL_TEST_RUNTIME", Path(__file__).resolve().parents[3] / "build/fcsl_runtime"))


def _built(variable: str, name: str) -> str:
    """What CTest says, else where `make build` puts it."""
    return os.environ.get(variable, str(_BUILD / name))


FIXTURE = _built("FCSL_TEST_FIXTURE", "libfixture.so")
FIXTURE_TWIN = _built("FCSL_TEST_FIXTURE_TWIN", "libfixture_twin.so")
PROGRAM = _built("FCSL_TEST_FC", "fcsl-fc")
GUARD = _built("FCSL_TEST_GUARD", "fcsl-guard")
WIRE_SIM = _built("FCSL_TEST_WIRE_SIM", "wire_sim")
MCAP_WRITE = _built("FCSL_TEST_MCAP_WRITE", "mcap_write")


class _Error(ctypes.Structure):
    _fields_ = [("text", ctypes.c_char * 512)]


class _Options(ctypes.Structure):
    _fields_ = [
        ("bag", ctypes.c_char_p),
        ("name_space", ctypes.c_char_p),
        ("lossless", ctypes.c_int),
        ("fields", ctypes.c_char_p),
        ("split", ctypes.c_char_p),
    ]


class Drops(ctypes.Structure):
    """fcsl_record_drops_t"""

    _fields_ = [(name, ctypes.c_uint64) for name in ("ring_full", "disk_failed", "keyframes")]


def _load() -> ctypes.CDLL:
    library = ctypes.CDLL(_built("FCSL_TEST_RUN_LIBRARY", "libfcsl_run.so"))
    pointer = ctypes.c_void_p
    library.fcsl_run_open.restype = pointer
    library.fcsl_run_open.argtypes = [ctypes.c_char_p, ctypes.c_char_p, pointer, pointer]
    library.fcsl_run_set.argtypes = [pointer, ctypes.c_uint32, ctypes.c_uint32, pointer, ctypes.c_uint32, pointer]
    library.fcsl_run_step.argtypes = [pointer, ctypes.c_uint64, pointer]
    library.fcsl_run_set_state.argtypes = [pointer, ctypes.c_int32, pointer]
    for name in ("fcsl_run_inject_overrun", "fcsl_run_inject_fault"):
        getattr(library, name).argtypes = [pointer, ctypes.c_uint32, pointer]
    library.fcsl_run_set_views.argtypes = [pointer, ctypes.c_char_p, pointer]
    library.fcsl_run_record.argtypes = [pointer, pointer, pointer]
    library.fcsl_run_record_dropped.restype = ctypes.c_uint64
    library.fcsl_run_record_dropped.argtypes = [pointer]
    library.fcsl_run_record_drops.restype = Drops
    library.fcsl_run_record_drops.argtypes = [pointer]
    library.fcsl_run_record_add_topic.argtypes = [pointer, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_char_p, pointer]
    library.fcsl_run_record_write.argtypes = [
        pointer, ctypes.c_int, ctypes.c_uint64, ctypes.c_char_p, ctypes.c_uint32, pointer
    ]  # fmt: skip
    library.fcsl_run_save_file.argtypes = [pointer, ctypes.c_char_p, pointer]
    library.fcsl_run_message.restype = ctypes.c_int64
    library.fcsl_run_message.argtypes = [pointer, ctypes.c_uint32, pointer, ctypes.c_size_t]
    for name in ("fcsl_run_attach", "fcsl_run_record_check", "fcsl_run_record_stop", "fcsl_run_close"):
        getattr(library, name).argtypes = [pointer, pointer]
    return library


_LIBRARY = _load()

#: Field numbers of the fixture machine.
GYRO, TEMPERATURE, ARMED, COUNT = 3, 4, 5, 6

#: Where its pilot faults while the count is negative.
NEGATIVE = "algorithms/pilot.py:19:63: the value does not fit u64"


class Refused(Exception):
    """The library's own text."""


class Run:
    """One hosted fixture machine; every call that fails raises Refused."""

    def __init__(self) -> None:
        self._error = _Error()
        self.handle = _LIBRARY.fcsl_run_open(FIXTURE.encode(), None, None, ctypes.byref(self._error))
        assert self.handle, self._error.text.decode()

    def call(self, name: str, *arguments: Any) -> int:
        status: int = getattr(_LIBRARY, name)(self.handle, *arguments, ctypes.byref(self._error))
        if status < 0:
            raise Refused(self._error.text.decode())
        return status

    def set(self, field: int, data: bytes, element: int = 0) -> None:
        self.call("fcsl_run_set", field, element, data, len(data))

    def step(self, ticks: int) -> None:
        self.call("fcsl_run_step", ticks)

    def record(
        self, bag: Path, name_space: str = "", lossless: bool = True, fields: str | None = None, split: str = ""
    ) -> None:
        chosen = None if fields is None else fields.encode()
        options = _Options(str(bag).encode(), name_space.encode(), int(lossless), chosen, split.encode())
        self.call("fcsl_run_record", ctypes.byref(options))

    def save_file(self, path: Path) -> None:
        self.call("fcsl_run_save_file", str(path).encode())

    def dropped(self) -> int:
        return int(_LIBRARY.fcsl_run_record_dropped(self.handle))

    def drops(self) -> Drops:
        drops: Drops = _LIBRARY.fcsl_run_record_drops(self.handle)
        return drops

    def message(self, instance: int) -> bytes:
        buffer = ctypes.create_string_buffer(1024)
        size = _LIBRARY.fcsl_run_message(self.handle, instance, buffer, len(buffer))
        return buffer.raw[:size]


class Client:
    """A connection to the command server."""

    def __init__(self, path: Path) -> None:
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(60)  # of a machine with much else to do
        self.socket.connect(str(path))
        self.file = self.socket.makefile("rb")

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def read(self) -> dict[str, Any]:
        line = self.file.readline()
        assert line.endswith(b"\n"), f"the server closed the connection: {line!r}"
        reply: dict[str, Any] = json.loads(line)
        return reply

    def __call__(self, cmd: str, **members: Any) -> dict[str, Any]:
        self.send(json.dumps({"cmd": cmd, **members}).encode() + b"\n")
        return self.read()

    def ok(self, cmd: str, **members: Any) -> dict[str, Any]:
        reply = self(cmd, **members)
        assert reply["ok"], reply
        return reply

    def error(self, cmd: str, **members: Any) -> dict[str, str]:
        reply = self(cmd, **members)
        assert not reply["ok"], reply
        error: dict[str, str] = reply["error"]
        assert set(error) - {"overwritten_by"} == {"code", "message", "hint"}
        return error

    def get(self, path: str) -> Any:
        return self.ok("get", paths=[path])["values"][path]

    def set(self, path: str, value: Any, **members: Any) -> dict[str, Any]:
        return self.ok("set", values={path: value}, **members)

    def closed(self) -> bool:
        """Waits for the server to close the connection."""
        try:
            return self.file.readline() == b""
        except ConnectionResetError:
            return True

    def close(self) -> None:
        self.file.close()
        self.socket.close()


class Fc:
    """A running fcsl-fc."""

    def __init__(self, *arguments: str | Path, library: str = FIXTURE, **outputs: int) -> None:
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **outputs}
        self.process: subprocess.Popen[str] = subprocess.Popen(
            [PROGRAM, library, *map(str, arguments)], stdout=pipes["stdout"], stderr=pipes["stderr"], text=True
        )

    def client(self, path: Path) -> Client:
        """Connects as soon as the server listens."""
        deadline = time.monotonic() + 10
        while True:
            try:
                return Client(path)
            except (
                FileNotFoundError,
                ConnectionRefusedError,
                BlockingIOError,
            ):  # absent, not listening, or many waiting
                assert self.process.poll() is None and time.monotonic() < deadline, self.wait()
                time.sleep(0.01)

    def wait(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out, err

    def stop(self, number: int = signal.SIGTERM) -> tuple[int, str, str]:
        self.process.send_signal(number)
        return self.wait()


@contextlib.contextmanager
def flying(*arguments: str | Path, library: str = FIXTURE, **outputs: int) -> Iterator[Fc]:
    """Runs fcsl-fc, with pipes for `stdout` and `stderr` unless they are given; kills it when the test leaves it running."""
    fc = Fc(*arguments, library=library, **outputs)
    try:
        yield fc
    finally:
        if fc.process.poll() is None:
            fc.process.kill()
        fc.process.communicate()
