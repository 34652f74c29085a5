# SPDX-License-Identifier: Apache-2.0
"""A run of a machine in CPython: the descriptor of the compiled machine, whose functions call the reference.

Everything else (writes, checkpoints, recording, channels) is the same fcsl_run, working on the same flat memory.
"""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable, Iterator, Sequence
from ctypes import CFUNCTYPE, POINTER, Structure, byref, c_bool, c_char, c_int32, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..c_machine import EVENT_VALUES, EVENTS_PER_TICK, NO_OFFSET, CEvents, CMachine, CMonitor
from ..c_run import CError, load_runtime
from ..descriptor import EventSite, Machine, read_machine
from ..errors import TwinError
from ..events import pack_values
from ..library import runtime_library
from ..parameters import CParameters, Parameters
from ..run import Run

if TYPE_CHECKING:
    from fcsl_compiler.api.reference import EventRow, FaultRow, ReferenceMachine


class CHardware(Structure):
    """struct fcsl_hw"""

    _fields_ = [
        ("ctx", ptr),
        ("read_gpio", CFUNCTYPE(c_int32, ptr, c_uint32, POINTER(c_bool))),
        ("write_gpio", CFUNCTYPE(c_int32, ptr, c_uint32, c_bool)),
        ("read_adc", CFUNCTYPE(c_int32, ptr, c_uint32, POINTER(c_uint32))),
        ("read_u32", CFUNCTYPE(c_int32, ptr, c_uint32, POINTER(c_uint32))),
        ("write_u32", CFUNCTYPE(c_int32, ptr, c_uint32, c_uint32)),
    ]


class CHost(Structure):
    """fcsl_host_t"""

    _fields_ = [
        ("ctx", ptr),
        ("clock_ns", CFUNCTYPE(c_uint64, ptr)),
        ("hw", POINTER(CHardware)),
        ("substitute", CFUNCTYPE(c_int32, ptr, c_uint32)),
        ("executed", CFUNCTYPE(None, ptr, c_uint32)),
        ("measure", CFUNCTYPE(None, ptr, c_int32)),
        ("events", POINTER(CEvents)),
    ]


_Init = CFUNCTYPE(None, ptr)
_Start = CFUNCTYPE(c_int32, ptr)
_Step = CFUNCTYPE(None, ptr, ptr)
_ForceState = CFUNCTYPE(None, ptr, c_int32)
_MACHINES_MAX = 1024


def _reader(hardware: CHardware, name: str, scalar: Any) -> Callable[[int], Any]:
    """Returns a reader, whose result is None (false or zero) if there is no such pin, channel or register."""

    def read(number: int) -> Any:
        function, value = getattr(hardware, name), scalar()
        return value.value if function and function(hardware.ctx, number, byref(value)) == 0 else None

    return read


def _writer(hardware: CHardware, name: str) -> Callable[[int, Any], None]:
    def write(number: int, value: Any) -> None:
        function = getattr(hardware, name)
        if function:
            function(hardware.ctx, number, value)

    return write


def _hardware(hardware: CHardware) -> dict[str, Callable[..., Any]]:
    """The hardware builtins by name."""
    return {
        "hw_read_gpio": _reader(hardware, "read_gpio", c_bool),
        "hw_write_gpio": _writer(hardware, "write_gpio"),
        "hw_read_adc": _reader(hardware, "read_adc", c_uint32),
        "hw_read_u32": _reader(hardware, "read_u32", c_uint32),
        "hw_write_u32": _writer(hardware, "write_u32"),
    }


def find_descriptor(library: Path, name: str) -> CMachine:
    """The descriptor of machine `name` in a compiled library, which stays loaded. Its fields may be folded. Raises TwinError."""
    table = (POINTER(CMachine) * _MACHINES_MAX).in_dll(ctypes.CDLL(str(library)), "fcsl_machines")
    for pointer in table:
        if not pointer:
            break
        if pointer.contents.name == name.encode():
            return pointer.contents
    raise TwinError(f"{library}: no machine `{name}`")


def unfolded(lib: ctypes.CDLL, descriptor: CMachine) -> CMachine:
    """It with its fields, in memory that stays. Raises TwinError."""
    error = CError()
    whole = lib.fcsl_library_unfold(byref(descriptor), byref(ptr()), byref(error))
    if not whole:
        raise TwinError(error.text.decode("utf-8", "replace"))
    found: CMachine = whole.contents
    return found


