# SPDX-License-Identifier: Apache-2.0
"""VarClient: the variable server of a flight program or a simulator, in Python (docs/protocol.md, docs/variables.md).

    with VarClient("/run/user/1000/fc.sock") as client:
        client.set({"pilot.parameters.gain": 2.5})
        for sample in client.subscribe("nav.outputs.altitude", every=10):
            print(sample.tick, sample.values["nav.outputs.altitude"])

There is no thread, and no second connection: a client that is closed, or whose server went, is made anew by the caller.
"""

from __future__ import annotations

import base64
import json
import math
import socket
import struct
import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from .errors import TwinError
from .subscription import Sample, Subscription

#: Requests that are longer are refused here: the server would drop the client.
_REQUEST_BYTES_MAX = 64 * 1024
#: Of `tick_by_tick`: what may be under way.
_PAIRS_MAX, _UNREAD_BYTES = 100, 1 << 16
#: Of one recv(): more than 128 KiB would be mapped anew by every call.
_RECEIVE_BYTES = 1 << 16
_encode = json.JSONEncoder(separators=(",", ":")).encode
_decode = json.JSONDecoder().decode
_FRAME_MARK = 0xFF
#: Mark, version, subscription, payload bytes, tick, time_ns, lost.
_FRAME = struct.Struct("<BBHIQQQ")
_NON_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


#: The only fields whose words may be any.
_STATES = ("machine.state", "machine.next_state")


class VarError(TwinError):
    """What the server refused, or why it cannot be reached.

    `code` is one of docs/protocol.md, or of this side: `unreachable`, `closed`, `timeout`, `protocol`. `hint` is what was
    probably meant, `overwritten_by` whose value it is that cannot be set; or empty.
    """

    def __init__(self, code: str, message: str, hint: str = "", overwritten_by: str = ""):
        said = f"; did you mean `{hint}`?" if hint and code.startswith(("unknown", "bad_value")) else ""
        said += f" ({overwritten_by})" if overwritten_by else ""
        super().__init__(message + said)
        self.code, self.message, self.hint, self.overwritten_by = code, message, hint, overwritten_by


class _Reply(dict[str, Any]):
    """What a server says; one that leaves out what was asked for is none."""

    def __missing__(self, name: str) -> Any:
        raise VarError("protocol", f"not a variable server: its reply has no {name!r}")


class Checkpoint(NamedTuple):
    """A machine struct, with canonical NaNs, and the layout that it is of."""

    tick: int
    layout_hash: str
    data: bytes


