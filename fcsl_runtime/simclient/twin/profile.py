# SPDX-License-Identifier: Apache-2.0
"""Inputs of every tick, for `twin.inject`: from arrays, or from a bag that FCSL recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..c_machine import TYPE_FORMATS
from ..descriptor import Channel, Field, Machine
from ..errors import BagError, TwinError
from ..paths import Selection, resolve
from ..samples import NO_CHANNEL, SAMPLE
from ..values import encode

if TYPE_CHECKING:
    from ..bag import Bag, RecordedMachine
    from .twin import Twin

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Samples:
    """Rows of SAMPLE in order of tick, and the scalars that they point to."""

    rows: Array
    payloads: bytes

    def moved(self, ticks: int) -> Self:
        """The same, so many ticks later."""
        rows = self.rows.copy()
        rows["tick"] += np.uint64(ticks)
        return type(self)(rows, self.payloads)

    def between(self, begin: int, end: int) -> Self:
        """Those of ticks from `begin` to before `end`."""
        low, high = np.searchsorted(self.rows["tick"], (begin, end))
        return type(self)(self.rows[low:high], self.payloads)


@dataclass(frozen=True)
class Profile:
    """What to give to the machine, in ticks that count from 0; `attach` are the sensor channels that it serves."""

    samples: Samples
    ticks: int
    attach: tuple[str, ...]


def read_profile(twin: Twin, source: Mapping[str, Any] | str | Path | Bag) -> Profile:
    """Checks and packs a profile. Raises TwinError or BagError."""
    if isinstance(source, Mapping):
        return _from_arrays(twin, source)
    from ..bag import Bag

    return _from_bag(twin.machine, source if isinstance(source, Bag) else Bag(source))


# ---- arrays -----------------------------------------------------------------------------------------------------------


def _from_arrays(twin: Twin, arrays: Mapping[str, Any]) -> Profile:
    machine = twin.machine
    sensors = {c.name: c for c in machine.channels if c.direction == "sensor"}
    if not arrays:
        raise TwinError("inject(): no array is given")
    lengths = {path: len(array) for path, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{path} {length}" for path, length in lengths.items())
        raise TwinError(f"inject(): the arrays are of different lengths, in ticks: {told}")
    parts, payloads, size = [], [], 0
    for path, array in arrays.items():
        channel = sensors.get(path)
        part = _target(path, channel, machine)
        rows = np.zeros(lengths[path], SAMPLE)
        rows["tick"] = np.arange(len(rows))
        rows["payload"] = size + np.arange(len(rows)) * part.size
        rows["channel"] = NO_CHANNEL if channel is None else channel.index
        rows["field"], rows["element"], rows["size"] = part.field.index, part.element, part.size
        data = _encoded(path, array, part, machine)
        parts.append(rows[~_masked(array)])
        payloads.append(data)
        size += len(data)
    every = np.concatenate(parts)
    every = every[np.argsort(every["tick"], kind="stable")]
    served = tuple(path for path in arrays if path in sensors)
    return Profile(Samples(every, b"".join(payloads)), next(iter(lengths.values())), served)


def _target(path: str, channel: Channel | None, machine: Machine) -> Selection:
    """What a key names: a channel's field, or a field (or a part of one) that a host may write."""
    part = resolve(path if channel is None else channel.field.path, machine)
    if not isinstance(part, Selection):
        raise TwinError(f"{path}: a struct; give an array for each of its fields")
    if channel is None and not part.field.writable:
        raise TwinError(f"{path}: a host may not write it; twin.set() says why")
    return part


def _masked(array: Any) -> Array:
    """Ticks of which any element is masked."""
    mask = np.ma.getmaskarray(array) if isinstance(array, np.ma.MaskedArray) else np.zeros(len(array), bool)
    return np.asarray(mask.reshape(len(mask), -1).any(axis=1))


def _encoded(path: str, array: Any, part: Selection, machine: Machine) -> bytes:
    """The scalars of all ticks, one tick after another."""
    field = part.field
    if isinstance(array, np.ma.MaskedArray):
        array = array.filled(np.zeros(1, array.dtype)[0])
    if field.type not in ("bool", "i32", "i64", "u32", "u64", "f32", "f64"):
        return b"".join(
            encode(value, field, f"{path} at tick {k}", part.shape, machine) for k, value in enumerate(array)
        )
    given = np.asarray(array)
    if given.shape != (len(given), *part.shape):
        wanted = " × ".join(map(str, ("ticks", *part.shape)))
        raise TwinError(f"{path}: an array of {wanted} wanted, got one of {' × '.join(map(str, given.shape))}")
    _check_kind(path, given, field)
    return np.ascontiguousarray(given.astype(f"={TYPE_FORMATS[field.type]}")).tobytes()


