# SPDX-License-Identifier: Apache-2.0
"""VarClient: the variable server of a flight program or a simulator, in Python (docs/reference/variables.md, docs/reference/variables.md).

    with VarClient("/run/user/1000/fc.sock") as client:
        client.set({"pilot.parameters.gain": 2.5})
        for sample in client.subscribe("nav.outputs.altitude", every=10):
            print(sample.tick, sample.values["nav.outputs.altitude"])

It uses one connection and no thread. After `close` or a lost connection the caller makes a new client.
"""

from __future__ import annotations

import base64
import math
from collections import deque
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from .subscription import Subscription
from .wire import NON_FINITE, VarError, VarWire, encoded

#: Most requests (of `tick_by_tick`: pairs) without a reply.
_PENDING_MAX, _UNREAD_BYTES = 100, 1 << 16
#: Bytes of a checkpoint per request, so that its text fits the largest request.
_PORTION_BYTES = 48_000


class Reading(NamedTuple):
    """A reading of the simulated hardware; `failures` counts accesses of the machine that it refused so far."""

    value: Any
    failures: int


class VarClient(VarWire):
    """One connection. Every command is a method; a refusal is a VarError. Not thread-safe."""

    def __init__(self, address: str | Path, token: str | Path | None = None, timeout_s: float | None = 10.0):
        """Connects to a Unix socket's path, or to `tcp:HOST:PORT` with the server's token file.

        `timeout_s` limits the wait for a reply and the sending of a request (None: no limit). Raises VarError.
        """
        super().__init__(address, timeout_s)
        if token is not None:
            self._call("authenticate", token=_read_token(Path(token)))

    # ---- commands that read -----------------------------------------------------------------------------------------

    def get(self, *paths: str) -> dict[str, Any]:
        """The values at `paths`, all of one tick.

        The path of an instance or a struct gives a dict of the values below it.
        """
        try:
            members = _encoded_paths(paths)
        except TypeError:  # a list in place of its paths, which the server refuses
            members = encoded({"paths": paths})
        values = self._call_encoded("get", members)["values"]
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
        """As `state`, with the program's counters."""
        return self._call("stats")

    def list(self, prefix: str = "") -> Sequence[str]:
        """The paths that start with `prefix`."""
        paths: Sequence[str] = self._call("list", prefix=prefix)["paths"]
        return paths

    def describe(self, path: str | None = None) -> dict[str, Any]:
        """Role, type, unit, documentation, range of a field; without a path, the machine."""
        return self._call("describe") if path is None else self._call("describe", path=path)

    def describe_all(self, paths: Sequence[str]) -> Sequence[dict[str, Any]]:
        """What `describe` says of each path. Several requests are pending at a time."""
        found = []
        for at in range(0, len(paths), _PENDING_MAX):
            some = paths[at : at + _PENDING_MAX]
            first = self._send([("describe", {"path": path}) for path in some])
            found += [self._reply(number) for number in range(first, first + len(some))]
        return found

    # ---- commands that write -----------------------------------------------------------------------------------------

    def set(self, values: Mapping[str, Any], allow_non_finite: bool = False) -> dict[str, Any]:
        """Writes all values before the next tick, or none if one is refused.

        The reply's `overwritten_by` maps each path that the machine overwrites to the writer. NaN and infinities are
        refused unless `allow_non_finite`.
        """
        written = {path: _jsonable(value) for path, value in values.items()}
        return self._call("set", values=written, **({"allow_non_finite": True} if allow_non_finite else {}))

    def parameters(self) -> str:
        """A parameter file with the parameters that differ from the compiled ones, and their units."""
        return str(self._call("parameters")["file"])

    def set_parameters(self, file: str, name: str = "") -> dict[str, Any]:
        """Writes the values of a parameter file before the next tick, or none if one is refused; `name` is what errors
        call it. Its text has at most about 60 KB."""
        return self._call("set_parameters", file=file, name=name)

    def pause(self) -> dict[str, Any]:
        """Stops the machine; from now on only `tick` runs it."""
        return self._call("pause")

    def resume(self) -> dict[str, Any]:
        """Runs the machine in real time."""
        return self._call("resume")

    def tick(self, count: int = 1) -> int:
        """Runs ticks, while paused; returns the number completed since init."""
        if type(count) is not int:
            return int(self._call("tick", count=_jsonable(count))["tick"])
        done: int = self._call_encoded("tick", b',"count":%d}' % count)["tick"]
        return done

    def tick_by_tick(self, count: int) -> Sequence[bytes]:
        """Runs ticks, while paused; returns the machine's checkpoint after each of them.

        Several requests are pending at a time.
        """
        found: deque[bytes] = deque()
        pairs = 1
        while len(found) < count:
            pairs = min(pairs, count - len(found))
            first = self._send([("tick", {}), ("save", {})] * pairs)
            for number in range(first, first + 2 * pairs, 2):
                self._reply(number)
                found.append(self._whole(self._reply(number + 1)))
            # One pair at a time if a checkpoint comes in portions, because the next save discards the remaining ones.
            pairs = min(_PENDING_MAX, max(1, _UNREAD_BYTES // (2 * len(found[0]))))
        return found

    def set_state(self, state: str) -> dict[str, Any]:
        """Enters a state at once."""
        return self._call("set_state", state=state)

    def save(self) -> bytes:
        """The whole machine, as the content of a checkpoint file (docs/guide/recording.md), of any size."""
        return self._whole(self._call("save"))

    def save_to(self, name: str) -> dict[str, Any]:
        """Saves a checkpoint to a file in the program's folder (`--checkpoints`)."""
        return self._call("save", file=name)

    def restore(self, checkpoint: bytes, ignore_source_hash: bool = False) -> dict[str, Any]:
        """Restores the result of `save` or of a checkpoint file. `ignore_source_hash`: also accepts one of other sources."""
        more = {"ignore_source_hash": True} if ignore_source_hash else {}
        if len(checkpoint) <= _PORTION_BYTES:
            return self._call("restore", data=_text(checkpoint), **more)
        for at in range(0, len(checkpoint), _PORTION_BYTES):
            place = {"at": at} if at else {"bytes": len(checkpoint)}
            self._call("load", data=_text(checkpoint[at : at + _PORTION_BYTES]), **place)
        return self._call("restore", **more)

    def restore_from(self, name: str, ignore_source_hash: bool = False) -> dict[str, Any]:
        """Restores a checkpoint file in the program's folder."""
        return self._call("restore", file=name, **({"ignore_source_hash": True} if ignore_source_hash else {}))

    def _whole(self, reply: dict[str, Any]) -> bytes:
        """The complete checkpoint; `reply` to `save` has its first portion."""
        data = base64.b64decode(reply["data"])
        while len(data) < reply["bytes"]:
            more = base64.b64decode(self._call("saved", at=len(data))["data"])
            if not more:
                raise VarError("protocol", f"{self.address}: not a variable server: a checkpoint goes on without bytes")
            data += more
        return data

    def hardware(self, bank: str, number: int, value: Any = None) -> Reading:
        """Reads a pin, channel or register of the simulated hardware, after writing `value` to it, if given.

        `bank` is "gpio" (bool), "adc" (counts) or "registers" (`number` is the address).
        """
        given = {} if value is None else {"value": _jsonable(value)}
        reply = self._call("hardware", bank=bank, number=number, **given)
        return Reading(reply["value"], reply["failures"])

    def inject(self, instance: str, what: str) -> dict[str, Any]:
        """The next execute of an instance counts as a "fault" or an "overrun", or is "degraded" or "failed"."""
        return self._call("inject", instance=instance, what=what)

    def attach(self, channel: str) -> dict[str, Any]:
        """Attaches a sensor channel: without samples it ages."""
        return self._call("attach", channel=channel)

    def sample(self, channel: str, value: Any, age_ticks: int = 0, stamp_ns: int = 0) -> dict[str, Any]:
        """Gives a sensor channel a sample for the next tick, with its age in ticks at that tick and its stamp in ns."""
        more = {key: number for key, number in (("age_ticks", age_ticks), ("stamp_ns", stamp_ns)) if number}
        return self._call("sample", channel=channel, value=_jsonable(value), allow_non_finite=True, **more)

    def record(self, bag: str | Path, name_space: str = "") -> dict[str, Any]:
        """Records to a new directory on the server's side; only while paused."""
        return self._call("record", bag=str(bag), **({"namespace": name_space} if name_space else {}))

    def stop_recording(self) -> dict[str, Any]:
        """Completes the bag; only while paused."""
        return self._call("stop_recording")

    # ---- subscriptions ------------------------------------------------------------------------------------------------

    def subscribe(self, *paths: str, every: int = 1, binary: bool = False) -> Subscription:
        """An iterator over samples of the values at `paths` after every `every`-th tick, in order.

        `binary` is for many values: a sample is then sent as the bytes of its scalars instead of text.
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


@lru_cache(maxsize=64)
def _encoded_paths(paths: tuple[str, ...]) -> bytes:
    """The members of a `get`, made once for those that are read again and again."""
    return encoded({"paths": paths})


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _jsonable(value: Any) -> Any:
    """A value that JSON accepts: NumPy arrays and scalars are converted, NaN and infinities become strings."""
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
