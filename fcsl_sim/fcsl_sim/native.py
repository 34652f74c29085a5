# SPDX-License-Identifier: Apache-2.0
"""Python wrapper of fcsl_sim.h, with the names, order and meaning of the C header."""

from __future__ import annotations

import ctypes
import functools
import struct
from collections.abc import Mapping, Sequence
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_int32, c_int64, c_size_t, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from fcsl_compiler.api.packages import PackageNotFound, package_prefix
from fcsl_compiler.api.types import count_of, shape_of
from simclient.c_machine import CMachine
from simclient.c_run import TIMES, VERDICTS, CError
from simclient.descriptor import Machine, read_machine
from simclient.errors import TwinError
from simclient.instance_times import InstanceTime, read_times
from simclient.library import bind
from simclient.parameters import CParameters
from simclient.paths import resolve
from simclient.requirements import Verdict, read_verdicts, read_violations
from simclient.ros.composer import Composer
from simclient.ros.publish_queue import PublishQueue
from simclient.values import Value, read_part

from .errors import SimError
from .models import ModelTable, Scalar, parse_description
from .plan import Plan

_SENT = ("packets", "configurations", "datagrams", "failures", "overwritten")
_OBSERVED = ("ticks", "dropped")
_ROS = (*_OBSERVED, "refused")
_COMMANDS = ("commands", "ticks_without", "longest_without")
_LOG_BYTES = 512


class _Counters(ctypes.Structure):
    """fcsl_telemetry_counters_t"""

    _fields_ = [(name, c_uint64) for name in _SENT]


class _Observed(ctypes.Structure):
    """fcsl_observers_counters_t"""

    _fields_ = [(name, c_uint64) for name in _OBSERVED]


class _Ros(ctypes.Structure):
    """fcsl_ros_graph_counters_t"""

    _fields_ = [(name, c_uint64) for name in _ROS]


class _Commands(ctypes.Structure):
    """fcsl_external_counters_t"""

    _fields_ = [(name, c_uint64) for name in _COMMANDS]


class _RunningCall(ctypes.Structure):
    """fcsl_sim_running_call_t"""

    _fields_ = (
        ("instance", ctypes.c_char * 256),
        ("function", c_char_p),
        ("entry", c_uint64),
        ("time_ns", c_int64),
    )


class _Part(ctypes.Structure):
    """fcsl_sim_part_t"""

    _fields_ = (("data", ptr), ("size", c_uint32))


