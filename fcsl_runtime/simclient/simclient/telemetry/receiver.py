# SPDX-License-Identifier: Apache-2.0
"""Telemetry: receives the UDP packets of a flight program or simulator, and returns windows of NumPy columns."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self

from ..descriptor import Machine
from ..errors import TwinError
from ..paths import resolve
from ..values import Value, read_part
from .collector import Collector
from .configuration import Channel, Configuration
from .counts import Counts
from .limits import DATAGRAM_BYTES_MAX
from .stream import Stream
from .window import Window

#: Requested size of the kernel's receive buffer in bytes; the kernel may grant less.
_SOCKET_BYTES = 4 << 20
#: Datagrams processed before the lock is released to readers.
_BATCH = 256


class Telemetry:
    """The newest `window_ticks` packets of one sender (docs/guide/monitoring.md).

    `with Telemetry(9870) as telemetry:` listens on 127.0.0.1:9870 and receives in a separate thread. Without `with`,
    `start` begins that thread, or the caller receives with `poll`. Port 0 selects any free port (`.port`). With no
    port, only `feed` adds datagrams. All methods are thread-safe. Raises TwinError.
    """

    def __init__(self, port: int | None = None, host: str = "127.0.0.1", window_ticks: int = 10_000):
        if window_ticks < 1:
            raise TwinError(f"window_ticks={window_ticks}: a window has at least one row")
        self._changed = threading.Condition()
        #: Protects the socket and thread, which `start` opens once and `close` closes once.
        self._life = threading.Lock()
        self._collector = Collector(window_ticks)
        self._window_ticks = window_ticks
        self._thread: threading.Thread | None = None
        self._wake = -1
        self._socket = None if port is None else _listen(host, port)

    # ---- receiving ---------------------------------------------------------------------------------------------------

    @property
    def port(self) -> int:
        """The port on which it listens."""
        return int(self._open_socket().getsockname()[1])

    def start(self) -> Self:
        """Receives in a separate thread from now on, until `close`."""
        with self._life:
            self._open_socket()
            if self._thread is None:
                self._wake = os.eventfd(0)
                self._thread = threading.Thread(target=self._receive, name="telemetry", daemon=True)
                self._thread.start()
        return self

    def close(self) -> None:
        """Processes the datagrams received by now, then stops. Received data can still be read. Idempotent."""
        with self._life:
            if self._thread is not None:
                os.eventfd_write(self._wake, 1)
                self._thread.join()
                os.close(self._wake)
                self._thread = None
            if self._socket is not None:
                self._socket.close()
                self._socket = None

    def __enter__(self) -> Self:
        return self if self._socket is None else self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def feed(self, datagram: bytes | bytearray | memoryview) -> None:
        """Processes one datagram; invalid bytes never raise."""
        with self._changed:
            self._collector.take(bytes(datagram), time.monotonic())
            self._changed.notify_all()

    def poll(self, timeout_s: float | None = 0.0) -> int:
        """Processes received datagrams; waits up to `timeout_s` (None: without limit) for the first. Returns their
        number.

        For callers that do not `start` the thread.
        """
        if self._thread is not None:
            raise TwinError("this Telemetry receives in its thread; poll() works only without start()")
        sock = self._open_socket()
        poller = select.poll()
        poller.register(sock, select.POLLIN)
        poller.poll(None if timeout_s is None else timeout_s * 1e3)
        return self._take_all(sock)

    def wait(self, timeout_s: float = 10.0, ticks: int = 1, after: Window | None = None) -> None:
        """Returns when the window has `ticks` rows (newer than those of `after`, if given).

        Raises TwinError after `timeout_s`, with a summary of what was received instead.
        """
        if ticks > self._window_ticks:
            raise TwinError(f"{ticks} ticks cannot be in a window of {self._window_ticks}; give a larger window_ticks")
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0 and self._rows(ticks, after) < ticks:
            if self._thread is None and self._socket is not None:
                self.poll(left)
                continue
            with self._changed:
                self._changed.wait_for(lambda: self._rows(ticks, after) >= ticks, left)
        if self._rows(ticks, after) < ticks:
            raise TwinError(
                f"no {ticks} tick{'s' * (ticks != 1)} of telemetry within {timeout_s:g} s: {self._summary()}"
            )

    # ---- reading -----------------------------------------------------------------------------------------------------

    @property
    def session(self) -> int | None:
        """A random number that the sender chose at its start; None until a configuration is complete."""
        with self._changed:
            stream = self._collector.stream
            return None if stream is None else stream.key[0]

    @property
    def configuration(self) -> Configuration:
        """The sender's configuration. Raises TwinError until it is complete."""
        with self._changed:
            return self._stream().configuration

    @property
    def machine(self) -> Machine:
        """The sender's machine: `name`, `source_hash`, `tick_hz`, `states`, and the sent ones of its `fields`."""
        return self.configuration.machine

    @property
    def channels(self) -> dict[str, Channel]:
        """The sent channels: type, shape, unit and labels by path."""
        return dict(self.configuration.channels)

    @property
    def counts(self) -> Counts:
        """A copy of the current counts of received datagrams."""
        with self._changed:
            return self._collector.counts()

    @property
    def window_bytes(self) -> int:
        """The memory of the window's rows in bytes."""
        with self._changed:
            stream = self._collector.stream
            return 0 if stream is None else stream.ring.used_bytes

    def latest(self, path: str) -> Value:
        """The value at the newest tick of a field, a struct, or a part of either, as a twin's `get_value` returns it."""
        with self._changed:
            stream = self._stream()
            part = resolve(path, stream.configuration.machine)
            row = self._newest_row(stream)
        return read_part(part, lambda offset, size: row[offset : offset + size], stream.configuration.machine)

    def window(self, paths: str | Sequence[str] = (), n: int | None = None, after: Window | None = None) -> Window:
        """The last `n` rows (default: all) of these paths, or of all channels.

        With `after`, only rows newer than that window; all rows, if the window is of another session.
        """
        if n is not None and (not hasattr(n, "__index__") or n < 1):
            raise TwinError(f"n={n!r}: expected a number of rows, 1 or more; without n the window has all rows")
        with self._changed:
            stream = self._stream()
            sequences = stream.ring.held(n, _behind(stream, after))
            wanted = (paths,) if isinstance(paths, str) else paths
            return Window(stream.configuration, stream.ring, stream.key[0], sequences, wanted)

    # ---- inside ------------------------------------------------------------------------------------------------------

    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise TwinError("this Telemetry has no port, or was closed; make one with Telemetry(port=...)")
        return self._socket

    def _stream(self) -> Stream:
        if self._collector.stream is None:
            raise TwinError(f"no telemetry yet: {self._summary()}")
        return self._collector.stream

    def _newest_row(self, stream: Stream) -> bytes:
        if stream.ring.newest < 0:
            raise TwinError(f"no tick of telemetry yet: {self._summary()}")
        return stream.ring.row(stream.ring.newest)

    def _rows(self, count: int, after: Window | None) -> int:
        with self._changed:
            stream = self._collector.stream
            return 0 if stream is None else len(stream.ring.held(count, _behind(stream, after)))

    def _summary(self) -> str:
        """What was received so far, for error messages."""
        with self._changed:
            counts, shown = self._collector.counts(), self._collector.stream is not None
        place = f" on port {self.port}" if self._socket is not None else ""
        if not counts.received:
            return f"nothing received{place}; start the sender with --telemetry udp:HOST:PORT"
        if counts.malformed == counts.received:
            return f"none of {counts.received} datagrams received{place} is telemetry of this version"
        if not shown:
            return f"{counts.received} datagrams received{place}, but no complete configuration; it is sent every 10 s"
        return f"{counts.packets} packets received{place}; the sender may be paused"

    def _receive(self) -> None:
        sock = self._open_socket()
        poller = select.poll()
        poller.register(sock, select.POLLIN)
        poller.register(self._wake, select.POLLIN)
        while all(descriptor != self._wake for descriptor, _ in poller.poll()):
            self._take_all(sock)
        # Datagrams sent before close() belong to the window, too: at most those in the kernel's buffer.
        for _ in range(_SOCKET_BYTES // _BATCH):
            if self._take_all(sock) < _BATCH:
                return

    def _take_all(self, sock: socket.socket) -> int:
        """Processes the datagrams in the kernel's buffer, up to a batch."""
        taken = 0
        with self._changed:
            with suppress(BlockingIOError):  # the buffer is empty
                while taken < _BATCH:
                    self._collector.take(sock.recv(DATAGRAM_BYTES_MAX), time.monotonic())
                    taken += 1
            self._changed.notify_all()
        return taken


def _behind(stream: Stream, after: Window | None) -> int:
    """The sequence number after which rows are new to the owner of that window."""
    if after is not None and not isinstance(after, Window):
        raise TwinError(f"after={after!r}: expected a Window that window() returned")
    if after is None or after.session != stream.key[0] or not len(after):
        return -1
    return int(after.sequence[-1])


def _listen(host: str, port: int) -> socket.socket:
    """A bound, non-blocking socket. Raises TwinError."""
    if not isinstance(port, int) or not 0 <= port <= 65_535:  # getaddrinfo would use its low 16 bits
        raise TwinError(f"cannot listen on {host}:{port}: a port is a whole number from 0 to 65535")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        sock = socket.socket(family, kind, protocol)
    except OSError as error:
        raise TwinError(f"cannot listen on {host}:{port}: {error}") from None
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SOCKET_BYTES)
        sock.bind(address)
    except OSError as error:
        sock.close()
        raise TwinError(f"cannot listen on {host}:{port}: {error}; give another port, or 0 for any free port") from None
    sock.setblocking(False)
    return sock