def _check_kind(path: str, given: Array, field: Field) -> None:
    """As `set` takes values: no bool for a number, no float for an integer, nothing out of the range of the type."""
    kinds = {"bool": "b", "f32": "iuf", "f64": "iuf"}.get(field.type, "iu")
    if given.dtype.kind not in kinds:
        raise TwinError(f"{path}: {field.type_text} wanted, got an array of {given.dtype}")
    if kinds == "iu" and len(given):
        limits = np.iinfo(f"={TYPE_FORMATS[field.type]}")
        if int(given.min()) < limits.min or int(given.max()) > limits.max:
            raise TwinError(f"{path}: values are out of the range of {field.type} ({limits.min} to {limits.max})")
    elif field.type == "f32" and (np.isfinite(given) & (np.abs(given) > np.finfo(np.float32).max)).any():
        raise TwinError(f"{path}: values are out of the range of f32")


# ---- a bag ------------------------------------------------------------------------------------------------------------


def _from_bag(machine: Machine, bag: Bag) -> Profile:
    """What its host wrote to inputs and sensors of instances that `machine` has."""
    from ..replay.reproduce import ATTACH, CHANNEL, SET

    recorded = bag.machine(machine.name if any(m.name == machine.name for m in bag.machines()) else "")
    first, ticks = _span(bag, recorded)
    sensors = {c.name: c for c in machine.channels if c.direction == "sensor"}
    instances = {instance.name for instance in machine.instances}
    entries: list[tuple[int, ...]] = []
    payloads, size = [], 0
    attach: set[str] = set()
    for _, _, data in bag.messages({recorded.writes}):
        write = bag.decode_own(recorded.writes, data, ("tick", "kind", "path", "element", "data"))
        value, tick = bytes(write.data), write.tick - first
        if write.kind == ATTACH:
            attach |= {write.path} & set(sensors) if write.path else set(sensors)
        if not 0 <= tick < ticks:
            continue
        if write.kind == CHANNEL and write.path in sensors:
            field = sensors[write.path].field
            _check_size(bag, write.path, len(value), field.size)
            age, stamp = getattr(write, "age_ticks", 0), getattr(write, "stamp_ns", 0)
            attach.add(write.path)
            entries.append((tick, stamp, sensors[write.path].index, age, size, 0, 0, 0, 0))
        elif write.kind == SET and write.path.partition(".")[0] in instances:
            known = machine.fields.get(write.path)
            if known is None:
                raise BagError(f"{bag.path}: it writes `{write.path}`, which machine `{machine.name}` does not have")
            if known.role == "parameter" or not known.writable:
                continue
            _check_size(bag, write.path, len(value) % (known.size // known.count), 0)
            entries.append((tick, 0, NO_CHANNEL, 0, size, known.index, write.element, len(value), 0))
        else:
            continue
        payloads.append(value)
        size += len(value)
    rows = np.array(entries, SAMPLE)
    return Profile(Samples(rows, b"".join(payloads)), ticks, tuple(sorted(attach)))


def _check_size(bag: Bag, path: str, found: int, wanted: int) -> None:
    if found != wanted:
        raise BagError(f"{bag.path}: what it writes to `{path}` is of another type than in this machine")


def _span(bag: Bag, recorded: RecordedMachine) -> tuple[int, int]:
    """The first tick of the record, and how many there are."""
    data = next((data for _, _, data in bag.messages({recorded.checkpoint})), None)
    if data is None:
        raise BagError(f"{bag.path}: the initial checkpoint is missing")
    first = int(bag.decode_own(recorded.checkpoint, data, ("tick",)).tick)
    last = {topic: data for topic, _, data in bag.messages({recorded.state, *recorded.outputs.values()})}
    ticks = [int(bag.decode_own(topic, data, ("tick",)).tick) for topic, data in last.items()]
    return first, max(ticks, default=first - 1) + 1 - first