_ERROR = POINTER(CError)
#: Result type and argument types of every function used here. The simulator brings those of libfcsl_run.so.
_PROTOTYPES: dict[str, tuple[type | None, list[type]]] = {
    "fcsl_sim_open": (ptr, [c_char_p, c_size_t, POINTER(CParameters), _ERROR]),
    "fcsl_sim_close": (c_int, [ptr, _ERROR]),
    "fcsl_sim_machine": (POINTER(CMachine), [ptr]),
    "fcsl_sim_tick": (c_uint64, [ptr]),
    "fcsl_sim_ticks": (c_uint64, [ptr]),
    "fcsl_sim_status": (c_int, [ptr]),
    "fcsl_sim_record": (c_int, [ptr, c_char_p, c_char_p, c_char_p, _ERROR]),
    "fcsl_sim_record_stop": (c_int, [ptr, _ERROR]),
    "fcsl_sim_run": (c_int64, [ptr, c_uint64, _ERROR]),
    "fcsl_sim_run_traced": (c_int, [ptr, c_uint64, POINTER(_Part), c_uint32, ptr, POINTER(c_uint64), _ERROR]),
    "fcsl_sim_set_speed": (c_int, [ptr, c_double, _ERROR]),
    "fcsl_sim_state": (c_int32, [ptr]),
    "fcsl_sim_machine_data": (ptr, [ptr]),
    "fcsl_sim_hosted": (ptr, [ptr]),
    "fcsl_sim_write": (c_int, [ptr, c_uint32, c_uint32, c_char_p, c_uint32, _ERROR]),
    "fcsl_sim_checkpoint_capacity": (c_size_t, [ptr]),
    "fcsl_sim_checkpoint": (c_size_t, [ptr, ptr]),
    "fcsl_sim_restore_checkpoint": (c_int, [ptr, c_char_p, c_size_t, _ERROR]),
    "fcsl_sim_slope_count": (c_uint32, [ptr]),
    "fcsl_sim_slopes": (c_int, [ptr, POINTER(c_double), _ERROR]),
    "fcsl_sim_listen": (c_int, [ptr, c_char_p, c_char_p, c_uint32, _ERROR]),
    "fcsl_sim_accept": (c_int, [ptr, c_uint32, _ERROR]),
    "fcsl_sim_read_log": (c_int, [ptr, c_char_p]),
    "fcsl_sim_count_commands": (None, [ptr, POINTER(_Commands)]),
    "fcsl_sim_run_together": (c_int64, [POINTER(ptr), c_uint32, c_uint64, c_uint32, POINTER(c_uint32), _ERROR]),
    "fcsl_sim_keep_alive": (None, [ptr]),
    "fcsl_sim_end": (None, [ptr, c_int]),
    "fcsl_sim_show_clock": (c_int, [ptr, ptr, c_uint32, _ERROR]),
    "fcsl_sim_show_truth": (c_int, [ptr, ptr, c_uint32, c_char_p, c_uint32, c_uint32, _ERROR]),
    "fcsl_sim_show_instances": (c_int, [ptr, ptr, c_uint32, ptr, c_uint32, ptr, c_uint32, c_uint32, _ERROR]),
    "fcsl_sim_show_channels": (c_int, [ptr, ptr, c_uint32, ptr, c_uint32, ptr, c_uint32, _ERROR]),
    "fcsl_sim_sense": (c_int64, [ptr, ptr, c_size_t, _ERROR]),
    "fcsl_sim_actuate": (c_int, [ptr, c_char_p, c_size_t, _ERROR]),
    "fcsl_sim_message_capacity": (c_size_t, [ptr]),
    "fcsl_sim_instance_count": (c_uint32, [ptr]),
    "fcsl_sim_instance_name": (c_char_p, [ptr, c_uint32]),
    "fcsl_sim_instance_data": (ptr, [ptr, c_uint32]),
    "fcsl_sim_serve": (c_int, [ptr, c_char_p, c_char_p, c_char_p, c_int, _ERROR]),
    "fcsl_sim_address": (c_char_p, [ptr]),
    "fcsl_sim_telemetry": (c_int, [ptr, c_char_p, c_char_p, _ERROR]),
    "fcsl_sim_telemetry_stop": (None, [ptr, POINTER(_Counters)]),
    "fcsl_sim_observers": (c_int, [ptr, c_char_p, c_char_p, _ERROR]),
    "fcsl_sim_observers_stop": (None, [ptr, POINTER(_Observed)]),
    "fcsl_sim_ros": (c_int, [ptr, c_char_p, c_char_p, _ERROR]),
    "fcsl_sim_ros_stop": (None, [ptr, POINTER(_Ros)]),
    "fcsl_sim_channel_data": (ptr, [ptr]),
    "fcsl_sim_sampled": (c_int, [ptr, c_uint32]),
    "fcsl_sim_truth_values": (c_uint32, [ptr, ptr, c_uint32]),
    "fcsl_sim_model_message_type": (c_char_p, [ptr, c_uint32]),
    "fcsl_sim_model_message_schema": (c_char_p, [ptr, c_uint32]),
    "fcsl_sim_model_message": (c_int64, [ptr, c_uint32, ptr, c_size_t]),
    "fcsl_sim_companion_count": (c_uint32, [ptr]),
    "fcsl_sim_companion": (ptr, [ptr, c_uint32]),
    "fcsl_sim_companion_name": (c_char_p, [ptr, c_uint32]),
    "fcsl_sim_companion_state": (c_char_p, [ptr, c_uint32, POINTER(c_uint64)]),
    "fcsl_sim_running_call": (c_int, [POINTER(_RunningCall)]),
    "fcsl_sim_watch_crashes": (c_int, [c_int, c_int, _ERROR]),
    "fcsl_sim_describe_model": (c_int64, [c_char_p, c_char_p, ptr, c_size_t, _ERROR]),
    "fcsl_run_machine": (POINTER(CMachine), [ptr]),
    "fcsl_run_data": (ptr, [ptr]),
    "fcsl_parameters_write": (c_int64, [POINTER(CMachine), ptr, ptr, ptr, c_size_t]),
    **VERDICTS,
    **TIMES,
}

