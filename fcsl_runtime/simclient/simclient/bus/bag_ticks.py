# SPDX-License-Identifier: Apache-2.0
"""A bag as ticks of a machine's channels: one of `fcsl bus record`, or one that a host recorded, with its machine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from ..bag import Bag, RecordedMachine
from ..bag.bus_topics import topic_of
from ..c_machine import TYPE_FORMATS
from ..descriptor import Machine
from ..errors import BagError
from ..link.message import Channel as Row
from ..link.message import table_hash
from ..run import Run
from .machine import BusChannel, BusMachine, read_machine
from .messages import DESCRIPTOR

#: HostWrite.kind
_CHANNEL, _RESTORE = 3, 2
_KINDS = ("SET", "SET_STATE", "RESTORE", "CHANNEL", "OVERRUN", "ATTACH", "IMPURE", "FAULT", "HEALTH", "EVENTS", "LOST")
#: What is no doing of a host's: the clock's verdicts, what instances left, the beginning of sampling.
_NOT_DONE = ("CHANNEL", "OVERRUN", "ATTACH", "IMPURE", "EVENTS")
_TICK_AT, _VALUE_AT = 20, 28
_SCALARS = ("bool", "i32", "i64", "u32", "u64", "f32", "f64")
#: A longer gap is damage.
_GAP_MAX = 10_000_000


@dataclass
class BagTick:
    """Values by channel, as bytes of the bus; those of `actuators` only as far as the bag has them."""

    tick: int
    sensors: dict[str, bytes] = field(default_factory=dict)
    actuators: dict[str, bytes] = field(default_factory=dict)


#: Takes the channel's value out of a message of its topic.
_Value = Callable[[bytes], bytes]


class BagTicks:
    """`left_out` are things that the host did besides, by kind; `stop` says why the ticks end before the bag does. Both
    are complete when `ticks` is."""

    def __init__(self, bag: Bag, recorded: RecordedMachine, machine: BusMachine):
        self.machine = machine
        self.left_out: Counter[str] = Counter()
        self.stop = ""
        self._bag, self._recorded = bag, recorded
        self._channels = {channel.name: channel for channel in machine.channels}
        #: Samples come from the writes: they are all there, and nothing else is.
        self._from_writes = not recorded.by_bystander
        #: By topic, the channels in its messages.
        self._parts: dict[str, list[tuple[BusChannel, _Value]]] = {}

    def ticks(self) -> Iterator[BagTick]:
        """In order and without a gap: a tick that the bag lacks has no values. Raises BagError."""
        self.left_out, self.stop, self._from_writes = Counter(), "", not self._recorded.by_bystander
        current: BagTick | None = None
        for topic, data in self._messages():
            if topic in (self._recorded.checkpoint, self._recorded.lacks):
                self._from_writes = not self._recorded.by_bystander or topic == self._recorded.checkpoint
                continue
            tick = self._tick_of(topic, data)
            current = current or BagTick(tick)
            if tick < current.tick:
                self.stop = f"the bag goes back to tick {tick}, behind tick {current.tick}"
                break
            if tick - current.tick > _GAP_MAX:
                raise BagError(f"{self._bag.path}: a message of tick {tick} comes after one of tick {current.tick}")
            while current.tick < tick:
                yield current
                current = BagTick(current.tick + 1)
            self._take(current, topic, data)
            if self.stop:  # this tick did not come
                return
        if current is not None:
            yield current

    def check(self) -> None:
        """Raises BagError where there is nothing to play."""
        if not any(tick.sensors for tick in self.ticks()):
            raise BagError(f"{self._bag.path}: it has no values of sensors of `{self.machine.name}`")

    def _messages(self) -> Iterator[tuple[str, bytes]]:
        recorded = self._recorded
        topics = {*self._parts, recorded.writes, recorded.checkpoint, recorded.lacks}
        for topic, _, data in self._bag.messages_before_damage(topics & set(self._bag.topics)):
            yield topic, data
        if self._bag.truncated:
            self.stop = f"the bag is incomplete: {self._bag.truncated}"

    def _tick_of(self, topic: str, data: bytes) -> int:
        if len(data) < _VALUE_AT:
            raise BagError(f"{self._bag.path}: a message of `{topic}` ({len(data)} bytes) does not match its schema")
        return int.from_bytes(data[_TICK_AT:_VALUE_AT], "little")

    def _take(self, current: BagTick, topic: str, data: bytes) -> None:
        if topic == self._recorded.writes:
            self._take_write(current, data)
            return
        for channel, value_of in self._parts[topic]:
            if channel.direction == "report" or (channel.direction == "sensor" and self._from_writes):
                continue
            value = value_of(data)
            if channel.decode(value) is None:
                raise BagError(f"{self._bag.path}: tick {current.tick} has a value that `{channel.name}` does not have")
            (current.sensors if channel.direction == "sensor" else current.actuators)[channel.name] = value

    def _take_write(self, current: BagTick, data: bytes) -> None:
        write = self._bag.decode_own(self._recorded.writes, data, ("kind", "path", "data"))
        kind = _KINDS[write.kind] if write.kind < len(_KINDS) else f"kind {write.kind}"
        if kind not in _NOT_DONE:
            self.left_out[kind] += 1
        if write.kind == _RESTORE:
            self.stop = f"a checkpoint was restored before tick {current.tick}"
        elif write.kind == _CHANNEL and write.path in self._channels:
            channel = self._channels[write.path]
            value = _shortened(bytes(write.data)) if channel.is_blob else bytes(write.data)
            if channel.decode(value) is None:
                raise BagError(f"{self._bag.path}: tick {current.tick} has a value that `{channel.name}` does not have")
            current.sensors[channel.name] = value


def _shortened(field_bytes: bytes) -> bytes:
    """A blob's bytes: its field is their number and a scalar for each."""
    count = int.from_bytes(field_bytes[:4], "little")
    return field_bytes[4::4][:count]