class VarClient:
    """One connection. Every command is a method; a refusal is a VarError. Not for several threads at a time."""

    def __init__(self, address: str | Path, token: str | Path | None = None, timeout_s: float | None = 10.0):
        """Connects to a Unix socket's path, or to `tcp:HOST:PORT` with the server's token file.

        `timeout_s` is how long a reply may take (None: as long as it takes). Raises VarError.
        """
        self.address = str(address)
        self._timeout_s = timeout_s
        self._buffer = b""
        self._number = 0
        self._subscriptions: dict[int, Subscription] = {}
        self._socket = self._connect()
        self._limit_receive(timeout_s)
        if token is not None:
            self._call("authenticate", token=_read_token(Path(token)))

    def close(self) -> None:
        """Idempotent."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---- commands that look -----------------------------------------------------------------------------------------

    def get(self, *paths: str) -> dict[str, Any]:
        """The values at `paths`, all of one tick. A path of an instance or a struct gives a dict of what lies below."""
        values = self._call("get", paths=list(paths))["values"]
        return {path: self._numbers(path, value) for path, value in values.items()}

    def get_value(self, path: str) -> Any:
        """The value at one path."""
        return self.get(path)[path]

    def eval(self, expression: str) -> Any:
        """The value of a bounded arithmetic or boolean expression over fields of one tick."""
        value = self._call("eval", expression=expression)["value"]
        return _NON_FINITE.get(value, value) if isinstance(value, str) else value

    def state(self) -> dict[str, Any]:
        """`tick` (ticks completed), `state`, `next_state`, `paused`."""
        return self._call("state")

    def stats(self) -> dict[str, Any]:
        """The same, and what the program counts."""
        return self._call("stats")

    def list(self, prefix: str = "") -> Sequence[str]:
        """The paths that start with `prefix`."""
        paths: Sequence[str] = self._call("list", prefix=prefix)["paths"]
        return paths

    def describe(self, path: str | None = None) -> dict[str, Any]:
        """Role, type, unit, documentation, range of a field; without a path, the machine."""
        return self._call("describe") if path is None else self._call("describe", path=path)

    def save(self) -> Checkpoint:
        """The whole machine."""
        return _checkpoint(self._call("save"))

    # ---- commands that act --------------------------------------------------------------------------------------------

    def set(self, values: Mapping[str, Any], allow_non_finite: bool = False) -> dict[str, Any]:
        """Writes all of the values before the next tick or, when one is refused, none.

        The reply's `overwritten_by` names, for each path that something else writes, what does. NaN and infinities are
        refused unless asked for.
        """
        written = {path: _jsonable(value) for path, value in values.items()}
        return self._call("set", values=written, **({"allow_non_finite": True} if allow_non_finite else {}))

    def pause(self) -> dict[str, Any]:
        """From here on only `tick` moves the machine."""
        return self._call("pause")

    def resume(self) -> dict[str, Any]:
        """Lets the machine run by itself."""
        return self._call("resume")

    def tick(self, count: int = 1) -> int:
        """Runs ticks, while paused; returns the number completed since init."""
        self._number += 1
        # Written here: the encoder alone would take a tenth of the time of a tick.
        self._transmit(b'{"cmd":"tick","id":%d,"count":%d}\n' % (self._number, count))
        done: int = self._reply(self._number)["tick"]
        return done

    def tick_by_tick(self, count: int) -> Sequence[Checkpoint]:
        """Runs ticks, while paused; returns the whole machine as each of them left it.

        Several requests are under way at a time.
        """
        found: deque[Checkpoint] = deque()
        pairs = 1
        while len(found) < count:
            pairs = min(pairs, count - len(found))
            first = self._send([("tick", {}), ("save", {})] * pairs)
            for number in range(first, first + 2 * pairs, 2):
                self._reply(number)
                found.append(_checkpoint(self._reply(number + 1)))
            pairs = min(_PAIRS_MAX, max(1, _UNREAD_BYTES // (2 * len(found[0].data))))
        return found

    def set_state(self, state: str) -> dict[str, Any]:
        """Makes a state take force at once."""
        return self._call("set_state", state=state)

    def restore(self, checkpoint: Checkpoint) -> dict[str, Any]:
        """Puts back what `save` gave."""
        data = base64.b64encode(checkpoint.data).decode()
        return self._call("restore", layout_hash=checkpoint.layout_hash, data=data)

    def inject(self, instance: str, what: str) -> dict[str, Any]:
        """The next execute of an instance counts as a "fault" or an "overrun", or is "degraded" or "failed"."""
        return self._call("inject", instance=instance, what=what)

    def attach(self, channel: str) -> dict[str, Any]:
        """From here on a sensor channel is served: without samples it grows old."""
        return self._call("attach", channel=channel)

    def sample(self, channel: str, value: Any, age_ticks: int = 0, stamp_ns: int = 0) -> dict[str, Any]:
        """Gives a sensor channel a sample for the coming tick: its age in that tick, and its own time."""
        more = {key: number for key, number in (("age_ticks", age_ticks), ("stamp_ns", stamp_ns)) if number}
        return self._call("sample", channel=channel, value=_jsonable(value), allow_non_finite=True, **more)

    def record(self, bag: str | Path, name_space: str = "") -> dict[str, Any]:
        """Begins to record to a directory, of the server's side, that does not exist; while paused."""
        return self._call("record", bag=str(bag), **({"namespace": name_space} if name_space else {}))

    def stop_recording(self) -> dict[str, Any]:
        """Completes the bag; while paused."""
        return self._call("stop_recording")

    # ---- subscriptions ------------------------------------------------------------------------------------------------

    def subscribe(self, *paths: str, every: int = 1, binary: bool = False) -> Subscription:
        """Samples of the values at `paths` after every `every`-th tick, in order, to be iterated over.

        `binary` is for many values: a sample then takes the bytes of its scalars instead of their text.
        """
        machine = self.describe() if binary else {}
        types = {path: self.describe(path)["type"] for path in paths}
        now = self.get(*paths)
        request = {"paths": list(paths), "every": every, "format": "binary" if binary else "json"}
        reply = self._call("subscribe", **request)
        subscription = Subscription(self, reply["subscription"], types, now, machine)
        self._subscriptions[reply["subscription"]] = subscription
        return subscription

    def _unsubscribe(self, number: int) -> None:
        self._call("unsubscribe", subscription=number)
        self._subscriptions.pop(number, None)

    def _wait_for_sample(self, subscription: Subscription, timeout_s: float | None) -> bool:
        """Takes what comes in until this subscription has a sample; False when none came in time."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        self._limit_receive(timeout_s)
        try:
            while not subscription.waiting():
                # A reply here is one that an interrupted call did not wait for.
                if self._take() is None and not subscription.waiting() and not self._receive(deadline):
                    return False
            return True
        finally:
            self._limit_receive(self._timeout_s)

    # ---- requests and replies -----------------------------------------------------------------------------------------

    def _call(self, cmd: str, **members: Any) -> dict[str, Any]:
        """One command. Raises VarError for a refusal, and when no reply comes."""
        return self._reply(self._send([(cmd, members)]))

    def _send(self, commands: Sequence[tuple[str, dict[str, Any]]]) -> int:
        """Sends requests at once; returns the number of the first, which counts up to the last.

        Replies carry these numbers, so that one whose call was interrupted (Ctrl-C) is known and left aside.
        """
        first = self._number + 1
        lines = []
        for cmd, members in commands:
            self._number += 1
            line = _encode({"cmd": cmd, "id": self._number, **members}).encode() + b"\n"
            if len(line) > _REQUEST_BYTES_MAX:
                raise VarError(
                    "too_large", f"{cmd}: a request has at most {_REQUEST_BYTES_MAX} bytes, this one {len(line)}"
                )
            lines.append(line)
        self._transmit(b"".join(lines))
        return first

    def _transmit(self, lines: bytes) -> None:
        try:
            self._socket.sendall(lines)
        except OSError as error:
            # What the server said before it closed is the better reason, if there is anything.
            if not isinstance(error, (BrokenPipeError, ConnectionResetError)):
                raise self._lost(error) from None

    def _reply(self, number: int) -> dict[str, Any]:
        """The reply to request `number`. Raises the VarError that it holds."""
        deadline = None if self._timeout_s is None else time.monotonic() + self._timeout_s
        while True:
            reply = self._take()
            if reply is None:
                if not self._receive(deadline) or (deadline is not None and time.monotonic() > deadline):
                    raise VarError("timeout", f"{self.address}: no reply within {self._timeout_s:g} s")
            elif reply.get("id", number) == number:
                if reply.get("ok") is True:
                    return reply
                raise _refusal(reply)

    def _take(self) -> dict[str, Any] | None:
        """The next reply that has come in; samples before it go to their subscriptions."""
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
                message = _decode(line.decode())
                if "ok" in message:
                    return _Reply(message)
                values = {path: self._numbers(path, value) for path, value in message["values"].items()}
                sample = Sample(message["tick"], message["time_ns"], message["lost"], values)
            except (ValueError, KeyError, TypeError, AttributeError):
                raise VarError("protocol", f"{self.address}: not a variable server: it says {line[:80]!r}") from None
            self._deliver(message["subscription"], sample)
        return None

    def _take_frame(self) -> bool:
        """Takes a binary sample; False when it is not complete."""
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
        """A socket whose `recv` ends in time."""
        try:
            if self.address.startswith("tcp:"):
                host, _, port = self.address[4:].rpartition(":")
                if not port.isdigit():
                    raise VarError("unreachable", f"{self.address}: write tcp:HOST:PORT")
                connected = socket.create_connection((host.strip("[]"), int(port)), self._timeout_s)
                connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            else:
                connected = socket.socket(socket.AF_UNIX)
                connected.settimeout(self._timeout_s)
                connected.connect(self.address)
        except OSError as error:
            raise VarError("unreachable", f"{self.address}: {error.strerror or error}") from None
        connected.settimeout(None)
        return connected

    def _limit_receive(self, timeout_s: float | None) -> None:
        """In the kernel: a Python time limit costs a poll() for every recv(). There 0 is no limit."""
        limit_us = 0 if timeout_s is None else max(1, int(timeout_s * 1e6))
        packed = struct.pack("@ll", *divmod(limit_us, 1_000_000))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, packed)

    def _receive(self, deadline: float | None) -> bool:
        """Takes in some bytes, if any come; False when none came until `deadline`. Raises VarError when the server is gone."""
        try:
            data = self._socket.recv(_RECEIVE_BYTES)
        except BlockingIOError:
            return deadline is None or time.monotonic() < deadline
        except OSError as error:
            raise self._lost(error) from None
        if not data:
            raise VarError("closed", f"{self.address}: the server has closed the connection")
        self._buffer += data
        return True

    def _lost(self, error: OSError) -> VarError:
        return VarError("closed", f"{self.address}: {error.strerror or error}")

    # ---- values -----------------------------------------------------------------------------------------------------------

    def _numbers(self, path: str, value: Any) -> Any:
        """NaN and infinities are words in JSON; a state may be called so, too."""
        if isinstance(value, dict):
            return {k: self._numbers(path + ("" if k.startswith("[") else ".") + k, v) for k, v in value.items()}
        if isinstance(value, list):
            return [self._numbers(path, item) for item in value]
        if isinstance(value, str) and value in _NON_FINITE and not path.endswith(_STATES):
            return _NON_FINITE[value]
        return value


def _checkpoint(reply: dict[str, Any]) -> Checkpoint:
    return Checkpoint(reply["tick"], reply["layout_hash"], base64.b64decode(reply["data"]))


def _jsonable(value: Any) -> Any:
    """Numbers, texts, lists; NumPy's own arrays and scalars; NaN and infinities as words."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {name: _jsonable(member) for name, member in value.items()}
    if isinstance(value, (list, tuple)):
        return [_jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value


def _read_token(path: Path) -> str:
    try:
        return path.read_text().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise VarError("unauthorized", f"{path}: {getattr(error, 'strerror', None) or error}") from None


def _refusal(reply: dict[str, Any]) -> VarError:
    error = reply.get("error", {})
    return VarError(*(error.get(name, "") for name in ("code", "message", "hint", "overwritten_by")))
