# SPDX-License-Identifier: Apache-2.0
"""A simulation behind the interface of a run (simclient.run.Run): one descriptor for the hosted machine and all models.

The descriptor is of a virtual memory: the machine struct, then those of further controllers, then the struct of each
instance of a model. A field of the machine has its own path and number, one of another controller the path
`<controller>.<path>`, one of a model `<instance>.<path>`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import addressof, byref, c_char, create_string_buffer
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from fcsl_compiler.api.files import digest
from fcsl_compiler.api.types import count_of, scalar_of, shape_of
from simclient.descriptor import Field, Machine, read_machine
from simclient.errors import TwinError
from simclient.events import Event, read_events
from simclient.fork_safety import for_children, not_for_children
from simclient.instance_times import InstanceTime, read_times
from simclient.parameters import CParameters
from simclient.run import Run

from .config import SimConfig
from .errors import SimError
from .models import ModelField
from .native import Simulation

#: Ticks per call into C, during which Python handles no signal.
_SLICE_TICKS = 100_000
#: Between two structs in the virtual memory; more than what a trace copies to join two fields.
_GAP_BYTES = 64
#: Of rows that one call into C traces.
_TRACED_BYTES = 1 << 20


@contextmanager
def twin_errors() -> Iterator[None]:
    """SimError becomes TwinError, with the same text."""
    try:
        yield
    except SimError as error:
        raise TwinError(str(error)) from None


@dataclass(frozen=True)
class _Region:
    """A struct at `begin` of the virtual memory: of an instance of a model, or of the controller whose fcsl_run_t is at
    `run`. `name` is empty for the first controller."""

    name: str
    begin: int
    address: int
    memory: memoryview
    run: int | None


class SimRun(Run):
    """Owns a simulation and, through it, its hosted machine. Not thread-safe; every failure is a TwinError."""

    def __init__(self, config: SimConfig):
        self.config = config
        with twin_errors():
            self._simulation = Simulation(config.plan, config.tables)
        self._regions: list[_Region] = []
        self._firsts: list[int] = []  # by region: the number of its first field
        self._traces: list[SimTrace] = []
        self._zeros = create_string_buffer(_GAP_BYTES)
        super().__init__(config.library, config.machine.name)
        #: By name; the first one, whose name is empty here, leads.
        self._machines = {"": self.machine}
        self._place("", self.address, self.machine.size, self.handle())
        for name, run in self._simulation.companion_runs().items():
            machine = self._machines[name] = read_machine(self._lib.fcsl_run_machine(run))
            self._place(name, self._lib.fcsl_run_data(run), machine.size, run)
        for name in self._simulation.instances:
            size = max((field.offset + _size(field) for field in config.tables[name].fields.values()), default=0)
            self._place(name, self._simulation.instance_data(name), size, None)
        self._begins = [region.begin for region in self._regions]
        self._sources = _Sources(config, self._machines)
        self.machine = self._combined()
        self._fields = tuple(self.machine.fields.values())

    def _open(self, library: Path, machine: str | None, parameters: CParameters | None) -> int | None:
        return self._simulation.hosted()

    def _place(self, name: str, address: int, size: int, run: int | None) -> None:
        last = self._regions[-1] if self._regions else None
        begin = last.begin + len(last.memory) + _GAP_BYTES if last else 0
        memory = memoryview((c_char * size).from_address(address)).cast("B")
        self._regions.append(_Region(name, begin, address, memory, run))

    def _combined(self) -> Machine:
        """The descriptor of the virtual memory. Raises TwinError for two fields with the same path."""
        fields: dict[str, Field] = {}
        for region in self._regions:
            self._firsts.append(len(fields))
            if region.run is not None:
                rows = [self._of_machine(region, field) for field in self._machines[region.name].fields.values()]
            else:
                rows = [_of_model(region, field) for field in self.config.tables[region.name].fields.values()]
            for row in rows:
                if row.path in fields:
                    raise TwinError(f"`{row.path}` is in the machine and in a model; rename instance `{region.name}`")
                source = self._sources.of_fields.get(row.path, row.connected_from)
                fields[row.path] = replace(row, index=len(fields), connected_from=source)
        last = self._regions[-1]
        layout = [f"{field.path} {field.type_text} {field.offset}" for field in fields.values()]
        machine = self._machines[""]
        size, layout_hash = last.begin + len(last.memory), digest(machine.layout_hash, *layout)
        return replace(machine, size=size, fields=fields, layout_hash=layout_hash)

    def _of_machine(self, region: _Region, field: Field) -> Field:
        """The row of a controller's field. States and requests of another machine than the first one are numbers."""
        if not region.name:
            return field
        one, lead = self._machines[region.name], self._machines[""]
        same = one.states == lead.states and one.requests == lead.requests
        numbered = field.type in ("state", "TransitionRequest") and not same
        source = field.connected_from
        return replace(
            field,
            path=f"{region.name}.{field.path}",
            type="i32" if numbered else field.type,
            offset=region.begin + field.offset,
            instance=f"{region.name}.{field.instance}" if field.instance else "",
            connected_from=f"{region.name}.{source}" if source in one.fields else source,
        )

    # ---- life -------------------------------------------------------------------------------------------------------

    def close(self) -> None:
        if self._handle is None:
            return
        self._handle, self._data = None, memoryview(b"")
        self._regions.clear()
        with twin_errors():
            self._simulation.close()

    def leave_to_parent(self) -> None:
        super().leave_to_parent()
        self._simulation.leave_to_parent()

    # ---- values -----------------------------------------------------------------------------------------------------

    def parts(self, offset: int, size: int) -> Iterator[tuple[_Region, int, int]]:
        """The parts of structs in a range of the virtual memory: each with its beginning and end within its struct."""
        self.handle()
        for region in self._regions[bisect_right(self._begins, offset) - 1 :]:
            begin, end = max(0, offset - region.begin), min(len(region.memory), offset + size - region.begin)
            if end <= 0:
                return
            if begin < end:
                yield region, begin, end

    def read(self, offset: int, size: int) -> bytes:
        self.handle()
        region = self._regions[bisect_right(self._begins, offset) - 1]
        at = offset - region.begin
        return bytes(region.memory[at : at + size])

    def is_fed(self, field: Field) -> bool:
        """Whether the simulation writes this field: a channel of a machine, or a connected input of a model."""
        return field.path in self._sources.of_fields

    def check_set(self, field: int, element: int, data: bytes) -> None:
        region, number, _ = self._find(field)
        if region.run is not None:
            check = self._lib.fcsl_run_check_set
            self._check(check(region.run, number, element, data, len(data), byref(self._error)))

    def set(self, field: int, element: int, data: bytes) -> None:
        region, number, at = self._find(field)
        if region.run is not None:
            write = self._lib.fcsl_run_set
            self._check(write(region.run, number, element, data, len(data), byref(self._error)))
            return
        target = self._fields[field]
        with twin_errors():
            self._simulation.write(region.name, at + element * (target.size // target.count), data)

    def _find(self, field: int) -> tuple[_Region, int, int]:
        """The struct of a field, its number among the fields of that, and its offset in that."""
        self.handle()
        offset = self._fields[field].offset
        place = bisect_right(self._begins, offset) - 1
        region = self._regions[place]
        return region, field - self._firsts[place], offset - region.begin

    def save(self) -> bytes:
        """The virtual memory."""
        self.handle()
        data = bytearray(self.machine.size)
        for region in self._regions:
            data[region.begin : region.begin + len(region.memory)] = region.memory
        return bytes(data)

    def restore(self, data: bytes) -> None:
        """Always raises TwinError: integrators and noise are outside of the structs."""
        raise TwinError("the structs of a simulation cannot be put back alone; restore a checkpoint")

    def checkpoint(self) -> bytes:
        self.handle()
        return self._simulation.checkpoint()

    def restore_checkpoint(self, checkpoint: bytes, ignore_source_hash: bool = False) -> None:
        if ignore_source_hash:
            raise TwinError(
                "a checkpoint of a simulation fits the same machine alone: ignore_source_hash is for AlgTwin"
            )
        self.handle()
        with twin_errors():
            self._simulation.restore_checkpoint(checkpoint)

    # ---- time -------------------------------------------------------------------------------------------------------

    def step(self, ticks: int) -> None:
        self.handle()
        while ticks > 0:
            ticks -= self._run_ticks(min(ticks, _SLICE_TICKS))

    def step_once(self) -> int:
        self.handle()
        self._run_ticks(1)
        return self.tick

    def _run_ticks(self, ticks: int) -> int:
        """Runs up to `ticks` ticks, at least one; returns how many."""
        if self._traces:
            return self._run_traced(ticks)
        with twin_errors():
            done = self._simulation.run(ticks)
        if done == 0:
            raise TwinError(self._over())
        return done

    def _run_traced(self, ticks: int) -> int:
        """Likewise, with a row for each tick in each trace."""
        row_bytes = sum(trace.row_bytes for trace in self._traces)
        parts = [part for trace in self._traces for part in trace.parts]
        ticks = min(ticks, max(1, _TRACED_BYTES // row_bytes))
        with twin_errors():
            done, rows, error = self._simulation.run_traced(ticks, parts)
        at = 0
        for trace in self._traces:
            begin, at = at, at + trace.row_bytes
            own = rows if trace.row_bytes == row_bytes else b"".join(_column(rows, row_bytes, begin, at))
            trace.take(own)
        if error or not done:
            raise TwinError(str(error) if error else self._over())
        return done

    def _over(self) -> str:
        """Why there is no next tick."""
        tick = self.tick
        held = self._simulation.status == "until"
        why = f"`until` held: {self.config.until}" if held else "its duration is over"
        fix = 'extend the file with {"until": null}' if held else "give from_config() a longer `duration`"
        return f"the simulation has ended after {tick} ticks, at {tick / self.machine.tick_hz:g} s: {why}; {fix}"

    def events(self) -> list[Event]:
        """Of all controllers, by time. Instances of further controllers begin with their controller's name."""
        found: list[Event] = []
        for region in self._regions:
            if region.run is not None:
                prefix = f"{region.name}." if region.name else ""
                own = read_events(self._lib, region.run, self._machines[region.name])
                found += [replace(event, instance=prefix + event.instance) for event in own]
        return sorted(found, key=lambda event: event.time_ns)

    def times(self) -> dict[str, InstanceTime]:
        """Of all controllers. Instances of further controllers begin with their controller's name."""
        found: dict[str, InstanceTime] = {}
        for region in self._regions:
            if region.run is not None:
                prefix = f"{region.name}." if region.name else ""
                found |= {prefix + name: row for name, row in read_times(self._lib, region.run).items()}
        return found

    def feed(self, samples: bytes, payloads: bytes, end: int) -> None:
        """As of Run; tick by tick in Python."""
        import numpy as np

        from simclient.samples import NO_CHANNEL, SAMPLE

        rows = np.frombuffer(samples, SAMPLE).tolist()
        for tick, due in groupby(rows, key=lambda row: int(row[0])):
            self.step(tick - self.tick)
            for _, stamp_ns, channel, age_ticks, at, field, element, size, _ in due:
                if channel != NO_CHANNEL:
                    size = self.machine.channels[channel].field.size
                    self.write_channel(channel, payloads[at : at + size], age_ticks, stamp_ns)
                else:
                    self.set(field, element, payloads[at : at + size])
        self.step(end - self.tick)

    def trace(self, ranges: Sequence[tuple[int, int]], rows: int) -> SimTrace:  # type: ignore[override]
        """Traces parts (offset, size) of the virtual memory."""
        trace = SimTrace(self._traces, self.addresses(ranges), rows)
        self._traces.append(trace)
        return trace

    def addresses(self, ranges: Sequence[tuple[int, int]], of: Simulation | None = None) -> list[tuple[int, int]]:
        """Address and size of the parts of structs in ranges (offset, size); zeros where no struct is, which is never more
        than a gap. `of`: another simulation of the same models and machines, in place of this one."""
        found = []
        begins = {region.name: self._address(region, of) if of else region.address for region in self._regions}
        for offset, size in ranges:
            at = offset
            for region, begin, end in self.parts(offset, size):
                if region.begin + begin > at:
                    found.append((addressof(self._zeros), region.begin + begin - at))
                found.append((begins[region.name] + begin, end - begin))
                at = region.begin + end
            if offset + size > at:
                found.append((addressof(self._zeros), offset + size - at))
        return found

    def _address(self, region: _Region, of: Simulation) -> int:
        """Of the same struct in another simulation."""
        if region.run is None:
            return of.instance_data(region.name)
        run = of.companion_runs()[region.name] if region.name else of.hosted()
        return int(self._lib.fcsl_run_data(run))

    # ---- channels ---------------------------------------------------------------------------------------------------

    def write_channel(self, channel: int, data: bytes, age_ticks: int = 0, stamp_ns: int = 0) -> None:
        name = self.machine.channels[channel].name
        source = self._sources.of_channels.get(name)
        if source is not None:
            where = source.partition(".")[0]
            raise TwinError(
                f"channel `{name}` gets its samples from `{source}`; set a parameter of `{where}`, or leave the "
                "connection out: in a file that extends this one, with other `connections`"
            )
        super().write_channel(channel, data, age_ticks, stamp_ns)

    # ---- recording --------------------------------------------------------------------------------------------------

    def record(self, bag: Path, name_space: str, lossless: bool, fields: str | None = None, split: str = "") -> None:
        self.handle()
        with twin_errors():
            self._simulation.record(bag, name_space, split)
        not_for_children(self)

    def record_stop(self) -> None:
        self.handle()
        for_children(self)
        with twin_errors():
            self._simulation.record_stop()


class SimTrace:
    """Parts of the virtual memory after each of the last `capacity` ticks (simclient.twin.host.Tap)."""

    def __init__(self, traces: list[SimTrace], parts: Sequence[tuple[int, int]], capacity: int):
        self._traces, self.parts, self.capacity = traces, parts, capacity
        self.row_bytes = sum(size for _, size in parts)
        self._ring = bytearray(capacity * self.row_bytes)
        self._rows = 0

    def take(self, rows: bytes) -> None:
        """Of the ticks that were run."""
        count = len(rows) // self.row_bytes
        kept = rows[max(0, count - self.capacity) * self.row_bytes :]
        begin = (self._rows + count - len(kept) // self.row_bytes) % self.capacity * self.row_bytes
        before = kept[: len(self._ring) - begin]
        self._ring[begin : begin + len(before)] = before
        self._ring[: len(kept) - len(before)] = kept[len(before) :]
        self._rows += count

    def rows(self) -> int:
        return self._rows

    def read(self, first: int, count: int) -> bytes:
        """`count` rows from row `first` on. Raises TwinError if they were discarded."""
        if first < self._rows - self.capacity or first + count > self._rows:
            raise TwinError(f"rows {first} to {first + count} of a trace were discarded, or are not there yet")
        begin = first % self.capacity
        before = min(count, self.capacity - begin) * self.row_bytes
        at, size = begin * self.row_bytes, count * self.row_bytes
        return bytes(self._ring[at : at + before] + self._ring[: size - before])

    def close(self) -> None:
        if self in self._traces:
            self._traces.remove(self)
        self.parts = ()


class _Sources:
    """What feeds fields of machines and inputs of models, from the plan (src/plan/plan.h)."""

    def __init__(self, config: SimConfig, machines: Mapping[str, Machine]):
        #: `<instance>.<output>` by sensor channel of the first controller.
        self.of_channels: dict[str, str] = {}
        #: The path of an output, or `<controller>.<channel>`, by the path of a field.
        self.of_fields: dict[str, str] = {}
        channels = {
            (name, channel.name): f"{name}.{channel.field.path}".removeprefix(".")
            for name, machine in machines.items()
            for channel in machine.channels
        }
        for one in config.plan.statements:
            word, rest = one.keyword, one.words
            if word == "link":
                self.of_fields[f"{rest[2]}.{rest[3]}"] = f"{rest[0]}.{rest[1]}"
            elif word == "actuator":
                self.of_fields[f"{rest[1]}.{rest[2]}"] = f"{config.controller}.{rest[0]}"
            elif word == "companion_actuator":
                self.of_fields[f"{rest[2]}.{rest[3]}"] = f"{rest[0]}.{rest[1]}"
            elif word == "sensor":
                self.of_channels[rest[2]] = self.of_fields[channels["", rest[2]]] = f"{rest[0]}.{rest[1]}"
            elif word == "companion_sensor":
                self.of_fields[channels[rest[2], rest[3]]] = f"{rest[0]}.{rest[1]}"
            elif word == "read":
                self.of_fields[f"{rest[1]}.{rest[2]}"] = rest[0]
            elif word == "write":
                self.of_fields[rest[2]] = f"{rest[0]}.{rest[1]}"


def _column(rows: bytes, row_bytes: int, begin: int, end: int) -> Iterator[bytes]:
    """A part of each row."""
    return (rows[at + begin : at + end] for at in range(0, len(rows), row_bytes))


def _size(field: ModelField) -> int:
    return count_of(field.type) * scalar_of(field.type).size


def _of_model(region: _Region, found: ModelField) -> Field:
    """The row of a model's field; its number and its source come later."""
    return Field(
        index=0,
        path=f"{region.name}.{found.path}",
        role=found.role,
        type=scalar_of(found.type).name,
        shape=shape_of(found.type),
        count=count_of(found.type),
        offset=region.begin + found.offset,
        size=_size(found),
        instance=region.name,
        connected_from="",
        unit=found.unit,
        doc=found.doc,
        writable=found.role != "output",
        frozen=False,
        impure=False,
    )
