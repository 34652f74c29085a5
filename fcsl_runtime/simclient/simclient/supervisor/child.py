# SPDX-License-Identifier: Apache-2.0
"""Child: a program that this process started, its last output, and its exit status."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

from .. import die_with_parent
from .limits import KILL_S, LOG_BYTES, LOG_LINE_BYTES

_READ_BYTES = 1 << 16


class Log:
    """The last lines of a stream, bounded; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lines: deque[bytes] = deque()
        self._bytes = 0
        self._begun = b""
        self.lines_dropped = 0

    def add(self, data: bytes) -> list[bytes]:
        """Adds bytes; returns the lines that they complete, truncated to the limit."""
        with self._lock:
            *whole, begun = (self._begun + data).split(b"\n")
            self._begun = begun[:LOG_LINE_BYTES]
            lines = [line[:LOG_LINE_BYTES] for line in whole]
            for line in lines:
                self._lines.append(line)
                self._bytes += len(line) + 1
                while self._bytes > LOG_BYTES:
                    self._bytes -= len(self._lines.popleft()) + 1
                    self.lines_dropped += 1
            return lines

    def lines(self) -> list[str]:
        with self._lock:
            shown = [*self._lines, self._begun] if self._begun else list(self._lines)
        return [line.decode("utf-8", "replace") for line in shown]


class Child:
    """A program in a separate session and process group. A thread starts it, reads its output and waits for its end.

    The kernel sends it `death_signal` when that thread ends, so also when this process ends.
    """

    def __init__(
        self, command: Sequence[str], death_signal: signal.Signals, serving: bytes, at_end: Callable[[], None]
    ):
        """`serving` is the prefix of the line that it prints when it is ready. `at_end` is called on the thread after
        it has ended and before `ended` is set. Raises OSError if it cannot be started.
        """
        self.log = Log()
        #: Exit status; None until it has ended; negative: minus the signal that killed it.
        self.status: int | None = None
        self.serving = threading.Event()
        #: Set when it is ready or has ended.
        self.settled = threading.Event()
        self.ended = threading.Event()
        self._serving_line, self._at_end = serving, at_end
        self._command = [
            sys.executable,
            "-I",
            "-S",
            die_with_parent.__file__,
            str(os.getpid()),
            str(int(death_signal)),
            *command,
        ]
        self._started = threading.Event()
        self._failure: OSError | None = None
        self._handle_lock = threading.Lock()
        #: A handle that stays valid if the process number is reused; None before the start and after the end.
        self._handle: int | None = None
        self._thread = threading.Thread(target=self._live, name=f"child {Path(command[0]).name}", daemon=True)
        self._thread.start()
        self._started.wait()
        if self._failure is not None:
            raise self._failure

    @property
    def pid(self) -> int:
        return self._process.pid

    def send(self, number: signal.Signals) -> None:
        """Sends a signal, if it has not ended."""
        with self._handle_lock, contextlib.suppress(ProcessLookupError):
            if self._handle is not None:
                signal.pidfd_send_signal(self._handle, number)

    def stop(self, timeout_s: float) -> bool:
        """Terminates it, then kills it after `timeout_s` seconds.

        Returns whether it has ended: the kernel may block it.
        """
        self.send(signal.SIGTERM)
        if self.ended.wait(timeout_s):
            return True
        self.send(signal.SIGKILL)
        return self.ended.wait(KILL_S)

    def _begin(self) -> int:
        """Starts it; returns a handle of the process. Raises OSError."""
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            return os.pidfd_open(self._process.pid)
        except OSError:  # without a handle it could not be ended
            with self._process:
                self._process.kill()
            raise

    def _live(self) -> None:
        try:
            self._handle = self._begin()
        except OSError as error:
            self._failure = error
            return
        finally:
            self._started.set()
        self._read_until_it_ends(self._handle)
        # It is still a zombie, so its process group number cannot be reused: its own children are killed with it.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        self._drain()
        with self._handle_lock:
            os.close(self._handle)
            self._handle = None
        self.status = self._process.wait()
        try:
            self._at_end()
        finally:
            self.settled.set()
            self.ended.set()

    def _read_until_it_ends(self, end: int) -> None:
        """Waits for the process and not for the end of its output, which its children may keep open."""
        assert self._process.stdout is not None
        output = self._process.stdout.fileno()
        os.set_blocking(output, False)
        waiting = select.poll()
        waiting.register(output, select.POLLIN)
        waiting.register(end, select.POLLIN)
        while end not in (ready := [fd for fd, _ in waiting.poll()]):
            if output in ready and not self._take(output):
                waiting.unregister(output)

    def _take(self, output: int) -> bool:
        """Reads once; False at the end of the output."""
        try:
            data = os.read(output, _READ_BYTES)
        except BlockingIOError:
            return True
        for line in self.log.add(data):
            if line.startswith(self._serving_line):
                self.serving.set()
                self.settled.set()
        return data != b""

    def _drain(self) -> None:
        """Reads the last output: at most the capacity of the pipe."""
        assert self._process.stdout is not None
        with self._process.stdout as output, contextlib.suppress(BlockingIOError):
            for _ in range(1 + (1 << 20) // _READ_BYTES):
                data = os.read(output.fileno(), _READ_BYTES)
                if not data:
                    return
                self.log.add(data)
