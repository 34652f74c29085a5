# SPDX-License-Identifier: Apache-2.0
"""TwinHost: what hosts the machine of a twin. A kind of twin is a class that implements the primitives here.

The primitives take numbers of the descriptor and bytes as they lie in the machine struct (native byte order); names, values
and messages to users are the affair of Twin, which is built on them.
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
    from .black_box import BlackBox
    from .profile import Samples

#: Ticks of a profile per call, during which Python sees no signal.
_SLICE_TICKS = 20_000


class Tap(Protocol):
    """One row of bytes per tick: parts of the machine struct, one after another, of the last `capacity` ticks."""

    @property
    def capacity(self) -> int: ...

    def rows(self) -> int:
        """Rows taken so far, those that are no longer kept included."""

    def read(self, first: int, count: int) -> bytes | bytearray:
        """`count` rows from row `first` (counted from 0) on."""

    def close(self) -> None: ...


class Listener(Protocol):
    """What takes rows out of a tap before they are written over."""

    def room(self) -> int:
        """Ticks until `collect` is needed."""

    def collect(self) -> None: ...

    def stop(self) -> None: ...


class TwinHost(ABC):
    """The primitives, and how ticks pass while taps look on."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._parts: dict[str, Part] = {}
        self._listeners: list[Listener] = []
        #: Paths and values read since a condition asked for them.
        self._reads: dict[str, Any] | None = None
        self._box: BlackBox | None = None

    # ---- primitives -------------------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def machine(self) -> Machine:
        """The machine's descriptor: fields, instances, states, transitions, channels, hashes."""

    @abstractmethod
    def _descriptor(self) -> CMachine:
        """The same in C."""

    @property
    @abstractmethod
    def hardware(self) -> Hardware:
        """The simulated board that the `hw_*` builtins of the algorithms reach: `twin.hardware.gpio[17]`."""

    @abstractmethod
    def close(self) -> None:
        """Pauses, stops recording, lets go of the machine; idempotent. Raises what `pause` raises, and TwinError for a bag
        cut short."""

    @abstractmethod
    def pause(self) -> None:
        """From here on only `tick` moves the machine. Raises what went wrong while it ran by itself."""

    @abstractmethod
    def resume(self) -> None:
        """Runs at `tick_hz` in real time until `pause`; values can be read and set meanwhile, between ticks."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """Whether the machine advances by itself."""

    @property
    @abstractmethod
    def lost_ticks(self) -> int:
        """Ticks that real time had and the machine did not, since `resume`: the computer was too slow."""

    @abstractmethod
    def record(self, bag: str | Path, name_space: str = "") -> None:
        """Records to the directory `bag` (which must not exist) until `stop_recording` or `close`: MCAP as ROS 2 Jazzy
        writes it, with the checkpoint and every write that a replay needs. Topics start with /<name_space>/<machine>/.
        """

    @abstractmethod
    def stop_recording(self) -> None:
        """Completes the bag."""

    @abstractmethod
    def _step(self, ticks: int) -> int:
        """Runs ticks, not while running; returns the number completed since init."""

    @abstractmethod
    def _read(self, leaves: Sequence[Selection]) -> list[bytes]:
        """The bytes of each, all of one moment."""

    @abstractmethod
    def _write(self, writes: Sequence[tuple[Selection, bytes]]) -> None:
        """Writes all before the next tick or, when one is refused (a range), none."""

    @abstractmethod
    def _set_state(self, state: int) -> None:
        """Makes state number `state` take force at once."""

    @abstractmethod
    def _inject(self, what: str, instance: int) -> None:
        """What the next execute of this instance counts as: "fault", "overrun", "degraded" or "failed"."""

    @abstractmethod
    def _attach(self, channel: int) -> None:
        """This sensor channel is served from here on."""

    @abstractmethod
    def _sample(self, channel: int, data: bytes, age_ticks: int, stamp_ns: int) -> None:
        """One sample of a sensor channel for the coming tick."""

    @abstractmethod
    def _save(self) -> bytes:
        """The machine struct."""

    @abstractmethod
    def _restore(self, data: bytes) -> None:
        """Puts the machine struct back."""

    @abstractmethod
    def _checkpoint(self) -> bytes:
        """What goes on where this is, in this process or another: the content of a checkpoint file."""

    @abstractmethod
    def _restore_checkpoint(self, checkpoint: bytes, other_source: bool) -> None:
        """Puts it back, if it is of this machine and, but for `other_source`, of its sources."""

    @abstractmethod
    def _feed(self, samples: Samples, end: int) -> None:
        """Runs the ticks up to before `end`, giving each of the samples before its tick."""

    @abstractmethod
    def _tap(self, ranges: Sequence[tuple[int, int]], capacity: int) -> Tap:
        """A tap of these parts (offset, size) of the machine struct."""

    # ---- on them ----------------------------------------------------------------------------------------------------

    def _select(self, path: str) -> Part:
        part = self._parts.get(path)
        if part is None:
            part = self._parts[path] = resolve(path, self.machine)
        return part

    def _do(self, what: str, *arguments: Any) -> None:
        """One of the primitives that change the machine; the black box keeps what was done."""
        with self._lock:  # a twin that runs by itself makes no tick meanwhile
            box = self._box
            before = box.rows() if box is not None else 0
            getattr(self, f"_{what}")(*arguments)
            if box is not None:
                box.note(before, what, arguments)

    def _listen(self, listener: Listener, ranges: Sequence[tuple[int, int]], capacity: int) -> Tap:
        """A tap that the listener empties in time."""
        if self.running:
            raise TwinError("the twin is running by itself; call pause() before trace()")
        tap = self._tap(ranges, capacity)
        self._listeners.append(listener)
        return tap

    def _stop_listeners(self) -> None:
        """What is being traced, and the last ticks, stay readable when the twin is closed."""
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
        """Runs ticks; listeners see every one."""
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
        """Runs ticks with samples, whose ticks count from the coming one; returns the ticks run."""
        begin = self._step(0)
        samples = samples.moved(begin)
        at, end = begin, begin + ticks
        while at < end:
            until = min(end, at + min(_SLICE_TICKS, self._room()))
            self._do("feed", samples.between(at, until), until)
            self._collect()
            at = until
        return ticks
