# SPDX-License-Identifier: Apache-2.0
"""VarWire: one connection to a variable server: sends requests, receives replies and samples (docs/reference/variables.md)."""

from __future__ import annotations

import json
import math
import socket
import struct
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ..errors import TwinError
from .subscription import Sample, Subscription

#: Longer requests are rejected here, because the server would drop the client.
_REQUEST_BYTES_MAX = 64 * 1024
#: Bytes of one recv(): above 128 KiB every call would map new memory.
_RECEIVE_BYTES = 1 << 16
_encode = json.JSONEncoder(separators=(",", ":")).encode
_decode = json.JSONDecoder().raw_decode
_FRAME_MARK = 0xFF
#: Mark, version, subscription, payload bytes, tick, time_ns, lost.
_FRAME = struct.Struct("<BBHIQQQ")
NON_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
#: Text fields of a reply that may have any content, such as a name "nan".
_STATES = ("machine.state", "machine.next_state")


class VarError(TwinError):
    """A refusal of the server, or a failure to reach it.

    `code` is one of docs/reference/variables.md, or of the client: `unreachable`, `closed`, `timeout`, `protocol`. `hint` is the
    probable spelling, `overwritten_by` the writer of a value that cannot be set; both may be empty.
    """

    def __init__(self, code: str, message: str, hint: str = "", overwritten_by: str = ""):
        details = f"; did you mean `{hint}`?" if hint and code.startswith(("unknown", "bad_value")) else ""
        details += f": `{hint}` first" if hint and code == "not_paused" else ""
        details += f" ({overwritten_by})" if overwritten_by else ""
        super().__init__(message + details)
        self.code, self.message, self.hint, self.overwritten_by = code, message, hint, overwritten_by


def _after(limit_s: float | None) -> float | None:
    """The deadline on the monotonic clock, in s."""
    return None if limit_s is None else time.monotonic() + limit_s


def _limit(connected: socket.socket, option: int, limit_s: float | None) -> None:
    """Sets a timeout in the kernel (0: none): Python's timeouts cost a poll() for every recv()."""
    limit_us = 0 if limit_s is None else max(1, int(limit_s * 1e6))
    connected.setsockopt(socket.SOL_SOCKET, option, struct.pack("@ll", *divmod(limit_us, 1_000_000)))


def encoded(members: Mapping[str, Any]) -> bytes:
    """The members of a request behind its "cmd" and "id", to the closing brace."""
    return f",{_encode(members)[1:]}".encode() if members else b"}"


class _Reply(dict[str, Any]):
    """A reply of the server; access to a missing member is a protocol error."""

    def __missing__(self, name: str) -> Any:
        raise VarError("protocol", f"not a variable server: its reply has no {name!r}")


