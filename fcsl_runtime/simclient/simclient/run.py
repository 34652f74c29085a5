# SPDX-License-Identifier: Apache-2.0
"""Python wrapper of fcsl_run.h and the message encoder of fcsl_codec.h: one hosted machine. Same names and meaning."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Mapping, Sequence
from ctypes import byref, c_char, c_char_p, c_int64, c_uint64
from ctypes import c_void_p as ptr
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .c_machine import HEALTH_NAMES, CMachine
from .c_run import CError, CMessage, CRecordOptions, CSeries, load_runtime
from .descriptor import Machine, read_machine
from .errors import TwinError
from .fork_safety import FORKED, for_children, not_for_children
from .hardware import COUNT, CSimulatedHardware
from .library import runtime_library
from .parameters import CParameters, Parameters

if TYPE_CHECKING:
    from .events import Event
    from .instance_times import InstanceTime
    from .requirements import Verdict

#: fcsl_tick_message_t by topic.
TICK_MESSAGES = {"state": 0, "transitions": 1, "health": 2, "faults": 3}

#: Size of an fcsl_sample_t (samples.SAMPLE).
SAMPLE_BYTES = 48

_SENSOR = 0
_ACTUATOR = 1
#: Ticks per call into C, during which Python handles no signal.
_SLICE_TICKS = 100_000
#: Largest generated message in bytes; a machine that needs more is rejected when it is opened.
_MAX_MESSAGE_BYTES = 1 << 20


class Run:
    """Owns one fcsl_run_t. Not thread-safe; every failure is a TwinError with the runtime's message."""

    def __init__(self, library: Path, machine: str | None, parameters: Parameters | None = None):
        self._handle: int | None = None
        self._without = "the twin is closed"
        self._checkpoint: ctypes.Array[c_char] | None = None
        self._lib = load_runtime(runtime_library())
        self._error = CError()
        self._handle = self._open(library, machine, None if parameters is None else parameters.to_c())
        if not self._handle:
            raise self._failure()
        self.machine: Machine = read_machine(self._lib.fcsl_run_machine(self._handle))
        self._calls_c, self._mode_changes = any(f.impure for f in self.machine.fields.values()), 0
        descriptor = self._lib.fcsl_run_machine(self._handle)
        self._message_capacity = self._lib.fcsl_message_capacity(descriptor, _SENSOR)
        self._actuator_message = ctypes.create_string_buffer(self._lib.fcsl_message_capacity(descriptor, _ACTUATOR))
        address = self._lib.fcsl_run_data(self._handle)
        self._data = memoryview((c_char * self.machine.size).from_address(address)).cast("B")
        self._message = ctypes.create_string_buffer(_MAX_MESSAGE_BYTES)
        # Preconverted arguments, and a function without argument conversion, halve the time of a tick.
        self._once = self._lib["fcsl_run_step_once"]
        self._once.restype = c_int64
        self._once_arguments = (ptr(self._handle), byref(self._error))

    def _open(self, library: Path, machine: str | None, parameters: CParameters | None) -> int | None:
        """The address of the fcsl_run_t, or None with the error filled in."""
        name = None if machine is None else machine.encode()
        handle: int | None = self._lib.fcsl_run_open(str(library).encode(), name, parameters, byref(self._error))
        return handle

    def _failure(self) -> BaseException:
        return TwinError(self._error.text.decode("utf-8", "replace"))

    def _check(self, status: int) -> None:
        if status < 0:
            raise self._failure()

    def handle(self) -> int:
        """The address of the fcsl_run_t. Raises TwinError once closed."""
        if self._handle is None:
            raise TwinError(self._without)
        return self._handle

    def leave_to_parent(self) -> None:
        """In a forked process: abandons the recording, whose writer thread is in the parent."""
        self._handle, self._data = None, memoryview(b"")
        self._without = FORKED

    def descriptor(self) -> CMachine:
        """The machine's C descriptor, which is valid as long as the run is open."""
        described: CMachine = self._lib.fcsl_run_machine(self.handle()).contents
        return described

    @property
    def address(self) -> int:
        """Address of the machine struct, readable until the run is closed. Raises TwinError once it is."""
        return int(self._lib.fcsl_run_data(self.handle()))

    @property
    def actuator_address(self) -> int:
        """Address of a machine struct whose actuator channels hold what the actuators get after the last tick: safe
        values while the machine is disarmed. Raises TwinError once the run is closed."""
        return int(self._lib.fcsl_run_actuator_data(self.handle()))

    @property
    def safe_address(self) -> int | None:
        """Address of a machine struct whose actuator channels hold their safe values; None where nothing arms the
        machine. Raises TwinError once the run is closed."""
        address = self._lib.fcsl_run_safe_data(self.handle())
        return None if address is None else int(address)

    def close(self) -> None:
        """Stops recording and unloads; idempotent."""
        if self._handle is None:
            return
        handle, self._handle = self._handle, None
        self._data = memoryview(b"")
        self._check(self._lib.fcsl_run_close(handle, byref(self._error)))

    def read(self, offset: int, size: int) -> bytes:
        """`size` bytes of the machine struct from `offset` on."""
        self.handle()
        return bytes(self._data[offset : offset + size])

    @property
    def tick(self) -> int:
        """Ticks completed since init."""
        return int(self._lib.fcsl_run_tick(self.handle()))

    def set(self, field: int, element: int, data: bytes) -> None:
        """Writes scalars of field number `field` from scalar `element` on; takes effect before the next tick."""
        self._check(self._lib.fcsl_run_set(self.handle(), field, element, data, len(data), byref(self._error)))

    def check_set(self, field: int, element: int, data: bytes) -> None:
        """Raises what `set` would, and writes nothing."""
        self._check(self._lib.fcsl_run_check_set(self.handle(), field, element, data, len(data), byref(self._error)))

    def set_state(self, state: int) -> None:
        """Makes state number `state` active at once; every instance becomes stale."""
        self._check(self._lib.fcsl_run_set_state(self.handle(), state, byref(self._error)))

    def inject_overrun(self, instance: int) -> None:
        """The next execute of instance number `instance` counts as an overrun."""
        self._check(self._lib.fcsl_run_inject_overrun(self.handle(), instance, byref(self._error)))

    def inject_fault(self, instance: int) -> None:
        """The next execute of instance number `instance` counts as a fault."""
        self._check(self._lib.fcsl_run_inject_fault(self.handle(), instance, byref(self._error)))

    def inject_health(self, instance: int, health: str) -> None:
        """After its next execute instance number `instance` is at least "degraded" or "failed"."""
        number = HEALTH_NAMES.index(health)
        self._check(self._lib.fcsl_run_inject_health(self.handle(), instance, number, byref(self._error)))

    def verdicts(self) -> list[Verdict]:
        """On the machine's requirements, after the ticks so far."""
        from .requirements import read_verdicts

        return read_verdicts(self._lib, self.handle())

    def times(self) -> dict[str, InstanceTime]:
        """How long the machine's instances, and its steps, took so far. Empty if it is not measured."""
        from .instance_times import read_times

        return read_times(self._lib, self.handle())

    def observed(self) -> list[str]:
        """Paths of the values that the requirements read, in the order of a row of `judge`; some occur several times."""
        table = self._lib.fcsl_run_monitor(self.handle())
        return [o.path.decode() for o in table.contents.observed[: table.contents.observed_count]] if table else []

    def observed_by(self) -> dict[str, list[str]]:
        """The paths that each requirement reads, by its id."""
        table = self._lib.fcsl_run_monitor(self.handle())
        found: dict[str, list[str]] = {}
        for required in table.contents.requirements[: table.contents.requirement_count] if table else ():
            own = table.contents.machine.contents.instances[required.instance].name + b"."
            observed = table.contents.observed[: table.contents.observed_count]
            found[required.id.decode()] = [o.path.decode() for o in observed if o.input.startswith(own)]
        return found

    def remembering_requirements(self) -> frozenset[str]:
        """Ids of those whose verdict in a tick depends on other ticks."""
        from .requirements import remembering

        table = self._lib.fcsl_run_monitor(self.handle())
        return remembering(table.contents) if table else frozenset()

    def restart_requirements(self) -> None:
        """Puts their memory and verdicts back to the beginning."""
        table = self._lib.fcsl_run_monitor(self.handle())
        self._check(self._lib.fcsl_run_use_monitor(self.handle(), table, byref(self._error)))

    def judge(self, rows: bytes, row_bytes: int) -> None:
        """Evaluates the requirements on recorded rows: the values of `observed` after a tick, one after another."""
        self._lib.fcsl_run_judge(self.handle(), rows, row_bytes, len(rows) // row_bytes)

    def save(self) -> bytes:
        """The whole machine struct, `machine.size` bytes; behind it what the requirements remember."""
        size = self._lib.fcsl_run_save_bytes(self.handle())
        data = ctypes.create_string_buffer(size)
        self._check(self._lib.fcsl_run_save(self.handle(), data, size, byref(self._error)))
        return data.raw

    def restore(self, data: bytes) -> None:
        """Restores the result of `save`, from a machine of the same layout. With the struct alone, or where it has been saved
        with other requirements, these begin anew."""
        self._check(self._lib.fcsl_run_restore(self.handle(), data, len(data), byref(self._error)))

    def checkpoint(self) -> bytes:
        """The run's complete state, as bytes for a file or another process (docs/guide/recording.md)."""
        if self._checkpoint is None:
            self._checkpoint = ctypes.create_string_buffer(self.checkpoint_capacity)
        size = self._lib.fcsl_run_checkpoint(self.handle(), self._checkpoint)
        return ctypes.string_at(self._checkpoint, size)

    @property
    def checkpoint_capacity(self) -> int:
        """Size of the largest checkpoint of this run, in bytes."""
        return int(self._lib.fcsl_run_checkpoint_capacity(self.handle()))

    def checkpoint_tick(self, checkpoint: bytes, ignore_source_hash: bool = False) -> int:
        """The tick that the checkpoint restores. Raises TwinError if it is no checkpoint of this machine."""
        tick, size = c_uint64(), len(checkpoint)
        status = self._lib.fcsl_run_checkpoint_tick(
            self.handle(), checkpoint, size, ignore_source_hash, byref(tick), byref(self._error)
        )
        self._check(status)
        return tick.value

    def restore_checkpoint(self, checkpoint: bytes, ignore_source_hash: bool = False) -> None:
        """Restores a checkpoint, including simulated hardware. Raises TwinError if it is not of this machine.

        `ignore_source_hash` accepts a checkpoint of other sources with the same layout.
        """
        size = len(checkpoint)
        self._check(
            self._lib.fcsl_run_restore_checkpoint(
                self.handle(), checkpoint, size, ignore_source_hash, byref(self._error)
            )
        )

    @property
    def is_armed(self) -> bool:
        """Whether the actuators get what the machine commands."""
        return bool(self._lib.fcsl_run_is_armed(self.handle()))

    def require_arming(self) -> None:
        """After a restore into a run that was disarmed: it stays so until the machine disarms and arms anew."""
        self._lib.fcsl_run_require_arming(self.handle())

    def hardware(self) -> CSimulatedHardware:
        """The simulated hardware of this run, to read and write between ticks."""
        simulated: CSimulatedHardware = self._lib.fcsl_run_simulated_hardware(self.handle()).contents
        return simulated

    def register(self, address: int) -> int:
        """The value of a simulated register."""
        return int(self._lib.fcsl_hw_sim_register(byref(self.hardware()), address))

    def set_register(self, address: int, value: int) -> None:
        """Raises TwinError if the simulated hardware has no room for one more register."""
        if self._lib.fcsl_hw_sim_set_register(byref(self.hardware()), address, value) != 0:
            raise TwinError(f"simulated hardware is full: {COUNT} registers have a value already")

    def hardware_failures(self) -> int:
        """Refused hardware reads and writes."""
        return int(self._lib.fcsl_run_hardware_failures(self.handle()))

    def substitute(self, instance: int, data: bytes) -> None:
        """Replaces the next tick's execute of an impure instance by its recorded result."""
        self._check(self._lib.fcsl_run_substitute(self.handle(), instance, data, len(data), byref(self._error)))

    def substitute_events(self, instance: int, data: bytes) -> None:
        """Replaces the events of that execute by the recorded ones."""
        self._check(self._lib.fcsl_run_substitute_events(self.handle(), instance, data, len(data), byref(self._error)))

    def events(self) -> list[Event]:
        """The last events that the algorithms reported, at most 1024."""
        from .events import read_events

        return read_events(self._lib, self.handle(), self.machine)

    def impure_executes(self) -> int:
        """Executes of impure instances that were not substituted."""
        return int(self._lib.fcsl_run_impure_executes(self.handle()))

    def time_executes(self) -> None:
        """From now on executes of instances with a max_wcet_us are timed on the monotonic clock."""
        self._lib.fcsl_run_set_clock(self.handle(), ctypes.cast(self._lib.fcsl_run_monotonic_ns, ptr), None)

    def attach(self) -> None:
        """Attaches the sensor channels: from now on samples come from `sense`, and channels age without them."""
        self._check(self._lib.fcsl_run_attach(self.handle(), byref(self._error)))

    def attach_channel(self, channel: int) -> None:
        """Attaches sensor channel number `channel`."""
        self._check(self._lib.fcsl_run_attach_channel(self.handle(), channel, byref(self._error)))

    def sense(self, message: bytes) -> None:
        """Takes a sensor message (fcsl_codec.h) for the next tick."""
        self._check(self._lib.fcsl_run_sense(self.handle(), message, len(message), byref(self._error)))

    def actuate(self) -> bytes:
        """The actuator message of the last completed tick."""
        size = self._lib.fcsl_run_actuate(self.handle(), self._actuator_message, len(self._actuator_message))
        if size < 0:
            raise TwinError(f"the actuator message exceeds {len(self._actuator_message)} bytes")
        return ctypes.string_at(self._actuator_message, size)

    def write_channel(self, channel: int, data: bytes, age_ticks: int = 0, stamp_ns: int = 0) -> None:
        """Writes one sensor sample for the next tick: row-major scalars, little-endian; its age in ticks, its stamp in
        ns.
        """
        status = self._lib.fcsl_run_write_channel(
            self.handle(), channel, data, len(data), age_ticks, stamp_ns, byref(self._error)
        )
        self._check(status)

    def write_channels(self, samples: Mapping[int, bytes]) -> None:
        """Writes sensor samples of age 0 for the next tick as one message: maps channel index to row-major scalars,
        little-endian.
        """
        machine = self.machine
        staging = bytearray(machine.size)
        select = bytearray(len(machine.channels))
        for index, data in samples.items():
            field = machine.channels[index].field
            if len(data) != field.size:
                name = machine.channels[index].name
                raise TwinError(f"channel `{name}` takes {field.size} bytes ({field.type_text}), got {len(data)}")
            staging[field.offset : field.offset + field.size] = data
            select[index] = 1
        room, message = ctypes.create_string_buffer(self._message_capacity), CMessage()
        channels = self._lib.fcsl_run_channels(self.handle())
        status = self._lib.fcsl_message_encode_sensors(
            channels, bytes(staging), self.tick, bytes(select), room, len(room), byref(message)
        )
        if status != 0:
            raise TwinError(f"sensor message refused: {self._lib.fcsl_message_status_text(status).decode()}")
        self._check(self._lib.fcsl_run_sense_message(self.handle(), byref(message), byref(self._error)))

    def step(self, ticks: int) -> None:
        """Runs `ticks` ticks in slices, so that Ctrl-C is handled between two ticks."""
        while ticks > 0:
            slice_ticks = min(ticks, _SLICE_TICKS)
            self._check(self._lib.fcsl_run_step(self.handle(), slice_ticks, byref(self._error)))
            ticks -= slice_ticks
        if self._calls_c:
            self._check_mode()

    def _check_mode(self) -> None:
        """Raises TwinError where C code that an instance calls left another floating-point mode."""
        by = c_char_p()
        changes = int(self._lib.fcsl_run_mode_changes(self.handle(), byref(by)))
        if changes > self._mode_changes:
            self._mode_changes = changes
            raise TwinError(
                f"instance `{(by.value or b'').decode()}` left another floating-point mode (rounding, or small numbers "
                "become zero): the C code that it calls, or a library that this loads, changed it, and bits depend on "
                "it. The mode is restored; let that code give it back itself"
            )

    def step_once(self) -> int:
        """Runs one tick; returns the number completed since init."""
        if self._handle is None:
            self.handle()
        done: int = self._once(*self._once_arguments)
        if done < 0:
            raise self._failure()
        if self._calls_c:
            self._check_mode()
        return done

    def trace(self, ranges: Sequence[tuple[int, int]], rows: int) -> RunTrace:
        """Traces these parts (offset, size) of the machine struct: their values after each of the last `rows` ticks."""
        packed = struct.pack(f"={2 * len(ranges)}I", *(number for pair in ranges for number in pair))
        begun = self._lib.fcsl_run_trace_begin(self.handle(), packed, len(ranges), rows, byref(self._error))
        if not begun:
            raise self._failure()
        return RunTrace(self, begun, rows, sum(size for _, size in ranges))

    def feed(self, samples: bytes, payloads: bytes, end: int) -> None:
        """Runs the ticks before `end`; `samples` is an array of fcsl_sample_t in tick order.

        Python handles no signal meanwhile, so long runs should be split into slices.
        """
        count = len(samples) // SAMPLE_BYTES
        handle, error = self.handle(), byref(self._error)
        self._check(self._lib.fcsl_run_feed(handle, samples, count, payloads, len(payloads), end, error))

    def feed_series(self, series: ctypes.Array[CSeries], end: int) -> None:
        """The same with an array of CSeries, which goes on where the last call left it."""
        self._check(self._lib.fcsl_run_feed_series(self.handle(), series, len(series), end, byref(self._error)))

    def record(self, bag: Path, name_space: str, lossless: bool, fields: str | None = None, split: str = "") -> None:
        """Records to the directory `bag`, which must not exist. `lossless`: waits for the disk instead of dropping
        records.

        `fields`: globs of field paths, separated by commas (None: inputs and outputs). `split`: how the bag is split into
        files (docs/guide/recording.md)."""
        chosen = None if fields is None else fields.encode()
        options = CRecordOptions(str(bag).encode(), name_space.encode(), int(lossless), chosen, split.encode())
        self._check(self._lib.fcsl_run_record(self.handle(), byref(options), byref(self._error)))
        not_for_children(self)

    def record_stop(self) -> None:
        """Completes the bag."""
        for_children(self)
        self._check(self._lib.fcsl_run_record_stop(self.handle(), byref(self._error)))

    def record_time(self, time_ns: int) -> None:
        """Sets the time of the coming records and the stamp of their messages, in ns; call it before each tick.

        Without it tick k is at k / tick_hz. For machines that tick on another clock, such as ROS time.
        """
        self._lib.fcsl_run_record_time(self.handle(), time_ns)

    def record_check(self) -> None:
        """Raises TwinError once the disk has failed. A recording that is not lossless reports this nowhere else."""
        self._check(self._lib.fcsl_run_record_check(self.handle(), byref(self._error)))

    def record_dropped(self) -> int:
        """Records (a tick, a host write) missing in the bag, because the writer was too slow or the disk failed."""
        return int(self._lib.fcsl_run_record_dropped(self.handle()))

    def message(self, instance: int) -> bytes:
        """CDR of the instance's generated message of the last completed tick."""
        size = self._lib.fcsl_run_message(self.handle(), instance, self._message, len(self._message))
        if size < 0:
            raise TwinError(f"the message of instance {instance} exceeds {len(self._message)} bytes")
        return ctypes.string_at(self._message, size)

    def tick_message(self, what: str) -> bytes:
        """CDR of the last completed tick's message of this kind (see TICK_MESSAGES); empty if the tick has none."""
        size = self._lib.fcsl_run_tick_message(self.handle(), TICK_MESSAGES[what], self._message, len(self._message))
        if size < 0:
            raise TwinError(f"the {what} message exceeds {len(self._message)} bytes")
        return ctypes.string_at(self._message, size)


class RunTrace:
    """A trace of a run (fcsl_run_trace_begin): one row of `row_bytes` per tick, the last `capacity` of them."""

    def __init__(self, run: Run, trace: int, capacity: int, row_bytes: int):
        self._run, self._trace, self.capacity, self.row_bytes = run, trace, capacity, row_bytes

    def rows(self) -> int:
        """Rows taken so far, including discarded ones."""
        self._run.handle()
        return int(self._run._lib.fcsl_run_trace_rows(self._trace))

    def read(self, first: int, count: int) -> bytearray:
        """`count` rows from row `first` on. Raises TwinError if they were discarded."""
        rows = bytearray(count * self.row_bytes)
        self.read_into(first, count, rows)
        return rows

    def read_into(self, first: int, count: int, rows: Any) -> None:
        """The same into a buffer that has room for them."""
        self._run.handle()
        room = (c_char * (count * self.row_bytes)).from_buffer(rows) if count else None
        status = self._run._lib.fcsl_run_trace_read(self._trace, first, count, room, byref(self._run._error))
        self._run._check(status)

    def close(self) -> None:
        """Ends the trace; closing the run ends it, too."""
        if self._run._handle is not None and self._trace:
            self._run._lib.fcsl_run_trace_end(self._run._handle, self._trace)
        self._trace = 0


def open_run(library: Path, machine: str | None, parameters: Parameters | None = None) -> Run:
    """Loads `machine` (None: the only one) of the machine library, to begin with `parameters` instead of the compiled values.

    Raises TwinError, also if it is older than its sources.
    """
    from fcsl_compiler.api.build import StaleBuild, check_record

    if not library.is_file():
        raise TwinError(f"{library}: no such machine library")
    run = Run(library, machine, parameters)
    try:
        check_record(library, run.machine.name, run.machine.build_hash)
    except StaleBuild as error:
        run.close()
        raise TwinError(str(error)) from None
    return run