def read_bag_ticks(bag: Bag, run: Run | None, wanted: str = "") -> BagTicks:
    """`run`: the machine of a bag that a host recorded; one of `fcsl bus record` has its own. Raises BagError, BusError."""
    recorded = bag.machine(wanted, by_bystanders=True)
    if recorded.by_bystander:
        return _of_bystander(bag, recorded)
    if run is None:
        raise BagError(f"{bag.path}: a host recorded it, so it needs the machine: --config FILE or --library FILE")
    return _of_host(bag, recorded, run)


def _of_bystander(bag: Bag, recorded: RecordedMachine) -> BagTicks:
    topic = topic_of(recorded.prefix[1:], DESCRIPTOR)
    data = next((data for _, _, data in bag.messages({topic})), None)
    if data is None:
        raise BagError(f"{bag.path}: nothing came of `{recorded.name}` when it was recorded")
    machine = read_machine(recorded.prefix[1:], str(bag.decode_own(topic, data, ("data",)).data))
    ticks = BagTicks(bag, recorded, machine)
    for channel in machine.channels:
        begin = _VALUE_AT + (4 if channel.is_blob else 0)
        name = topic_of(machine.prefix, channel.name)
        ticks._parts[name] = [(channel, lambda data, begin=begin: data[begin:])]  # type: ignore[misc]
    return ticks


def _of_host(bag: Bag, recorded: RecordedMachine, run: Run) -> BagTicks:
    if run.machine.name != recorded.name:
        raise BagError(f"{bag.path}: it records machine `{recorded.name}`, not `{run.machine.name}`")
    machine = _machine_of(run, recorded.prefix[1:])
    ticks = BagTicks(bag, recorded, machine)
    ticks._parts[recorded.state] = []  # of every tick
    for channel, described in zip(machine.channels, run.machine.channels, strict=True):
        instance, _, name = described.field.path.partition(".outputs.")
        topic = recorded.outputs.get(instance, "")
        layout = bag.layout(topic) if channel.direction == "actuator" and topic in bag.topics else None
        if layout is not None and name in layout.leaves:
            begin, size = layout.leaves[name].offset, described.field.size
            ticks._parts.setdefault(topic, []).append((channel, _cut(begin, size, channel.is_blob)))
    return ticks


def _cut(begin: int, size: int, is_blob: bool) -> _Value:
    def value_of(data: bytes) -> bytes:
        value = data[begin : begin + size]
        return _shortened(value) if is_blob else value

    return value_of


def _machine_of(run: Run, prefix: str) -> BusMachine:
    """As a descriptor of the bus says it."""
    machine: Machine = run.machine
    described = run.descriptor()
    rows, channels = [], []
    for channel in machine.channels:
        kind = ("field", "quaternion", "blob")[described.channels[channel.index].as_]
        scalar = channel.field.type if channel.field.type in _SCALARS else "i32"
        shape = (channel.field.count - 1,) if kind == "blob" else channel.field.shape
        rows.append(
            Row(
                channel.id,
                channel.direction == "actuator",
                0 if kind == "blob" else _SCALARS.index(scalar),
                shape,
                kind,
            )
        )
        assert scalar in TYPE_FORMATS
        channels.append(
            BusChannel(
                index=channel.index,
                name=channel.name,
                direction=channel.direction,
                type=scalar,
                shape=shape,
                is_blob=kind == "blob",
                unit=channel.field.unit,
                doc=channel.field.doc,
            )
        )
    return BusMachine(prefix, machine.name, machine.source_hash, table_hash(rows), machine.tick_hz, tuple(channels), "")
