# SPDX-License-Identifier: Apache-2.0
"""ProcessTwin: the compiled machine in a separate process, the flight program, through its variable server.

It has the functions of AlgTwin, through the flight code: `fcsl-fc LIBRARY --paused --socket …`. A machine that crashes
ends its own process, not the test's. Its results are bit-identical to AlgTwin's: executes are not timed (`--no-overrun-check`). A
tick costs a round trip to the other process. The values of one `set` have at most 64 KiB as JSON.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from ..c_machine import CMachine
from ..checkpoint import struct_of, tick_of
from ..descriptor import Field, Machine
from ..errors import TwinError
from ..hardware import Hardware
from ..machine_build import build_config, find_parameters
from ..parameters import Given, Parameters
from ..paths import Selection
from ..run import Run, open_run
from ..values import decode
from ..vars.client import VarClient
from ..vars.wire import VarError
from .flight_process import FlightProcess
from .process_tap import ProcessTap
from .twin import Twin

if TYPE_CHECKING:
    from ..events import Event
    from ..instance_times import InstanceTime
    from ..requirements import Verdict
    from .profile import Samples

#: Ticks per request, so that Ctrl-C is handled in between.
_SLICE_TICKS = 20_000
#: Ticks per request with taps: the machine's checkpoints after all of these ticks are in memory at once.
_TAPPED_TICKS = 200


class ProcessTwin(Twin):
    """Owns a flight program, which starts paused at tick 0 and ends with the twin or with this process."""

    def __init__(self, library: Path, machine: str | None, parameters: Parameters | None = None):
        super().__init__()
        # Only the descriptor of this run is used: offsets and types of fields. It refuses wrong parameters, too.
        self._described: Run = open_run(library, machine, parameters)
        self._running = False
        self._skipped = 0
        self._ticks_skipped = 0
        self._tap_open: list[ProcessTap] = []
        self._fields = tuple(self._described.machine.fields.values())
        #: A cached copy of the machine struct; None after a change.
        self._known: bytes | None = None
        try:
            self._process = FlightProcess(library, self._described.machine.name, parameters)
        except OSError as error:
            raise TwinError(f"cannot start a flight program: {error.strerror}") from None
        hosted = self._request("describe")["build_hash"]
        if hosted != self._described.machine.build_hash:
            self.close()
            raise TwinError(f"{library}: it changed while it was opened; open it again")

    # ---- life -------------------------------------------------------------------------------------------------------

    @classmethod
    def _open_config(
        cls, config: Path, target: str, instances: Sequence[str] | None, backend: str, parameters: Parameters | None
    ) -> Self:
        return cls(*build_config(config, target, instances, backend), parameters)

    @classmethod
    def from_library(cls, path: str | Path, machine: str | None = None, *, parameters: Given | None = None) -> Self:
        """Opens a compiled library; `machine` selects one of several, `parameters` are as in from_config. Raises TwinError."""
        values = find_parameters(parameters, sys._getframe(1).f_code.co_filename)
        return cls(Path(path).absolute(), machine, values)

    def close(self) -> None:
        try:
            if self._process.open:
                self.pause()
                self._stop_listeners()
        finally:
            self._process.close()
            self._described.close()

    def __del__(self) -> None:
        process = getattr(self, "_process", None)
        if process is not None:
            process.close()

    @property
    def pid(self) -> int:
        """Process id of the flight program."""
        return self._process.pid

    @property
    def machine(self) -> Machine:
        return self._described.machine

    def _descriptor(self) -> CMachine:
        return self._described.descriptor()

    @property
    def hardware(self) -> Hardware:
        return Hardware(_ProcessBoard(self))

    # ---- real time --------------------------------------------------------------------------------------------------

    def pause(self) -> None:
        if self._running:
            self._do_command("pause")
            self._ticks_skipped, self._running = self.ticks_skipped, False
            if self._box is not None:
                self._box.resume()

    def resume(self) -> None:
        if self._listeners:
            raise TwinError("an open trace records only the ticks of tick(); leave its block before resume()")
        if not self._running:
            stats = self._request("stats")
            self._do_command("resume")
            self._running = True
            self._skipped, self._ticks_skipped = stats["ticks_skipped"], 0
            if self._box is not None:
                self._box.suspend(stats["tick"])

    @property
    def running(self) -> bool:
        return self._running

    @property
    def ticks_skipped(self) -> int:
        if self._running:
            self._ticks_skipped = self._request("stats")["ticks_skipped"] - self._skipped
        return self._ticks_skipped

    # ---- primitives -------------------------------------------------------------------------------------------------

    def _times(self) -> dict[str, InstanceTime]:
        from ..instance_times import of_stats

        return of_stats(self._request("stats").get("times", {}))

    def _events(self) -> list[Event]:
        """The last 64, as the program's `stats` has them."""
        from ..events import of_stats

        return of_stats(self._request("stats").get("events", {}).get("last", ()), self.machine)

    def _verdicts(self) -> list[Verdict]:
        """As the program's `stats` has them: without the values of a violation."""
        from ..requirements import of_stats

        return of_stats(self._request("stats").get("requirements", {}))

    @property
    def _client(self) -> VarClient:
        return self._process.client

    def _request(self, command: str, *arguments: Any, **options: Any) -> Any:
        """Calls a method of the client. If the process has ended, the error includes its last output."""
        with self._lock:
            try:
                return getattr(self._client, command)(*arguments, **options)
            except VarError as error:
                raise self._process.explain(error) from None

    def _do_command(self, command: str, *arguments: Any, **options: Any) -> Any:
        """Calls a method of the client that changes the machine."""
        with self._lock:
            self._known = None
            return self._request(command, *arguments, **options)

    def _step(self, ticks: int) -> int:
        with self._lock:
            if self._running:
                raise TwinError("the twin is running by itself; call pause() before tick()")
            if ticks == 0:
                return int(self._request("state")["tick"])
            if self._tap_open:
                return self._step_for_taps(ticks)
            done = 0
            while ticks > 0:
                slice_ticks = min(ticks, _SLICE_TICKS)
                done = self._do_command("tick", slice_ticks)
                ticks -= slice_ticks
            return done

    def _step_for_taps(self, ticks: int) -> int:
        """Runs ticks for open taps, which keep only their last rows: earlier ticks run without being read."""
        rows = max(tap.capacity for tap in self._tap_open)
        unseen = max(0, ticks - rows)
        while unseen > 0:
            slice_ticks = min(unseen, _SLICE_TICKS)
            self._do_command("tick", slice_ticks)
            for tap in self._tap_open:
                tap.skip(slice_ticks)
            unseen -= slice_ticks
            ticks -= slice_ticks
        done = 0
        while ticks > 0:
            slice_ticks = min(ticks, _TAPPED_TICKS)
            for checkpoint in self._do_command("tick_by_tick", slice_ticks):
                done, data = tick_of(checkpoint), struct_of(checkpoint)
                for tap in self._tap_open:
                    tap.take(data)
            ticks -= slice_ticks
        return done

    def _read(self, leaves: Sequence[Selection]) -> list[bytes]:
        data = self._save()
        return [data[leaf.offset : leaf.offset + leaf.size] for leaf in leaves]

    def _write(self, writes: Sequence[tuple[Selection, bytes]]) -> None:
        values = {leaf.path: decode(data, leaf.field, leaf.shape, self.machine) for leaf, data in writes}
        if len(values) < len(writes):
            raise TwinError("a path is written twice")
        self._do_command("set", values, allow_non_finite=True)

    def _set_state(self, state: int) -> None:
        self._do_command("set_state", self.machine.states[state])

    def _inject(self, what: str, instance: int) -> None:
        self._do_command("inject", self.machine.instances[instance].name, what)

    def _attach(self, channel: int) -> None:
        self._do_command("attach", self.machine.channels[channel].name)

    def _sample(self, channel: int, data: bytes, age_ticks: int, stamp_ns: int) -> None:
        served = self.machine.channels[channel]
        value = decode(data, served.field, served.field.shape, self.machine)
        self._do_command("sample", served.name, value, age_ticks, stamp_ns)

    def _save(self) -> bytes:
        with self._lock:
            if self._known is not None:
                return self._known
            data = struct_of(self._request("save"))
            if not self._running:
                self._known = data
            return data

    def _restore(self, data: bytes) -> None:
        with self._lock:
            self._described.restore_checkpoint(
                self._request("save")
            )  # restores only the struct: the hardware keeps its state
            self._described.restore(data)
            self._do_command("restore", self._described.checkpoint())

    def _checkpoint(self) -> bytes:
        checkpoint: bytes = self._request("save")
        return checkpoint

    def _restore_checkpoint(self, checkpoint: bytes, ignore_source_hash: bool) -> None:
        self._do_command("restore", checkpoint, ignore_source_hash)

    def _feed(self, samples: Samples, end: int) -> None:
        if self._running:
            raise TwinError("the twin is running by itself; call pause() before inject()")
        now = self._step(0)
        for tick, rows in groupby(samples.rows.tolist(), key=lambda row: row[0]):
            self._step(tick - now)
            now = tick
            for row in rows:
                self._give(row, samples.payloads)
        self._step(end - now)

    def _give(self, row: tuple[int, ...], payloads: bytes) -> None:
        """Applies one row of samples.SAMPLE."""
        from ..samples import NO_CHANNEL  # imported here, because it needs NumPy

        _, stamp_ns, channel, age_ticks, at, field, element, size, _ = row
        if channel != NO_CHANNEL:
            size = self.machine.channels[channel].field.size
            self._sample(channel, payloads[at : at + size], age_ticks, stamp_ns)
            return
        target = self._fields[field]
        parts = [Selection(target.path, target, 0, target.count, target.shape)]
        if size < target.size:
            scalars = range(element, element + size * target.count // target.size)
            parts = [Selection(_path_of(target, number), target, number, 1, ()) for number in scalars]
        self._write([(part, payloads[at + i * part.size : at + (i + 1) * part.size]) for i, part in enumerate(parts)])

    def _tap(self, ranges: Sequence[tuple[int, int]], capacity: int) -> ProcessTap:
        return ProcessTap(ranges, capacity, self._tap_open)

    # ---- recording --------------------------------------------------------------------------------------------------

    def record(self, bag: str | Path, name_space: str = "", split: str = "") -> None:
        if split:
            raise TwinError("the program of a ProcessTwin does not split what its socket records")
        self._do_command("record", Path(bag).absolute(), name_space)

    def stop_recording(self) -> None:
        self._do_command("stop_recording")


class _ProcessBoard:
    """The simulated hardware of the other process (hardware.Board); every access is a request."""

    def __init__(self, twin: ProcessTwin):
        self._twin = twin

    def read(self, bank: str, number: int) -> Any:
        return self._twin._request("hardware", bank, number).value

    def write(self, bank: str, number: int, value: Any) -> None:
        self._twin._do_command("hardware", bank, number, value)

    def failures(self) -> int:
        return int(self._twin._request("hardware", "gpio", 0).failures)


def _path_of(field: Field, element: int) -> str:
    """The path of scalar number `element`, in row-major order."""
    indices: list[str] = []
    for extent in reversed(field.shape):
        element, index = divmod(element, extent)
        indices.append(f"[{index}]")
    return field.path + "".join(reversed(indices))
