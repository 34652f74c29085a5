# SPDX-License-Identifier: Apache-2.0
"""AlgTwin and PyTwin: twins in this process. AlgTwin loads the compiled machine, PyTwin runs its sources in CPython."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Self

from ..c_machine import CMachine
from ..descriptor import Machine
from ..errors import TwinError
from ..hardware import Hardware, RunBoard
from ..machine_build import build_config, find_parameters
from ..parameters import Given, Parameters
from ..paths import Selection
from ..run import Run, RunTrace, open_run
from .python_run import open_python_run
from .twin import Twin

if TYPE_CHECKING:
    from ..events import Event
    from ..instance_times import InstanceTime
    from ..requirements import Verdict
    from .profile import Samples

#: A twin that falls further behind real time, in ns, skips the ticks beyond, as fcsl-fc does (fc/pacing.c).
_MAX_LAG_NS = 100_000_000
#: Most ticks for which `get_value` in another thread may wait.
_MAX_BATCH_TICKS = 1000
_MIN_SLEEP_S = 0.0005


class AlgTwin(Twin):
    """The compiled machine, in this process."""

    def __init__(self, run: Run):
        if isinstance(run, str | Path):
            name = type(self).__name__
            raise TypeError(f"{name}.from_config(path) opens a machine, {name}.from_library(path) a compiled library")
        super().__init__()
        self._run = run
        self._hardware = Hardware(RunBoard(run, self._lock))
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._failure: Exception | None = None
        self._ticks_skipped = 0

    # ---- life -------------------------------------------------------------------------------------------------------

    @classmethod
    def _open_config(
        cls, config: Path, target: str, instances: Sequence[str] | None, backend: str, parameters: Parameters | None
    ) -> Self:
        return cls(open_run(*build_config(config, target, instances, backend), parameters))

    @classmethod
    def from_library(cls, path: str | Path, machine: str | None = None, *, parameters: Given | None = None) -> Self:
        """Opens a compiled library; `machine` selects one of several, `parameters` are as in from_config. Raises TwinError."""
        values = find_parameters(parameters, sys._getframe(1).f_code.co_filename)
        return cls(open_run(Path(path).absolute(), machine, values))

    def close(self) -> None:
        try:
            self.pause()
            self._stop_listeners()
        finally:
            with self._lock:
                self._run.close()

    def __del__(self) -> None:
        run = getattr(self, "_run", None)
        if run is not None:
            try:
                run.close()
            except TwinError:
                pass  # a finalizer cannot report errors; close() and a with block do

    @property
    def machine(self) -> Machine:
        return self._run.machine

    def _descriptor(self) -> CMachine:
        return self._run.descriptor()

    @property
    def hardware(self) -> Hardware:
        return self._hardware

    # ---- real time --------------------------------------------------------------------------------------------------

    def pause(self) -> None:
        self._halt()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def resume(self) -> None:
        with self._lock:
            self._run.handle()
            if self._listeners:
                raise TwinError("an open trace records only the ticks of tick(); leave its block before resume()")
            if self._thread is not None:
                return
            self._stop.clear()
            self._ticks_skipped = 0
            self._thread = threading.Thread(target=self._run_by_itself, name=f"twin {self.machine.name}", daemon=True)
            self._thread.start()

    @property
    def running(self) -> bool:
        return self._thread is not None

    @property
    def ticks_skipped(self) -> int:
        return self._ticks_skipped

    def _halt(self) -> None:
        thread = self._thread
        if thread is None:
            return
        self._stop.set()
        thread.join()
        self._thread = None

    def _run_by_itself(self) -> None:
        hz = self.machine.tick_hz
        start, done = time.monotonic_ns(), 0
        while not self._stop.is_set():
            due = (time.monotonic_ns() - start) * hz // 1_000_000_000 - done
            excess = due - max(1, _MAX_LAG_NS * hz // 1_000_000_000)
            if excess > 0:
                self._ticks_skipped += excess
                done += excess
                due -= excess
            batch = min(due, _MAX_BATCH_TICKS)
            try:
                with self._lock:
                    self._run.step(batch)
            except Exception as error:
                self._failure = error
                return
            done += batch
            next_ns = start + (done + 1) * 1_000_000_000 // hz
            self._stop.wait(max(_MIN_SLEEP_S, (next_ns - time.monotonic_ns()) / 1e9))

    # ---- primitives -------------------------------------------------------------------------------------------------

    def _step(self, ticks: int) -> int:
        with self._lock:
            if self._thread is not None:
                raise TwinError("the twin is running by itself; call pause() before tick()")
            if ticks == 1:
                return self._run.step_once()
            self._run.step(ticks)
            return self._run.tick

    def _read(self, leaves: Sequence[Selection]) -> list[bytes]:
        with self._lock:
            return [self._run.read(leaf.offset, leaf.size) for leaf in leaves]

    def _write(self, writes: Sequence[tuple[Selection, bytes]]) -> None:
        with self._lock:
            if len(writes) > 1:
                for leaf, data in writes:
                    self._run.check_set(leaf.field.index, leaf.element, data)
            for leaf, data in writes:
                self._run.set(leaf.field.index, leaf.element, data)

    def _set_state(self, state: int) -> None:
        with self._lock:
            self._run.set_state(state)

    def _inject(self, what: str, instance: int) -> None:
        with self._lock:
            if what == "fault":
                self._run.inject_fault(instance)
            elif what == "overrun":
                self._run.inject_overrun(instance)
            else:
                self._run.inject_health(instance, what)

    def _attach(self, channel: int) -> None:
        with self._lock:
            self._run.attach_channel(channel)

    def _sample(self, channel: int, data: bytes, age_ticks: int, stamp_ns: int) -> None:
        with self._lock:
            self._run.write_channel(channel, data, age_ticks, stamp_ns)

    def _events(self) -> list[Event]:
        with self._lock:
            return self._run.events()

    def _times(self) -> dict[str, InstanceTime]:
        with self._lock:
            return self._run.times()

    def _verdicts(self) -> list[Verdict]:
        with self._lock:
            return self._run.verdicts()

    def _restart_requirements(self) -> None:
        """Puts the verdicts on requirements, and what these remember, back to the beginning."""
        with self._lock:
            self._run.restart_requirements()

    def _save(self) -> bytes:
        with self._lock:
            return self._run.save()[: self.machine.size]

    def _restore(self, data: bytes) -> None:
        with self._lock:
            self._run.restore(data)

    def _checkpoint(self) -> bytes:
        with self._lock:
            return self._run.checkpoint()

    def _restore_checkpoint(self, checkpoint: bytes, ignore_source_hash: bool) -> None:
        with self._lock:
            self._run.restore_checkpoint(checkpoint, ignore_source_hash)

    def _feed(self, samples: Samples, end: int) -> None:
        with self._lock:
            if self._thread is not None:
                raise TwinError("the twin is running by itself; call pause() before inject()")
            self._run.feed(samples.rows.tobytes(), samples.payloads, end)

    def _tap(self, ranges: Sequence[tuple[int, int]], capacity: int) -> RunTrace:
        with self._lock:
            return self._run.trace(ranges, capacity)

    # ---- recording --------------------------------------------------------------------------------------------------

    def record(self, bag: str | Path, name_space: str = "", split: str = "") -> None:
        with self._lock:
            self._run.record(Path(bag).absolute(), name_space, lossless=True, split=split)

    def stop_recording(self) -> None:
        with self._lock:
            self._run.record_stop()


class PyTwin(AlgTwin):
    """The same machine in CPython, by the published rewrite (docs/reference/language.md): bit-identical to AlgTwin at every tick.

    The machine is still compiled, because its descriptor and its externs are used.

    A debugger stops at breakpoints in the algorithm files and shows values as numbers. An exception that is not a fault
    of the language (a debugger's quit, Ctrl-C) propagates out of `tick`; the interrupted tick is undone.
    """

    @classmethod
    def _open_config(
        cls, config: Path, target: str, instances: Sequence[str] | None, backend: str, parameters: Parameters | None
    ) -> Self:
        library, name = build_config(config, target, instances, backend)
        return cls(open_python_run(config, library, name, target, instances, parameters))

    @classmethod
    def from_library(cls, path: str | Path, machine: str | None = None, *, parameters: Given | None = None) -> Self:
        """Always raises TwinError: a library has no sources to run."""
        raise TwinError(f"{path}: PyTwin runs the algorithms' sources; open the machine's JSON with from_config()")
