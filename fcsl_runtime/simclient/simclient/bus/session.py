# SPDX-License-Identifier: Apache-2.0
"""A session on the bus: a client of one that listens, or the one that listens. It looks for nobody."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any, NamedTuple

from ..errors import BusError
from .endpoint import zenoh_locator
from .machine import BusMachine, read_machine

_CONNECT_MS = 2000
_DESCRIBE_S = 2.0
_POLL_S = 0.2
#: A link that was lost is back after so many looks, or the one that listens is gone. Looks, not time: a process that was
#: frozen has not looked meanwhile.
_DISCONNECTED_POLLS = 5
#: Zenoh refuses longer ones; those of FCSL have 1 MiB at most.
_MESSAGE_BYTES_MAX = 2 << 20
#: Most messages, and bytes of them, that wait to be read; of more, the newest are dropped and counted.
_WAITING_MAX, _WAITING_BYTES_MAX = 100_000, 64 << 20


class Message(NamedTuple):
    key: str
    data: bytes


class Question:
    """A query under way."""

    def __init__(self, replies: Any, failure: type[Exception]):
        self._replies, self._failure = replies, failure
        self.is_over = False

    def answer(self) -> bytes | None:
        """The first answer, once it has come."""
        try:
            while (reply := self._replies.try_recv()) is not None:
                if reply.ok is not None:
                    self.is_over = True
                    return bytes(reply.ok.payload)
        except self._failure:  # no answer will come
            self.is_over = True
        return None


class Session:
    """Connected to `endpoint` (tcp:HOST:PORT), or listening there. A context manager. Raises BusError."""

    def __init__(self, endpoint: str, listens: bool = False):
        self.endpoint = endpoint
        self._listens = listens
        self.dropped = 0
        self._stopped = False
        self._polls_alone = 0  # without the one that listens, one after the other
        self._zenoh = _zenoh()
        self._session = self._open()
        self._waiting: deque[Message] = deque()
        self._bytes = 0
        self._news = threading.Condition()
        self._subscribers: list[Any] = []

    def _open(self) -> Any:
        locator = zenoh_locator(self.endpoint)
        here, there = ([locator], []) if self._listens else ([], [locator])
        settings = {
            "mode": "peer" if self._listens else "client",
            "connect": {
                "endpoints": there,
                "timeout_ms": _CONNECT_MS,
                "exit_on_failure": True,
                "retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2},
            },
            "listen": {"endpoints": here},
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "transport": {
                "link": {"tx": {"lease": 1000, "keep_alive": 4}, "rx": {"max_message_size": _MESSAGE_BYTES_MAX}}
            },
        }
        try:
            return self._zenoh.open(self._zenoh.Config.from_json5(json.dumps(settings)))
        except self._zenoh.ZError:
            if self._listens:
                raise BusError(
                    f"cannot listen on {self.endpoint}: it is taken, or no address of this machine"
                ) from None
            raise BusError(
                f"no bus listens on {self.endpoint}: start fcsl-fc or fcsl-sim with --observers {self.endpoint}"
            ) from None

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._session.close()

    def machines(self) -> tuple[list[BusMachine], list[str]]:
        """All that answer, by their keys, and why others cannot be read. Raises BusError when there is none."""
        found: dict[str, BusMachine] = {}
        refused: dict[str, str] = {}
        deadline = time.monotonic() + _DESCRIBE_S
        while not found and time.monotonic() < deadline:
            replies = self._session.get("**/@descriptor", target=self._zenoh.QueryTarget.ALL, timeout=_DESCRIBE_S)
            for reply in replies:
                prefix = str(reply.ok.key_expr).rpartition("/")[0] if reply.ok is not None else ""
                if prefix.isprintable() and prefix and "*" not in prefix:  # anybody may answer
                    try:
                        found[prefix] = read_machine(prefix, bytes(reply.ok.payload).decode("utf-8", "replace"))
                    except BusError as error:
                        refused[prefix] = str(error)
            time.sleep(0 if found else _POLL_S)
        if not found:
            why = f"no machine is on {self.endpoint}: it is served by fcsl-fc and fcsl-sim with --observers"
            raise BusError(min(refused.values(), default=why))
        return [machine for _, machine in sorted(found.items())], [why for _, why in sorted(refused.items())]

    def subscribe(self, machines: Iterable[BusMachine], *names: str) -> None:
        """`messages` brings what comes from now on: all values and commits, then what is under these names, too."""
        # On Zenoh's own thread: one thread for each subscriber would lose the order among them.
        receive_token = self._zenoh.handlers.Callback(self._receive, indirect=False)
        for machine in machines:
            for name in ("*", *names):
                subscriber = self._session.declare_subscriber(
                    f"{machine.prefix}/{name}", receive_token, allowed_origin=self._zenoh.Locality.REMOTE
                )
                self._subscribers.append(subscriber)

    def query(self, key: str) -> Question:
        """Asks for what is under the key; does not wait."""
        return Question(self._session.get(key, timeout=_DESCRIBE_S), self._zenoh.ZError)

    def _receive(self, sample: Any) -> None:
        """On a thread of Zenoh's."""
        if sample.kind != self._zenoh.SampleKind.PUT:
            return
        message = Message(str(sample.key_expr), bytes(sample.payload))
        with self._news:
            if len(self._waiting) >= _WAITING_MAX or self._bytes >= _WAITING_BYTES_MAX:
                self.dropped += 1
                return
            self._waiting.append(message)
            self._bytes += len(message.data)
            self._news.notify()

    def messages(self, until_s: float | None = None) -> Iterator[Message | None]:
        """What came, in its order; None where nothing more has come yet. Ends at `until_s` of time.monotonic(), after
        `stop`, or when the one that listens is gone."""
        while not self._stopped and (until_s is None or time.monotonic() < until_s):
            with self._news:
                if not self._waiting:
                    left_s = _POLL_S if until_s is None else min(_POLL_S, max(0.0, until_s - time.monotonic()))
                    self._news.wait(left_s)
                batch, self._waiting, self._bytes = self._waiting, deque(), 0
            yield from batch
            yield None
            self._polls_alone = 0 if batch or self._is_connected() else self._polls_alone + 1
            if self._polls_alone > _DISCONNECTED_POLLS:
                return

    def receive(self, until_s: float) -> Message | None:
        """The next message; None when none has come until then."""
        with self._news:
            while not self._waiting and (left_s := until_s - time.monotonic()) > 0:
                self._news.wait(left_s)
            if not self._waiting:
                return None
            message = self._waiting.popleft()
            self._bytes -= len(message.data)
            return message

    def declare_token(self, key: str) -> None:
        """While the session lives, others see it: the key, and the session's number behind it."""
        self._subscribers.append(self._session.liveliness().declare_token(f"{key}/{self._session.zid()}"))

    def watch_tokens(self, key: str) -> set[str]:
        """The tokens of others under this expression, kept up to date."""
        alive: set[str] = set()

        def receive_token(sample: Any) -> None:
            change = alive.add if sample.kind == self._zenoh.SampleKind.PUT else alive.discard
            change(str(sample.key_expr))

        self._subscribers.append(self._session.liveliness().declare_subscriber(key, receive_token, history=True))
        return alive

    def stop(self) -> None:
        """Ends `messages`. May be called by a signal's handler."""
        self._stopped = True

    def _is_connected(self) -> bool:
        info = self._session.info
        return bool(info.peers_zid() or info.routers_zid())

    def put(self, key: str, data: bytes) -> None:
        self._session.put(key, data, congestion_control=self._zenoh.CongestionControl.BLOCK)


def _zenoh() -> Any:
    try:
        import zenoh
    except ImportError:
        raise BusError("the bus needs the Python package eclipse-zenoh: pip install eclipse-zenoh") from None
    return zenoh