def find_monitor(library: Path, name: str) -> CMonitor | None:
    """That of machine `name` in a compiled library, which stays loaded; None without requirements."""
    try:
        table = (POINTER(CMonitor) * _MACHINES_MAX).in_dll(ctypes.CDLL(str(library)), "fcsl_monitors")
    except ValueError:  # no machine of it has any
        return None
    for pointer in table:
        if not pointer:
            break
        if pointer.contents.watched == name.encode():
            return pointer.contents
    return None


def layout_of(descriptor: CMachine, machine: Machine) -> dict[str, int]:
    """Offsets in the form of the reference (fcsl_compiler.reference.memory.Layout)."""
    offsets = {field.path: field.offset for field in machine.fields.values()}
    offsets["machine.current"] = descriptor.current_offset
    for instance in machine.instances:
        inject = descriptor.instances[instance.index]
        offsets[f"{instance.name}.inject_fault"] = inject.inject_fault_offset
        if inject.inject_overrun_offset != NO_OFFSET:
            offsets[f"{instance.name}.inject_overrun"] = inject.inject_overrun_offset
    for channel in machine.channels:
        if channel.direction == "sensor":
            raw = descriptor.channels[channel.index]
            offsets[f"channels.{channel.name}.attached"] = raw.attached_offset
            offsets[f"channels.{channel.name}.fresh"] = raw.fresh_offset
            offsets[f"channels.{channel.name}.sample_age"] = raw.sample_age_offset
    return offsets


def fault_rows_of(machine: Machine) -> list[FaultRow]:
    """The table of fault places in the form of the reference."""
    return [(p.file, p.line, p.column, p.cause) for p in machine.fault_places]


def event_rows_of(machine: Machine) -> list[EventRow]:
    """The table of the places that report events in the form of the reference."""
    return [(s.instance, s.file, s.line, s.column) for s in machine.event_sites]


class _Host:
    """What `step` may use of the host at `address`, read from there only where it is used
    (fcsl_compiler.reference.machine.Host)."""

    def __init__(self, address: int, sites: Sequence[EventSite]):
        self.address, self._host, self._sites = address, CHost.from_address(address), sites

    @property
    def clock_ns(self) -> Callable[[], int] | None:
        clock, context = self._host.clock_ns, self._host.ctx
        return (lambda: int(clock(context))) if clock else None

    @property
    def hardware(self) -> dict[str, Callable[..., Any]] | None:
        return _hardware(self._host.hw.contents) if self._host.hw else None

    @property
    def substitute(self) -> Callable[[int], bool] | None:
        substitute, context = self._host.substitute, self._host.ctx
        return (lambda instance: bool(substitute(context, instance))) if substitute else None

    @property
    def event(self) -> Callable[[int, Sequence[Any]], None] | None:
        return self._append if self._host.events else None

    def _append(self, site: int, values: Sequence[Any]) -> None:
        """As fcsl_event.h does."""
        events = self._host.events.contents
        if events.count >= EVENTS_PER_TICK:
            events.lost += 1
            return
        event = events.list[events.count]
        packed = pack_values(self._sites[site], values)
        event.site, event.values[:] = site, [*packed, *[0] * (EVENT_VALUES - len(packed))]
        events.count += 1

    @property
    def executed(self) -> Callable[[int], None] | None:
        executed, context = self._host.executed, self._host.ctx
        return (lambda instance: executed(context, instance)) if executed else None


class PythonMachine:
    """`descriptor` is a copy of the compiled machine's descriptor whose functions call the reference.

    Exceptions cannot propagate through C: the first one is stored in `failure`, and its tick is undone.
    """

    def __init__(self, compiled: CMachine, reference: ReferenceMachine, sites: Sequence[EventSite]):
        self._reference, self._size, self._sites = reference, compiled.size, sites
        self._address, self._memory = 0, memoryview(b"")
        self._host: _Host | None = None
        self.failure: BaseException | None = None
        self._callbacks = {
            "init": _Init(self._init),
            "start": _Start(self._start),
            "step": _Step(self._step),
            "force_state": _ForceState(self._force_state),
        }
        self.descriptor = CMachine.from_buffer_copy(compiled)
        self.descriptor.stack_bytes = 0  # Python keeps its arrays elsewhere
        self.descriptor.measured = 0  # the times of CPython say nothing of the machine's
        for name, callback in self._callbacks.items():
            setattr(self.descriptor, name, ctypes.cast(callback, ptr).value)

    def _memory_at(self, address: int) -> memoryview:
        """The memory of the machine, which stays at one address while it runs."""
        if address != self._address:
            self._address = address
            self._memory = memoryview((c_char * self._size).from_address(address)).cast("B")
        return self._memory

    @contextlib.contextmanager
    def _kept(self) -> Iterator[None]:
        try:
            yield
        except BaseException as error:
            self.failure = error

    def _init(self, address: int) -> None:
        with self._kept():
            self._reference.init(self._memory_at(address))

    def _start(self, address: int) -> int:
        status = -1
        if self.failure is None:
            with self._kept():
                status = self._reference.start(self._memory_at(address))
        return status

    def _step(self, address: int, host: int) -> None:
        if self.failure is not None:  # it ended the ticks of this call
            return
        memory = self._memory_at(address)
        before = bytes(memory)
        if self._host is None or self._host.address != host:
            self._host = _Host(host, self._sites)
        try:
            self._reference.step(memory, self._host)
        except BaseException as error:
            self.failure = error
            memory[:] = before

    def _force_state(self, address: int, state: int) -> None:
        with self._kept():
            self._reference.force_state(self._memory_at(address), state)


