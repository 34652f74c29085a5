# SPDX-License-Identifier: Apache-2.0
"""Keeps the last ticks of a twin in memory while a test runs, and writes them to files when it fails.

The whole machine struct after every tick goes into a ring of fixed size; the host's actions in these ticks are stored
beside it. The bag is made by playing both back through the recorder. So it equals a recording from that tick on: it
replays, and all bag tools read it. Ticks that the twin's tap did not record are left out.
"""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from ctypes import CFUNCTYPE, byref, c_int32, memmove
from ctypes import c_void_p as ptr
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..c_machine import CMachine
from ..errors import TwinError
from ..parameters import CParameters
from ..run import Run

if TYPE_CHECKING:
    from ..requirements import Verdict
    from .host import Tap
    from .twin import Twin

#: Limits for one twin: bytes of the ring, and ticks in it.
_RING_BYTES = 8 << 20
_TICKS = 2000
_MIN_TICKS = 16
#: Most host writes kept. Older ones are dropped, together with the ticks before them.
_MAX_WRITES = 100_000


class BlackBox:
    """The last ticks of one twin, since it was opened or since it last ran in real time.

    `again` opens the same machine once more: writing after the twin was closed needs its descriptor.
    """

    def __init__(self, twin: Twin, again: Callable[[], Twin] | None = None):
        self._twin, self._again = twin, again
        self._source: Callable[[], AbstractContextManager[Twin]] = lambda: nullcontext(twin)
        self._verdicts: list[Verdict] | None = None  # once the twin is closed
        self._before: dict[str, Verdict] = {}  # of a restore
        #: Message about missing ticks; empty if all were recorded.
        self.missing = ""
        self._open()
        twin._box = self

    def _open(self) -> None:
        size = self._twin.machine.size
        self._begin = self._twin._save()
        self._tap: Tap = self._twin._tap([(0, size)], max(_MIN_TICKS, min(_TICKS, _RING_BYTES // size)))
        #: (rows before it, rows after it, action, arguments)
        self._writes: deque[tuple[int, int, str, tuple[Any, ...]]] = deque()
        self._lost = 0  # rows before this one lack writes
        self._sees = True

    def suspend(self, tick: int) -> None:
        """From tick number `tick` on the flight program runs in real time: its ticks and actions are not recorded."""
        self._sees = False
        self.missing = f"ticks from {tick} on are not among them: the flight program runs in real time, unrecorded"

    def resume(self) -> None:
        """Begins a new ring at the current state of the machine, which is paused again."""
        self._tap.close()
        self._open()
        tick = self._twin._step(0)
        self.missing = f"ticks before {tick} are not among them: the flight program ran in real time, unrecorded"

    def keep(self) -> None:
        """Copies the rows before the twin closes its tap."""
        self._tap = _Kept(self._tap, self._twin.machine.size)
        self._source = self._again or self._source
        self._verdicts = self.verdicts()

    @property
    def machine(self) -> str:
        return self._twin.machine.name

    def restoring(self) -> None:
        """A checkpoint puts back what the requirements count; `verdicts` forgets none that was violated or exercised."""
        self._before = {verdict.id: verdict for verdict in self.verdicts()}

    def verdicts(self) -> list[Verdict]:
        """On the machine's requirements; [] of a flight program, whose end says them."""
        if self._verdicts is not None:
            return self._verdicts
        try:
            found = self._twin._verdicts()
        except TwinError:
            return []
        return [_worse(self._before.get(verdict.id, verdict), verdict) for verdict in found]

    def rows(self) -> int:
        """Ticks recorded since the beginning."""
        return self._tap.rows()

    def note(self, before: int, what: str, arguments: tuple[Any, ...]) -> None:
        """Stores a host action that was done after `before` ticks; feeding ran more ticks since."""
        if not self._sees:
            return
        rows = self.rows()
        while self._writes and self._writes[0][1] < rows - self._tap.capacity:
            self._writes.popleft()
        if len(self._writes) == _MAX_WRITES:
            self._lost = self._writes.popleft()[1]
        self._writes.append((before, rows, what, arguments))

    def write(self, folder: Path) -> list[Path]:
        """Writes the last ticks as `trace.csv` and the bag `bag` into `folder`.

        Returns an empty list if no tick was run.
        """
        rows = self.rows()
        first = max(0, rows - self._tap.capacity, self._lost)
        if first == rows:
            return []
        machine = self._twin.machine
        data = self._tap.read(first, rows - first)
        before = self._begin
        if first > 0:  # the bag begins with the state after its first row
            before, data, first = bytes(data[: machine.size]), data[machine.size :], first + 1
        csv, bag = folder / f"{machine.name}.csv", folder / machine.name
        self._write_csv(data, csv)
        self._write_bag(before, data, first, bag)
        return [csv, bag]

    def _write_csv(self, data: bytes | bytearray, path: Path) -> None:
        from .trace import Columns

        machine = self._twin.machine
        Columns(machine, {p: f.offset for p, f in machine.fields.items()}, machine.size, data).to_csv(path)

    def _write_bag(self, before: bytes, data: bytes | bytearray, first: int, bag: Path) -> None:
        from .alg_twin import AlgTwin

        with self._source() as source, AlgTwin(_Playback(source._descriptor(), before, data)) as player:
            rows = [first]  # the next row

            def step_to(row: int) -> None:
                player._advance(row - rows[0])
                rows[0] = row

            player.record(bag)
            for begin, end, what, arguments in self._writes:
                if end < first or (what != "feed" and begin < first):
                    continue
                step_to(max(begin, first))
                if what == "feed":
                    samples, until = arguments
                    player._feed(samples.between(player._step(0), until), until)
                    rows[0] = end
                else:
                    player._do(what, *arguments)
            step_to(first + len(data) // self._twin.machine.size)
            player.stop_recording()


def _worse(before: Verdict, now: Verdict) -> Verdict:
    """The one that was violated, or the one that was exercised."""
    return before if not now.violations and (before.violations or now.status == "not exercised") else now


class _Kept:
    """Copied rows of a closed tap (host.Tap)."""

    def __init__(self, tap: Tap, row_bytes: int):
        self.capacity, self._count, self._row_bytes = tap.capacity, tap.rows(), row_bytes
        self._first = max(0, self._count - self.capacity)
        self._data = tap.read(self._first, self._count - self._first)

    def rows(self) -> int:
        return self._count

    def read(self, first: int, count: int) -> bytes | bytearray:
        begin = first - self._first
        return self._data[begin * self._row_bytes : (begin + count) * self._row_bytes]

    def close(self) -> None:
        pass


_Init = CFUNCTYPE(None, ptr)
_Start = CFUNCTYPE(c_int32, ptr)
_Step = CFUNCTYPE(None, ptr, ptr)
_ForceState = CFUNCTYPE(None, ptr, c_int32)


class _Playback(Run):
    """A run that plays back recorded structs: it begins with `before`, and every tick takes the next struct of `data`."""

    def __init__(self, descriptor: CMachine, before: bytes, data: bytes | bytearray):
        self._before, self._rows, self._next, self._size = before, data, 0, descriptor.size
        self._callbacks = {
            "init": _Init(self._init),
            "start": _Start(lambda memory: 0),
            "step": _Step(self._tick),
            "force_state": _ForceState(lambda memory, state: None),
        }
        self._played = CMachine.from_buffer_copy(descriptor)
        for name, callback in self._callbacks.items():
            setattr(self._played, name, ctypes.cast(callback, ptr).value)
        super().__init__(Path(), None)

    def _open(self, library: Path, machine: str | None, parameters: CParameters | None) -> int | None:
        handle: int | None = self._lib.fcsl_run_open_machine(byref(self._played), parameters, byref(self._error))
        return handle

    def _init(self, memory: int) -> None:
        memmove(memory, self._before, self._size)

    def _tick(self, memory: int, host: int) -> None:
        memmove(memory, bytes(self._rows[self._next : self._next + self._size]), self._size)
        self._next += self._size