class VarWire:
    """The connection under VarClient. Every failure is a VarError."""

    def __init__(self, address: str | Path, timeout_s: float | None):
        self.address = str(address)
        self._timeout_s = timeout_s
        self._buffer = b""
        self._number = 0
        self._subscriptions: dict[int, Subscription] = {}
        #: The kernel's timeout for receiving.
        self._receive_limit_s: float | None = None
        self._socket = self._connect()

    def close(self) -> None:
        """Idempotent."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _wait_for_sample(self, subscription: Subscription, timeout_s: float | None) -> bool:
        """Receives until this subscription has a sample; False if none arrives in time."""
        deadline, in_time = _after(timeout_s), True
        while not subscription.waiting():
            # A reply here belongs to an earlier call that was interrupted.
            if self._take() is None and not subscription.waiting():
                if not in_time:
                    return False
                in_time = self._receive(deadline)
        return True

    # ---- requests and replies -----------------------------------------------------------------------------------------

    def _call(self, cmd: str, **members: Any) -> dict[str, Any]:
        """Runs one command. Raises VarError for a refusal, and if no reply comes."""
        return self._call_encoded(cmd, encoded(members))

    def _call_encoded(self, cmd: str, members: bytes) -> dict[str, Any]:
        """As `_call`. `members` is what `encoded` makes of them: encoding takes a fifth of the time of a `get`."""
        self._transmit(self._line(cmd, members))
        return self._reply(self._number)

    def _send(self, commands: Sequence[tuple[str, dict[str, Any]]]) -> int:
        """Sends several requests together; returns the number of the first. Numbers are consecutive."""
        first = self._number + 1
        self._transmit(b"".join([self._line(cmd, encoded(members)) for cmd, members in commands]))
        return first

    def _line(self, cmd: str, members: bytes) -> bytes:
        """A request with the next number.

        The reply carries it, so that the reply to an interrupted call (Ctrl-C) is recognised and dropped.
        """
        self._number += 1
        line = b'{"cmd":"%b","id":%d%b\n' % (cmd.encode(), self._number, members)
        if len(line) > _REQUEST_BYTES_MAX:
            raise VarError(
                "too_large", f"{cmd}: a request has at most {_REQUEST_BYTES_MAX} bytes, this one {len(line)}"
            )
        return line

    def _transmit(self, lines: bytes) -> None:
        try:
            self._socket.sendall(lines)
        except BlockingIOError:
            self.close()  # an unknown part of the request was sent
            raise VarError("timeout", f"{self.address}: it accepts no request within {self._timeout_s:g} s") from None
        except OSError as error:
            # The server's last message, if any, explains better why it closed the connection.
            if not isinstance(error, (BrokenPipeError, ConnectionResetError)):
                raise self._lost(error) from None

    def _reply(self, number: int) -> dict[str, Any]:
        """The reply to request `number`. Raises VarError if it is a refusal."""
        deadline, in_time = _after(self._timeout_s), True
        while True:
            reply = self._take()
            if reply is None:
                if not in_time:
                    raise VarError("timeout", f"{self.address}: no reply within {self._timeout_s:g} s")
                in_time = self._receive(deadline)
            elif reply.get("id", number) == number:
                if reply.get("ok") is True:
                    return reply
                raise _refusal(reply)

    def _take(self) -> dict[str, Any] | None:
        """The next received reply; delivers samples before it to their subscriptions."""
        while self._buffer:
            if self._buffer[0] == _FRAME_MARK:
                if not self._take_frame():
                    return None
                continue
            line, newline, rest = self._buffer.partition(b"\n")
            if not newline:
                return None
            self._buffer = rest
            try:
                text = line.decode()
                message, end = _decode(text)
                if end != len(text):
                    raise ValueError("there is more than a message")
                if "ok" in message:
                    return _Reply(message)
                values = {path: self._numbers(path, value) for path, value in message["values"].items()}
                sample = Sample(message["tick"], message["time_ns"], message["lost"], values)
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
                raise VarError("protocol", f"{self.address}: not a variable server: it sent {line[:80]!r}") from None
            self._deliver(message["subscription"], sample)
        return None

    def _take_frame(self) -> bool:
        """Takes a binary sample; False if it is not complete."""
        if len(self._buffer) < _FRAME.size:
            return False
        _, version, number, size, tick, time_ns, lost = _FRAME.unpack_from(self._buffer)
        if version != 1:
            raise VarError("protocol", f"{self.address}: binary samples of version {version}; this client reads 1")
        if len(self._buffer) < _FRAME.size + size:
            return False
        payload = self._buffer[_FRAME.size : _FRAME.size + size]
        self._buffer = self._buffer[_FRAME.size + size :]
        if number in self._subscriptions:
            values = self._subscriptions[number].unpack(payload)
            self._deliver(number, Sample(tick, time_ns, lost, values))
        return True

    def _deliver(self, number: int, sample: Sample) -> None:
        if number in self._subscriptions:
            self._subscriptions[number].put(sample)

    # ---- bytes ----------------------------------------------------------------------------------------------------------

    def _connect(self) -> socket.socket:
        """A blocking socket with a timeout for sending."""
        try:
            if self.address.startswith("tcp:"):
                host, _, port = self.address[4:].rpartition(":")
                if not (port.isascii() and port.isdecimal() and len(port) < 6 and int(port) < 1 << 16):
                    raise VarError("unreachable", f"{self.address}: write tcp:HOST:PORT, with a port below 65536")
                connected = socket.create_connection((host.strip("[]"), int(port)), self._timeout_s)
                connected.settimeout(None)
                connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                _limit(connected, socket.SO_SNDTIMEO, self._timeout_s)
            else:
                connected = socket.socket(socket.AF_UNIX)
                _limit(
                    connected, socket.SO_SNDTIMEO, self._timeout_s
                )  # also limits connect(), which waits for room in the server's queue
                connected.connect(self.address)
        except BlockingIOError:
            reason = f"it accepts no connection within {self._timeout_s:g} s"
            raise VarError("unreachable", f"{self.address}: {reason}") from None
        except OSError as error:
            raise VarError("unreachable", f"{self.address}: {error.strerror or error}") from None
        return connected

    def _receive(self, deadline: float | None) -> bool:
        """Receives available bytes; returns whether the deadline has not passed.

        Raises VarError if the server is gone.
        """
        try:
            self._limit_receiving(None if deadline is None else deadline - time.monotonic())
            data = self._socket.recv(_RECEIVE_BYTES)
        except BlockingIOError:
            return deadline is None or time.monotonic() < deadline
        except OSError as error:
            raise self._lost(error) from None
        if not data:
            raise VarError("closed", f"{self.address}: the server has closed the connection")
        self._buffer += data
        return deadline is None or time.monotonic() < deadline

    def _limit_receiving(self, limit_s: float | None) -> None:
        """Leaves a timeout that is right to a hundredth: setting one is a system call, and each request has its own."""
        known_s = self._receive_limit_s
        if limit_s is None or known_s is None:
            right = limit_s is known_s
        else:
            right = abs(limit_s - known_s) * 100 < limit_s
        if not right:
            _limit(self._socket, socket.SO_RCVTIMEO, limit_s)
            self._receive_limit_s = limit_s

    def _lost(self, error: OSError) -> VarError:
        return VarError("closed", f"{self.address}: {error.strerror or error}")

    # ---- values -----------------------------------------------------------------------------------------------------------

    def _numbers(self, path: str, value: Any) -> Any:
        """Converts NaN and infinities, which are strings in JSON, back to numbers; a state may have such a name, too."""
        if isinstance(value, dict):
            return {k: self._numbers(path + ("" if k.startswith("[") else ".") + k, v) for k, v in value.items()}
        if isinstance(value, list):
            return [self._numbers(path, item) for item in value]
        if isinstance(value, str) and value in NON_FINITE and not path.endswith(_STATES):
            return NON_FINITE[value]
        return value


def _refusal(reply: dict[str, Any]) -> VarError:
    error = reply.get("error", {})
    return VarError(*(error.get(name, "") for name in ("code", "message", "hint", "overwritten_by")))