#: Makes a reference of offsets, fault places and sites of events.
MakeReference = Callable[[dict[str, int], Sequence["FaultRow"], Sequence["EventRow"]], "ReferenceMachine"]


def _python_machine(compiled: CMachine, make_reference: MakeReference) -> PythonMachine:
    machine = read_machine(ctypes.pointer(compiled))
    reference = make_reference(layout_of(compiled, machine), fault_rows_of(machine), event_rows_of(machine))
    return PythonMachine(compiled, reference, machine.event_sites)


class PythonRun(Run):
    """A run of a PythonMachine. Exceptions of user code propagate out of the call that ran it. `make_monitor`: of the
    machine's requirements; None without."""

    def __init__(
        self,
        library: Path,
        name: str,
        make_reference: MakeReference,
        make_monitor: MakeReference | None,
        parameters: Parameters | None = None,
    ):
        compiled = unfolded(load_runtime(runtime_library()), find_descriptor(library, name))
        self._python = _python_machine(compiled, make_reference)
        self._machines = [self._python]
        super().__init__(library, name, parameters)
        monitor = find_monitor(library, name)
        if make_monitor is not None and monitor is not None:
            self._machines.append(_python_machine(monitor.machine.contents, make_monitor))
            self._monitor = CMonitor.from_buffer_copy(monitor)
            self._monitor.machine = ctypes.pointer(self._machines[-1].descriptor)
            self._check(self._lib.fcsl_run_use_monitor(self.handle(), byref(self._monitor), byref(self._error)))

    def _open(self, library: Path, machine: str | None, parameters: CParameters | None) -> int | None:
        descriptor, error = byref(self._python.descriptor), byref(self._error)
        handle: int | None = self._lib.fcsl_run_open_machine(descriptor, parameters, error)
        return handle

    def _check(self, status: int) -> None:
        if any(machine.failure is not None for machine in self._machines):
            status = -1
        super()._check(status)

    def _failure(self) -> BaseException:
        failed = [machine for machine in self._machines if machine.failure is not None]
        failure = failed[0].failure if failed else None
        for machine in failed:
            machine.failure = None
        return super()._failure() if failure is None else failure


def open_python_run(
    config: Path,
    library: Path,
    name: str,
    target: str,
    instances: Sequence[str] | None = None,
    parameters: Parameters | None = None,
) -> PythonRun:
    """Runs the machine JSON `config` in CPython, with the descriptor of its compiled library for `target`.

    `instances`: those of a subset machine. `parameters`: with which it begins. Raises TwinError.
    """
    from fcsl_compiler.api.build import ToolchainError, toolchain
    from fcsl_compiler.api.diagnostics import DiagnosticError
    from fcsl_compiler.api.reference import (
        ReferenceMachine,
        build_externs,
        compile_machine,
        compile_monitor,
        externs_of,
    )

    try:
        compiled = compile_machine(config, toolchain(), until="schedule", target=target, instances=instances)
        compile_monitor(compiled, until="schedule")
        checked, monitor = compiled.checked, compiled.monitor_code
        externs = externs_of(build_externs(config, target)) if checked.externs else None
    except (DiagnosticError, ToolchainError) as error:
        raise TwinError(str(error)) from None
    return PythonRun(
        library,
        name,
        lambda layout, places, events: ReferenceMachine(checked, layout, places, externs, events),
        None if monitor is None else lambda layout, places, _: ReferenceMachine(monitor.checked, layout, places, None),
        parameters,
    )