#: fcsl_sim_status_t by number.
STATUS_NAMES = ("running", "duration", "until")
_LIBRARY = "libfcsl_sim.so"
#: Largest truth message in bytes: a model struct has at most 1 MiB (src/models/model.h), plus padding and header.
_MAX_TRUTH_BYTES = 3 << 20
_MAX_DESCRIPTION_BYTES = 1 << 20
#: FCSL_PARAMETERS_BYTES_MAX
_MAX_PARAMETER_BYTES = 1 << 20


@functools.cache
def _load(prefix: Path) -> ctypes.CDLL:
    path = prefix / "lib" / _LIBRARY
    try:
        return bind(path, _PROTOTYPES)
    except (OSError, AttributeError) as error:
        raise SimError(f"{path} cannot be used as the simulator: {error}; build package `fcsl_sim` again") from None


def simulator_library() -> ctypes.CDLL:
    """The native simulator of the environment. Raises SimError."""
    try:
        return _load(package_prefix("fcsl_sim"))
    except PackageNotFound as error:
        raise SimError(str(error)) from None


def _text(error: CError) -> str:
    return bytes(error.text).decode("utf-8", "replace")


def describe_model(library: Path, name: str) -> ModelTable:
    """Field table of model `name` in a compiled plugin. Raises SimError if the plugin is invalid."""
    error = CError()
    buffer = ctypes.create_string_buffer(_MAX_DESCRIPTION_BYTES)
    size = simulator_library().fcsl_sim_describe_model(
        str(library).encode(), name.encode(), buffer, len(buffer), byref(error)
    )
    if size < 0:
        raise SimError(_text(error))
    if size > len(buffer):
        raise SimError(f"{library}: the field table of model `{name}` exceeds {len(buffer)} bytes")
    return parse_description(buffer.raw[:size].decode("utf-8", "replace"), library)


@dataclass(frozen=True)
class RunningCall:
    """The function of a model that runs. `entry` is another number in each call; `time_s` that of the last instant."""

    instance: str
    function: str
    entry: int
    time_s: float


def running_call() -> RunningCall | None:
    """What runs now in the simulation that was opened last; None: no function of a model. From any thread."""
    at = _RunningCall()
    if not simulator_library().fcsl_sim_running_call(byref(at)):
        return None
    return RunningCall(at.instance.decode("utf-8", "replace"), at.function.decode(), at.entry, at.time_ns / 1e9)


def watch_crashes(watch: bool, as_json: bool) -> None:
    """Whether a crash within a model ends the process with a message that names it, as JSON too. Raises SimError."""
    error = CError()
    if simulator_library().fcsl_sim_watch_crashes(int(watch), int(as_json), byref(error)) < 0:
        raise SimError(_text(error))


class Failed(SimError):
    """An error of simulation number `number` of several."""

    def __init__(self, text: str, number: int):
        super().__init__(text)
        self.number = number


