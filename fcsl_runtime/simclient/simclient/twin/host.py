# SPDX-License-Identifier: Apache-2.0
"""TwinHost: hosts the machine of a twin. Each kind of twin implements the primitives of this class.

The primitives take numbers of the descriptor and bytes in the layout of the machine struct (native byte order). Twin
adds names, values and messages for users.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..c_machine import CMachine
from ..descriptor import Machine
from ..errors import TwinError
from ..hardware import Hardware
from ..paths import Part, Selection, resolve

if TYPE_CHECKING:
    from ..events import Event
    from ..instance_times import InstanceTime
    from ..requirements import Verdict
    from .black_box import BlackBox
    from .profile import Samples

#: Ticks of a profile per call, during which Python handles no signal.
_SLICE_TICKS = 20_000


class Tap(Protocol):
    """One row of bytes per tick for the last `capacity` ticks: concatenated parts of the machine struct."""

    @property
    def capacity(self) -> int: ...

    def rows(self) -> int:
        """Rows taken so far, including discarded ones."""

    def read(self, first: int, count: int) -> bytes | bytearray:
        """`count` rows from row `first` (counted from 0) on."""

    def close(self) -> None: ...


class Listener(Protocol):
    """Takes rows out of a tap before they are overwritten."""

    def room(self) -> int:
        """Ticks until `collect` is needed."""

    def collect(self) -> None: ...

    def stop(self) -> None: ...


class TwinHost(ABC):
    """The primitives, and the running of ticks while taps record."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._parts: dict[str, Part] = {}
        self._listeners: list[Listener] = []
        #: Paths and values read since the last condition began.
        self._reads: dict[str, Any] | None = None
        self._box: BlackBox | None = None

    # ---- primitives -------------------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def machine(self) -> Machine:
        """The machine's descriptor: fields, instances, states, transitions, channels, hashes."""

    @abstractmethod
    def _descriptor(self) -> CMachine:
        """The machine's descriptor in C."""

    @property
    @abstractmethod
    def hardware(self) -> Hardware:
        """The simulated hardware that the `hw_*` builtins of the algorithms use: `twin.hardware.gpio[17]`."""

    @abstractmethod
    def close(self) -> None:
        """Pauses, stops recording and releases the machine; idempotent.

        Raises the errors of `pause`, and TwinError for an incomplete bag.
        """

    @abstractmethod
    def pause(self) -> None:
        """From now on only `tick` steps the machine. Raises errors that occurred while it ran in real time."""

    @abstractmethod
    def resume(self) -> None:
        """Runs at `tick_hz` in real time until `pause`; values can be read and set meanwhile, between ticks."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """Whether the machine runs in real time (`resume`)."""

    @property
    @abstractmethod
    def ticks_skipped(self) -> int:
        """Ticks skipped since `resume`, because the computer was too slow for real time."""

    @abstractmethod
    def record(self, bag: str | Path, name_space: str = "", split: str = "") -> None:
        """Records to the directory `bag` (which must not exist) until `stop_recording` or `close`.

        The format is MCAP as ROS 2 Jazzy writes it, with the checkpoint and every write that a replay needs. Topics
        start with /<name_space>/<machine>/. `split`: how the bag is split into files (docs/guide/recording.md).
        """

    @abstractmethod
    def stop_recording(self) -> None:
        """Completes the bag."""

    @abstractmethod
    def _step(self, ticks: int) -> int:
        """Runs ticks (not while running in real time); returns the number completed since init."""

    @abstractmethod
    def _read(self, leaves: Sequence[Selection]) -> list[bytes]:
        """The bytes of each, all at the same tick."""

    @abstractmethod
    def _write(self, writes: Sequence[tuple[Selection, bytes]]) -> None:
        """Writes all before the next tick; if one is rejected (out of range), none."""

    @abstractmethod
    def _set_state(self, state: int) -> None:
        """Makes state number `state` active at once."""

    @abstractmethod
    def _inject(self, what: str, instance: int) -> None:
        """Sets the effect of the instance's next execute: "fault", "overrun", "degraded" or "failed"."""

    @abstractmethod
    def _attach(self, channel: int) -> None:
        """Attaches this sensor channel."""

    @abstractmethod
    def _sample(self, channel: int, data: bytes, age_ticks: int, stamp_ns: int) -> None:
        """One sample of a sensor channel for the next tick."""

    @abstractmethod
    def _events(self) -> list[Event]:
        """The last events of the machine."""

    def _times(self) -> dict[str, InstanceTime]:
        """How long instances, and steps, took so far; empty if the machine is not measured."""
        raise TwinError(f"{type(self).__name__} does not read the times of instances")

    def _verdicts(self) -> list[Verdict]:
        """On the machine's requirements."""
        raise TwinError(f"{type(self).__name__} does not read requirements")

    @abstractmethod
    def _save(self) -> bytes:
        """Copies the machine struct."""

    @abstractmethod
    def _restore(self, data: bytes) -> None:
        """Restores the machine struct."""

    @abstractmethod
    def _checkpoint(self) -> bytes:
        """The complete state, to continue in this process or another: the content of a checkpoint file."""

    @abstractmethod
    def _restore_checkpoint(self, checkpoint: bytes, ignore_source_hash: bool) -> None:
        """Restores a checkpoint of this machine, of the same sources unless `ignore_source_hash`."""

    @abstractmethod
    def _feed(self, samples: Samples, end: int) -> None:
        """Runs the ticks before `end`; applies each sample before its tick."""

    @abstractmethod
    def _tap(self, ranges: Sequence[tuple[int, int]], capacity: int) -> Tap:
        """A tap of these parts (offset, size) of the machine struct."""

    # ---- built on the primitives ------------------------------------------------------------------------------------

    def _select(self, path: str) -> Part:
        part = self._parts.get(path)
        if part is None:
            part = self._parts[path] = resolve(path, self.machine)
        return part

    def _do(self, what: str, *arguments: Any) -> None:
        """Calls a primitive that changes the machine; the black box stores the action."""
        with self._lock:  # a twin in real time runs no tick meanwhile
            box = self._box
            before = box.rows() if box is not None else 0
            getattr(self, f"_{what}")(*arguments)
            if box is not None:
                box.note(before, what, arguments)

    def _listen(self, listener: Listener, ranges: Sequence[tuple[int, int]], capacity: int) -> Tap:
        """A tap that the listener empties before it overflows."""
        if self.running:
            raise TwinError("the twin is running by itself; call pause() before trace()")
        tap = self._tap(ranges, capacity)
        self._listeners.append(listener)
        return tap

    def _stop_listeners(self) -> None:
        """Stops traces and the black box; their rows stay readable after the twin is closed."""
        for listener in list(self._listeners):
            listener.stop()
        if self._box is not None:
            self._box.keep()
            self._box = None

    def _room(self) -> int:
        return min((listener.room() for listener in self._listeners), default=2**63)

    def _collect(self) -> None:
        for listener in self._listeners:
            if listener.room() == 0:
                listener.collect()

    def _advance(self, ticks: int) -> int:
        """Runs ticks; listeners receive every one."""
        if not self._listeners:
            return self._step(ticks)
        done = self._step(0)
        while ticks > 0:
            slice_ticks = min(ticks, self._room())
            done = self._step(slice_ticks)
            ticks -= slice_ticks
            self._collect()
        return done

    def _play(self, samples: Samples, ticks: int) -> int:
        """Runs ticks with samples, whose ticks count from the next one; returns the ticks run."""
        begin = self._step(0)
        samples = samples.moved(begin)
        at, end = begin, begin + ticks
        while at < end:
            until = min(end, at + min(_SLICE_TICKS, self._room()))
            self._do("feed", samples.between(at, until), until)
            self._collect()
            at = until
        return ticks
