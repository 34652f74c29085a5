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
import math
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from .subscription import Subscription
from .wire import NON_FINITE, VarError, VarWire

#: Of `tick_by_tick`: what may be under way.
_PAIRS_MAX, _UNREAD_BYTES = 100, 1 << 16
#: Of a checkpoint, in one request: its text must leave room for the rest.
_PORTION_BYTES = 48_000


class Reading(NamedTuple):
    """Of the simulated hardware; `failures` are the accesses of the machine that it refused so far."""

    value: Any
    failures: int


class VarClient(VarWire):
    """One connection. Every command is a method; a refusal is a VarError. Not for several threads at a time."""

    def __init__(self, address: str | Path, token: str | Path | None = None, timeout_s: float | None = 10.0):
        """Connects to a Unix socket's path, or to `tcp:HOST:PORT` with the server's token file.

        `timeout_s` is how long a reply may take, or the sending of a request (None: as long as it takes). Raises VarError.
        """
        super().__init__(address, timeout_s)
        if token is not None:
            self._call("authenticate", token=_read_token(Path(token)))

    # ---- commands that look -----------------------------------------------------------------------------------------

    def get(self, *paths: str) -> dict[str, Any]:
        """The values at `paths`, all of one tick. A path of an instance or a struct gives a dict of what lies below."""
        values = self._call("get", paths=list(paths))["values"]
        if not isinstance(values, dict):
            raise VarError("protocol", f"{self.address}: not a variable server: its values are no object")
        return {path: self._numbers(path, value) for path, value in values.items()}

    def get_value(self, path: str) -> Any:
        """The value at one path."""
        return self.get(path)[path]

    def eval(self, expression: str) -> Any:
        """The value of a bounded arithmetic or boolean expression over fields of one tick."""
        value = self._call("eval", expression=expression)["value"]
        return NON_FINITE.get(value, value) if isinstance(value, str) else value

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
        if type(count) is not int:
            return int(self._call("tick", count=_jsonable(count))["tick"])
        self._number += 1
        # Written here: the encoder alone would take a tenth of the time of a tick.
        self._transmit(b'{"cmd":"tick","id":%d,"count":%d}\n' % (self._number, count))
        done: int = self._reply(self._number)["tick"]
        return done

    def tick_by_tick(self, count: int) -> Sequence[bytes]:
        """Runs ticks, while paused; returns the checkpoint of the machine as each of them left it.

        Several requests are under way at a time.
        """
        found: deque[bytes] = deque()
        pairs = 1
        while len(found) < count:
            pairs = min(pairs, count - len(found))
            first = self._send([("tick", {}), ("save", {})] * pairs)
            for number in range(first, first + 2 * pairs, 2):
                self._reply(number)
                found.append(self._whole(self._reply(number + 1)))
            # One pair at a time where a checkpoint comes in portions, which the next one would take the place of.
            pairs = min(_PAIRS_MAX, max(1, _UNREAD_BYTES // (2 * len(found[0]))))
        return found

    def set_state(self, state: str) -> dict[str, Any]:
        """Makes a state take force at once."""
        return self._call("set_state", state=state)

    def save(self) -> bytes:
        """The whole machine, as the content of a checkpoint file (docs/checkpoints.md), of any size."""
        return self._whole(self._call("save"))

    def save_to(self, name: str) -> dict[str, Any]:
        """The same into a file of the folder that the program was started with (`--checkpoints`)."""
        return self._call("save", file=name)

    def restore(self, checkpoint: bytes, other_source: bool = False) -> dict[str, Any]:
        """Puts back what `save` gave, or a checkpoint file holds. `other_source`: one of other sources is meant, too."""
        more = {"other_source": True} if other_source else {}
        if len(checkpoint) <= _PORTION_BYTES:
            return self._call("restore", data=_text(checkpoint), **more)
        for at in range(0, len(checkpoint), _PORTION_BYTES):
            place = {"at": at} if at else {"bytes": len(checkpoint)}
            self._call("load", data=_text(checkpoint[at : at + _PORTION_BYTES]), **place)
        return self._call("restore", **more)

    def restore_from(self, name: str, other_source: bool = False) -> dict[str, Any]:
        """Puts back what a file of the program's folder holds."""
        return self._call("restore", file=name, **({"other_source": True} if other_source else {}))

    def _whole(self, reply: dict[str, Any]) -> bytes:
        """The checkpoint that a reply to `save` begins."""
        data = base64.b64decode(reply["data"])
        while len(data) < reply["bytes"]:
            more = base64.b64decode(self._call("saved", at=len(data))["data"])
            if not more:
                raise VarError("protocol", f"{self.address}: not a variable server: a checkpoint goes on without bytes")
            data += more
        return data

    def hardware(self, bank: str, number: int, value: Any = None) -> Reading:
        """What a pin, channel or register of the simulated hardware is, once `value` has been put in, if there is one.

        `bank` is "gpio" (bool), "adc" (counts) or "registers" (`number` is the address).
        """
        given = {} if value is None else {"value": _jsonable(value)}
        reply = self._call("hardware", bank=bank, number=number, **given)
        return Reading(reply["value"], reply["failures"])

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


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


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