def run_together(simulations: Sequence[Simulation], ticks: int, slice_ms: int) -> int:
    """Steps simulations with external controllers together, up to `ticks` ticks, for about slice_ms; returns the ticks
    completed. A tick may then be under way. Raises Failed."""
    error, failed = CError(), c_uint32()
    handles = (ptr * len(simulations))(*(simulation.handle() for simulation in simulations))
    library = simulator_library()
    done = library.fcsl_sim_run_together(handles, len(handles), ticks, slice_ms, byref(failed), byref(error))
    if done < 0:
        raise Failed(_text(error), failed.value)
    return int(done)


class Simulation:
    """Owns one fcsl_sim_t. Not thread-safe; every failure is a SimError with the simulator's message.

    `plan` is the flat plan; `tables` maps each instance to its model's table, to read truth by name (both are results
    of fcsl_sim.load). A context manager.
    """

    def __init__(self, plan: Plan, tables: Mapping[str, ModelTable]):
        self._handle: int | None = None
        self._lib = simulator_library()
        self._error = CError()
        data = plan.text.encode()
        parameters = None if plan.parameters is None else plan.parameters.to_c()
        self._handle = self._lib.fcsl_sim_open(data, len(data), parameters, byref(self._error))
        if not self._handle:
            raise SimError(_text(self._error))
        self.machine: Machine = read_machine(self._lib.fcsl_sim_machine(self._handle))
        self.ticks = int(self._lib.fcsl_sim_ticks(self._handle))
        self._message = ctypes.create_string_buffer(self._lib.fcsl_sim_message_capacity(self._handle))
        self._truth = ctypes.create_string_buffer(_MAX_TRUTH_BYTES)
        count = self._lib.fcsl_sim_instance_count(self._handle)
        names = [self._lib.fcsl_sim_instance_name(self._handle, i).decode() for i in range(count)]
        self.instances: dict[str, int] = {name: i for i, name in enumerate(names)}
        self.tables = dict(tables)

    def __enter__(self) -> Simulation:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check(self, status: int) -> int:
        if status < 0:
            raise SimError(_text(self._error))
        return status

    def handle(self) -> int:
        """The fcsl_sim_t as an address. Raises SimError once closed."""
        if self._handle is None:
            raise SimError("the simulation is closed")
        return self._handle

    def close(self) -> None:
        """Stops recording and unloads; idempotent."""
        if self._handle is None:
            return
        handle, self._handle = self._handle, None
        self._check(self._lib.fcsl_sim_close(handle, byref(self._error)))

    def leave_to_parent(self) -> None:
        """In a forked process: abandons the recording, whose writer thread is in the parent."""
        self._handle = None

    @property
    def tick(self) -> int:
        """Controller ticks completed."""
        return int(self._lib.fcsl_sim_tick(self.handle()))

    @property
    def status(self) -> str:
        """`running`, `duration` (all ticks done) or `until` (the stop condition held)."""
        return STATUS_NAMES[self._lib.fcsl_sim_status(self.handle())]

    @property
    def state(self) -> str:
        """The hosted machine's state in the last completed tick."""
        return self.machine.states[self._lib.fcsl_sim_state(self.handle())]

    def machine_value(self, path: str) -> Value:
        """A value of the hosted machine after the last completed tick: `pilot.outputs.throttle`. Raises SimError."""
        try:
            part = resolve(path, self.machine)
        except TwinError as error:
            raise SimError(str(error)) from None
        base = self._lib.fcsl_sim_machine_data(self.handle())
        return read_part(part, lambda offset, size: ctypes.string_at(base + offset, size), self.machine)

    def controller_data(self) -> list[int]:
        """Addresses of the structs of all controllers, the first one's first."""
        data = self._lib.fcsl_run_data
        return [int(data(run)) for run in (self.hosted(), *self.companion_runs().values())]

    def changed_parameters(self, number: int, compiled: Simulation) -> str:
        """The parameter file of what differs between a controller and that of another simulation of it."""
        text = ctypes.create_string_buffer(_MAX_PARAMETER_BYTES)
        run = (self.hosted(), *self.companion_runs().values())[number]
        data, other = self.controller_data()[number], compiled.controller_data()[number]
        machine = self._lib.fcsl_run_machine(run)
        size = self._lib.fcsl_parameters_write(machine, data, other, text, len(text))
        if size < 0:
            raise SimError(f"a parameter file has at most {_MAX_PARAMETER_BYTES} bytes")
        return text.raw[:size].decode("utf-8", "replace")

    def companion_runs(self) -> dict[str, int]:
        """Address of the fcsl_run_t of each controller beside the first one, by its name; as `hosted`."""
        numbers = range(self._lib.fcsl_sim_companion_count(self.handle()))
        names = (self._lib.fcsl_sim_companion_name(self.handle(), i).decode() for i in numbers)
        return {name: int(self._lib.fcsl_sim_companion(self.handle(), i)) for i, name in enumerate(names)}

    def companions(self) -> dict[str, tuple[str, int]]:
        """State and completed ticks of each controller beside the first one, by its name."""
        found = {}
        for i in range(self._lib.fcsl_sim_companion_count(self.handle())):
            ticks = c_uint64()
            state = self._lib.fcsl_sim_companion_state(self.handle(), i, byref(ticks)).decode()
            found[self._lib.fcsl_sim_companion_name(self.handle(), i).decode()] = state, ticks.value
        return found

    def lost_requests(self, run: int | None = None) -> dict[str, int]:
        """How many requests each transition of the hosted machine has lost to another one: {"HOVER -> SAFE: ABORT": 1}.
        `run`: of the controller with this fcsl_run_t.
        """
        run = self.hosted() if run is None else run
        base = self._lib.fcsl_run_data(run)
        machine = read_machine(self._lib.fcsl_run_machine(run))
        return machine.lost_requests(lambda offset, size: ctypes.string_at(base + offset, size))

    def verdicts(self, run: int | None = None) -> list[Verdict]:
        """On the requirements of the hosted machine. `run`: of the controller with this fcsl_run_t."""
        return read_verdicts(self._lib, self.hosted() if run is None else run)

    def times(self, run: int | None = None) -> dict[str, InstanceTime]:
        """Of the hosted machine's instances; empty if it is not measured. `run`: of the controller with this fcsl_run_t."""
        return read_times(self._lib, self.hosted() if run is None else run)

    def violations(self) -> list[float]:
        """How often each requirement of the hosted machine was violated; NaN: not exercised."""
        return read_violations(self._lib, self.hosted())

    def run(self, ticks: int) -> int:
        """Runs up to `ticks` ticks; returns early at the end, after a change of state and after a wait. Returns ticks done."""
        return self._check(self._lib.fcsl_sim_run(self.handle(), ticks, byref(self._error)))

    def run_traced(self, ticks: int, parts: Sequence[tuple[int, int]]) -> tuple[int, bytes, SimError | None]:
        """As `run`, past changes of the state, too. Returns ticks done, a row for each, which has the parts (address, size) of
        the structs after it, and the error that ended the run."""
        table, done = (_Part * len(parts))(*(_Part(*part) for part in parts)), c_uint64()
        row_bytes = sum(size for _, size in parts)
        rows = ctypes.create_string_buffer(max(1, ticks * row_bytes))
        where = (table, len(parts), rows, byref(done))
        status = self._lib.fcsl_sim_run_traced(self.handle(), ticks, *where, byref(self._error))
        error = SimError(_text(self._error)) if status < 0 else None
        return done.value, ctypes.string_at(rows, done.value * row_bytes), error

    def set_speed(self, speed: float) -> None:
        """Limits `run` to this many simulated seconds per second from now on; 0: as fast as possible.

        Raises SimError.
        """
        self._check(self._lib.fcsl_sim_set_speed(self.handle(), speed, byref(self._error)))

    def record(self, bag: Path, name_space: str = "", split: str = "") -> None:
        """Records controller and truth into `bag`, from the next tick on. name_space: with or without surrounding
        slashes. split: how the bag is split into files (docs/guide/recording.md).
        """
        within, files = name_space.strip("/").encode(), split.encode()
        self._check(self._lib.fcsl_sim_record(self.handle(), str(bag).encode(), within, files, byref(self._error)))

    def record_stop(self) -> None:
        self._check(self._lib.fcsl_sim_record_stop(self.handle(), byref(self._error)))

    def hosted(self) -> int:
        """Address of the fcsl_run_t of the hosted machine, to write into it and to trace it (fcsl_run.h). The simulation
        alone steps it."""
        return int(self._lib.fcsl_sim_hosted(self.handle()))

    def write(self, instance: str, offset: int, data: bytes) -> None:
        """Replaces bytes of the struct of an instance, between two ticks. The next evaluation overwrites outputs and
        connected inputs."""
        number = self.instances[instance]
        self._check(self._lib.fcsl_sim_write(self.handle(), number, offset, data, len(data), byref(self._error)))

    def checkpoint(self) -> bytes:
        """Plant and machine between two ticks, the content of a checkpoint file (docs/guide/recording.md). Raises SimError."""
        room = ctypes.create_string_buffer(self._lib.fcsl_sim_checkpoint_capacity(self.handle()))
        size = self._lib.fcsl_sim_checkpoint(self.handle(), room)
        if size == 0:
            raise SimError("a simulation with a serial line cannot be restored, so it is not saved")
        return ctypes.string_at(room, size)

    def restore_checkpoint(self, checkpoint: bytes) -> None:
        """Goes on from there. Raises SimError for other bytes than those of a checkpoint of this simulation, and then
        changes nothing."""
        size = len(checkpoint)
        self._check(self._lib.fcsl_sim_restore_checkpoint(self.handle(), checkpoint, size, byref(self._error)))

    def slopes(self) -> list[float]:
        """The derivatives of all continuous states, by instance and state, from what the structs hold now; outputs are made
        from it, too. Nothing advances. Raises SimError for one that is not finite."""
        slopes = (c_double * self._lib.fcsl_sim_slope_count(self.handle()))()
        self._check(self._lib.fcsl_sim_slopes(self.handle(), slopes, byref(self._error)))
        return list(slopes)

    def listen(self, peer: str, timeout_ms: int, name_space: str = "") -> None:
        """A controller can connect from now on: to `wire:SPEC` or `zenoh:tcp:HOST:PORT`, as `fcsl-fc --hal` takes it.
        name_space: in front of the keys of the bus, with or without surrounding slashes. With `,free-running` behind an
        address of the bus nobody waits: set a speed."""
        within = name_space.strip("/").encode()
        status = self._lib.fcsl_sim_listen(self.handle(), peer.encode(), within, timeout_ms, byref(self._error))
        self._check(status)

    def accept(self, wait_ms: int) -> bool:
        """Waits for the controller, for up to `wait_ms`; whether it has come. `run` then steps in lock-step with it."""
        return self._check(self._lib.fcsl_sim_accept(self.handle(), wait_ms, byref(self._error))) == 0

    @property
    def problem(self) -> str:
        """Why the last call failed, or found nobody."""
        return _text(self._error)

    def log(self) -> list[str]:
        """With a free-running controller: that it came or went, since the last call."""
        text = ctypes.create_string_buffer(_LOG_BYTES)
        lines = []
        while self._lib.fcsl_sim_read_log(self.handle(), text):
            lines.append(text.value.decode(errors="replace"))
        return lines

    def commands(self) -> dict[str, int]:
        """With a free-running controller: ticks in which a command came, and in which none did; of these the most in a row."""
        counters = _Commands()
        self._lib.fcsl_sim_count_commands(self.handle(), byref(counters))
        return {name: int(getattr(counters, name)) for name in _COMMANDS}

    def keep_alive(self) -> None:
        """While no tick is run, called often: the controller waits on."""
        self._lib.fcsl_sim_keep_alive(self.handle())

    def end(self, another_follows: bool) -> None:
        """Tells the controller that the run is over, and whether another one follows."""
        self._lib.fcsl_sim_end(self.handle(), int(another_follows))

    def show_clock(self, queue: PublishQueue, topic: int) -> None:
        """Puts rosgraph_msgs/Clock into the publish queue, in each tick of `run_together`, as the next three do with messages of
        their own. `topic`: a number by which the publish queue's reader knows it."""
        self._check(self._lib.fcsl_sim_show_clock(self.handle(), queue.handle, topic, byref(self._error)))

    def show_truth(self, queue: PublishQueue, topic: int, head: bytes, every: int) -> None:
        """fcsl_msgs/PlantTruth in each n-th tick. head: its CDR up to the first value."""
        where = (queue.handle, topic, head, len(head), every)
        self._check(self._lib.fcsl_sim_show_truth(self.handle(), *where, byref(self._error)))

    def show_instances(
        self, queue: PublishQueue, topic: int, composer: Composer, instances: Sequence[str], every: int
    ) -> None:
        """A message composed of the structs of instances, in each n-th tick."""
        numbers = (c_uint32 * len(instances))(*(self.instances[name] for name in instances))
        what = (composer.handle, composer.size, numbers, len(numbers), every)
        self._check(self._lib.fcsl_sim_show_instances(self.handle(), queue.handle, topic, *what, byref(self._error)))

    def show_channels(self, queue: PublishQueue, topic: int, composer: Composer, channels: Sequence[int]) -> None:
        """A message composed of sensor channels, when one of these (by number) was sampled."""
        numbers = (c_uint32 * len(channels))(*channels)
        what = (composer.handle, composer.size, numbers, len(numbers))
        self._check(self._lib.fcsl_sim_show_channels(self.handle(), queue.handle, topic, *what, byref(self._error)))

    def serve(self, address: str, token: Path | None, paused: bool, checkpoints: Path | None = None) -> str:
        """Serves all variables on a Unix socket's path or `tcp:HOST:PORT` (docs/reference/variables.md); only before the first
        tick.

        Returns the address. `run` executes commands, and runs no ticks while paused. `checkpoints`: folder of the
        checkpoint files that clients name. Raises SimError.
        """
        secret, folder = (str(path).encode() if path else None for path in (token, checkpoints))
        where = (address.encode(), secret, folder)
        self._check(self._lib.fcsl_sim_serve(self.handle(), *where, int(paused), byref(self._error)))
        return str(self._lib.fcsl_sim_address(self.handle()).decode())

    def telemetry(self, address: str, fields: str | None) -> None:
        """Sends the fields that globs select (docs/guide/monitoring.md) to `udp:HOST:PORT[/EVERY]`.

        Only before the first tick and before `serve`. Raises SimError.
        """
        chosen = None if fields is None else fields.encode()
        self._check(self._lib.fcsl_sim_telemetry(self.handle(), address.encode(), chosen, byref(self._error)))

    def telemetry_stop(self) -> dict[str, int]:
        """Sends the remaining packets and stops; returns the counts (docs/guide/monitoring.md)."""
        counters = _Counters()
        self._lib.fcsl_sim_telemetry_stop(self.handle(), byref(counters))
        return {name: int(getattr(counters, name)) for name in _SENT}

    def observers(self, endpoint: str, name_space: str = "") -> None:
        """Puts the hosted machine's channels on a bus of their own (docs/reference/transports.md), which listens on `tcp:HOST:PORT`.

        Only before the first tick and before `serve`. name_space: in front of the keys, with or without surrounding
        slashes. Raises SimError.
        """
        within = name_space.strip("/").encode()
        self._check(self._lib.fcsl_sim_observers(self.handle(), endpoint.encode(), within, byref(self._error)))

    def observers_stop(self) -> dict[str, int]:
        """Puts the remaining ticks and stops; returns the counts (docs/reference/transports.md)."""
        counters = _Observed()
        self._lib.fcsl_sim_observers_stop(self.handle(), byref(counters))
        return {name: int(getattr(counters, name)) for name in _OBSERVED}

    def ros(self, endpoint: str, name_space: str = "") -> None:
        """Publishes the hosted machine's ROS 2 topics and /clock through a bridge, which connects to `tcp:HOST:PORT`
        (docs/reference/transports.md). As `observers`.
        """
        within = name_space.encode()
        self._check(self._lib.fcsl_sim_ros(self.handle(), endpoint.encode(), within, byref(self._error)))

    def ros_stop(self) -> dict[str, int]:
        """Puts the remaining ticks and stops; returns the counts (docs/reference/transports.md)."""
        counters = _Ros()
        self._lib.fcsl_sim_ros_stop(self.handle(), byref(counters))
        return {name: int(getattr(counters, name)) for name in _ROS}

    def sense(self) -> bytes:
        """Advances to the next tick and returns its sensor message."""
        size = self._lib.fcsl_sim_sense(self.handle(), self._message, len(self._message), byref(self._error))
        return ctypes.string_at(self._message, self._check(size))

    def actuate(self, message: bytes) -> None:
        """Takes the actuator message of the sensed tick, and completes the tick."""
        self._check(self._lib.fcsl_sim_actuate(self.handle(), message, len(message), byref(self._error)))

    def channel_data(self) -> int:
        """Address of a machine struct with the channels of the last sensed tick; its other fields are undefined."""
        return int(self._lib.fcsl_sim_channel_data(self.handle()))

    def sampled(self, channel: int) -> bool:
        """Whether the last sensed tick has a sample of channel number `channel`."""
        return bool(self._lib.fcsl_sim_sampled(self.handle(), channel))

    def instance_data(self, instance: str) -> int:
        """Address of the instance's struct."""
        return int(self._lib.fcsl_sim_instance_data(self.handle(), self.instances[instance]))

    def truth_names(self) -> list[str]:
        """`<instance>.outputs.<field>`, with `[i]` for each scalar of an array, in the order of truth_values."""
        names = []
        for instance in self.instances:
            for field in self.tables[instance].of_role("output"):
                path, shape = f"{instance}.{field.path}", shape_of(field.type)
                names += [f"{path}[{i}]" for i in range(count_of(field.type))] if shape else [path]
        return names

    def truth_values(self) -> bytes:
        """All truth values now, each a little-endian double, in the order of truth_names."""
        size = self._lib.fcsl_sim_truth_values(self.handle(), self._truth, len(self._truth) // 8)
        return ctypes.string_at(self._truth, 8 * size)

    def model_message_type(self, instance: str) -> str:
        """ROS 2 type of the instance's outputs, for example `fcsl_sim/msg/LanderPlant`."""
        return str(self._lib.fcsl_sim_model_message_type(self.handle(), self.instances[instance]).decode())

    def model_message_schema(self, instance: str) -> str:
        """Complete ros2msg text of that type."""
        return str(self._lib.fcsl_sim_model_message_schema(self.handle(), self.instances[instance]).decode())

    def model_message(self, instance: str) -> bytes:
        """CDR of the instance's outputs at the last sensed tick."""
        index = self.instances[instance]
        size = self._lib.fcsl_sim_model_message(self.handle(), index, self._truth, len(self._truth))
        return ctypes.string_at(self._truth, self._check(size))

    def get(self, path: str) -> Scalar | list[Scalar]:
        """The value at `<instance>.<field>` now; an array as a flat list, row-major. Raises SimError."""
        instance, _, field_path = path.partition(".")
        table = self.tables.get(instance)
        field = table.fields.get(field_path) if table else None
        if field is None or instance not in self.instances:
            raise SimError(f"`{path}`: the simulation has no such field")
        address = self._lib.fcsl_sim_instance_data(self.handle(), self.instances[instance])
        return field.decode(ctypes.string_at(address + field.offset, struct.calcsize(f"={field.format}")))
