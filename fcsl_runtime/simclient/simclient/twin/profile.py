# SPDX-License-Identifier: Apache-2.0
"""Inputs of every tick, for `twin.inject`: from arrays, or from a bag that FCSL recorded."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..c_machine import TYPE_FORMATS
from ..descriptor import Channel, Field, Machine, why_read_only
from ..errors import BagError, TwinError, did_you_mean
from ..paths import Selection, resolve, split_path
from ..samples import NO_CHANNEL, SAMPLE
from ..values import encode

if TYPE_CHECKING:
    from ..bag import Bag, RecordedMachine
    from .twin import Twin

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Samples:
    """Rows of SAMPLE in tick order, and the buffer of their scalars."""

    rows: Array
    payloads: bytes

    def moved(self, ticks: int) -> Self:
        """The same samples, `ticks` ticks later."""
        rows = self.rows.copy()
        rows["tick"] += np.uint64(ticks)
        return type(self)(rows, self.payloads)

    def between(self, begin: int, end: int) -> Self:
        """The samples of ticks from `begin` to before `end`."""
        low, high = np.searchsorted(self.rows["tick"], (begin, end))
        return type(self)(self.rows[low:high], self.payloads)


@dataclass(frozen=True)
class Profile:
    """Samples with ticks that count from 0; `attach` lists the sensor channels among their targets."""

    samples: Samples
    ticks: int
    attach: tuple[str, ...]

    def fields(self, machine: Machine) -> list[Field]:
        """The fields that are written by path."""
        rows = self.samples.rows
        table = tuple(machine.fields.values())
        return [table[index] for index in np.unique(rows["field"][rows["channel"] == NO_CHANNEL])]


def read_profile(twin: Twin, source: Mapping[str, Any] | str | Path | Bag) -> Profile:
    """Checks and packs a profile. Raises TwinError or BagError."""
    if isinstance(source, Mapping):
        return _from_arrays(twin, source)
    from ..bag import Bag
    from ..bag.formats import opened

    if not isinstance(source, str | Path | Bag):
        raise TwinError(f"inject({source!r}): a dict of paths and arrays, or a bag or its path, wanted")
    return _from_bag(twin.machine, opened(source))


# ---- arrays -----------------------------------------------------------------------------------------------------------


def _from_arrays(twin: Twin, arrays: Mapping[str, Any]) -> Profile:
    machine = twin.machine
    sensors = {c.name: c for c in machine.channels if c.direction == "sensor"}
    if not arrays:
        raise TwinError("inject(): no array is given")
    targets = {path: _target(path, sensors.get(path), machine) for path in arrays}
    arrays = {path: _array(path, array) for path, array in arrays.items()}
    lengths = {path: len(array) for path, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        lengths_text = ", ".join(f"{path} {length}" for path, length in lengths.items())
        raise TwinError(f"inject(): the arrays are of different lengths, in ticks: {lengths_text}")
    parts, payloads, size = [], [], 0
    for path, array in arrays.items():
        channel, part = sensors.get(path), targets[path]
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
    """The target of a key: a channel's field, or a field (or part of one) that a host may write."""
    if channel is not None:
        path = channel.field.path
    elif not isinstance(path, str) or path not in machine.fields:
        _check_channel(str(path), machine)
    part = resolve(path, machine)
    if not isinstance(part, Selection):
        raise TwinError(f"{path}: a struct; give an array for each of its fields")
    if channel is None and not part.field.writable:
        raise TwinError(f"{path}: {why_read_only(part.field)}")
    return part


def _check_channel(name: str, machine: Machine) -> None:
    """Rejects an actuator, and a misspelled sensor channel."""
    sensors = [c.name for c in machine.channels if c.direction == "sensor"]
    if any(c.name == name for c in machine.channels):
        raise TwinError(f"`{name}` is an actuator channel; there are sensor channels {', '.join(sensors) or 'none'}")
    hint = did_you_mean(name, sensors)
    if hint and hint == did_you_mean(name, [*sensors, *machine.fields]):
        raise TwinError(f"`{name}` is neither a sensor channel nor a path{hint}")


def _array(path: str, given: Any) -> Any:
    """An array with a row per tick, from an array or a list of names."""
    try:
        array = given if isinstance(given, np.ndarray) else np.asarray(given)
    except ValueError:
        raise TwinError(f"{path}: the rows of the array are of different lengths") from None
    if array.ndim == 0:
        raise TwinError(f"{path}: an array with a row for every tick wanted, got {given!r}")
    return array


def _masked(array: Any) -> Array:
    """Ticks with a masked element, bool of shape (ticks,)."""
    mask = np.ma.getmaskarray(array)
    return np.asarray(mask.any(axis=tuple(range(1, mask.ndim))))


def _encoded(path: str, array: Any, part: Selection, machine: Machine) -> bytes:
    """The scalars of all ticks as bytes, tick by tick."""
    field = part.field
    if field.bounded:
        _check_range(path, array, field)
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


def _check_range(path: str, array: Any, field: Field) -> None:
    """Before the first tick: a host may not set what is outside. Masked elements are not set."""
    values = np.ma.compressed(array) if isinstance(array, np.ma.MaskedArray) else np.asarray(array).ravel()
    if values.dtype.kind not in "iuf":
        return  # refused by its kind
    outside = values[~((values >= field.minimum) & (values <= field.maximum))]
    if len(outside):
        raise TwinError(f"{path}: lies in [{field.minimum:g}, {field.maximum:g}], not {outside[0]:g}")


def _check_kind(path: str, given: Array, field: Field) -> None:
    """The checks of `set`: no bool for a number, no float for an integer, no value out of range."""
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
    """The host's writes to inputs and sensors of the instances of `machine`, which may be a subset of the recorded one."""
    machines = bag.machines()
    recorded = bag.machine(machine.name if any(m.name == machine.name for m in machines) else "")
    instances = {instance.name for instance in machine.instances}
    is_part = recorded.name == machine.name and not instances >= set(recorded.outputs)
    first, ticks = _span(bag, recorded)
    reader = _Reader(machine, bag, instances, is_part)
    for _, _, data in bag.messages({recorded.writes}):
        write = bag.decode_own(recorded.writes, data, ("tick", "kind", "path", "element", "data"))
        reader.take(write, write.tick - first, ticks)
    if reader.passed_over and not reader.entries and not reader.attach:
        raise BagError(f"{bag.path}: its host wrote nothing to this part of `{machine.name}`; call tick({ticks})")
    if bag.truncated:
        warnings.warn(f"inject(): {ticks} ticks; the bag is incomplete: {bag.truncated}", stacklevel=4)
    samples = Samples(np.array(reader.entries, SAMPLE), bytes(reader.payloads))
    return Profile(samples, ticks, tuple(sorted(reader.attach)))


class _Reader:
    """Converts host writes of a bag to samples. Raises BagError for targets that the machine does not have."""

    def __init__(self, machine: Machine, bag: Bag, instances: set[str], is_part: bool):
        self._machine, self._bag, self._instances, self._is_part = machine, bag, instances, is_part
        self._sensors = {c.name: c for c in machine.channels if c.direction == "sensor"}
        self.entries: list[tuple[int, ...]] = []
        self.payloads = bytearray()
        self.attach: set[str] = set()
        self.passed_over = False  # a write to another part of the machine was skipped

    def take(self, write: Any, tick: int, ticks: int) -> None:
        """Converts one write at tick `tick` of `ticks`; a write before the first tick still attaches its channel."""
        from ..replay.reproduce import ATTACH, CHANNEL, SET

        value = bytes(write.data)
        if write.kind == ATTACH and not write.path:
            self.attach |= set(self._sensors)
        elif write.kind in (ATTACH, CHANNEL):
            channel = self._sensors.get(write.path)
            if channel is None:
                self._pass_over(f"feeds sensor channel `{write.path}`", did_you_mean(write.path, self._sensors))
                return
            if write.kind == ATTACH:
                self.attach.add(channel.name)
            elif 0 <= tick < ticks:
                self.attach.add(channel.name)
                self._check_size(write.path, len(value), channel.field.size)
                age, stamp = getattr(write, "age_ticks", 0), getattr(write, "stamp_ns", 0)
                self._add((tick, stamp, channel.index, age, len(self.payloads), 0, 0, 0, 0), value)
        elif write.kind == SET and 0 <= tick < ticks:
            self._set(write, tick, value)

    def _set(self, write: Any, tick: int, value: bytes) -> None:
        known = self._machine.fields.get(write.path)
        if known is None:
            is_ours = split_path(write.path)[0] in self._instances
            self._pass_over(f"writes `{write.path}`", did_you_mean(write.path, self._machine.fields), is_ours)
        elif known.role == "parameter":
            return
        elif not known.writable:
            raise BagError(f"{self._bag.path}: it writes `{write.path}`: {why_read_only(known)}")
        else:
            self._check_size(write.path, len(value) % (known.size // known.count), 0)
            where = (len(self.payloads), known.index, write.element, len(value), 0)
            self._add((tick, 0, NO_CHANNEL, 0, *where), value)

    def _add(self, entry: tuple[int, ...], value: bytes) -> None:
        self.entries.append(entry)
        self.payloads += value

    def _pass_over(self, what: str, hint: str, is_ours: bool = False) -> None:
        """Skips a write to another part of the recorded machine; an error if `machine` is the whole one."""
        if is_ours or not self._is_part:
            raise BagError(f"{self._bag.path}: it {what}, which machine `{self._machine.name}` does not have{hint}")
        self.passed_over = True

    def _check_size(self, path: str, found: int, wanted: int) -> None:
        if found != wanted:
            raise BagError(f"{self._bag.path}: its value for `{path}` has another type than in this machine")


def _span(bag: Bag, recorded: RecordedMachine) -> tuple[int, int]:
    """The first tick of the record, and the number of ticks."""
    data = next((data for _, _, data in bag.messages({recorded.checkpoint})), None)
    if data is None:
        raise BagError(f"{bag.path}: the initial checkpoint is missing")
    first = int(bag.decode_own(recorded.checkpoint, data, ("tick",)).tick)
    last = {topic: data for topic, _, data in bag.messages({recorded.state, *recorded.outputs.values()})}
    ticks = [int(bag.decode_own(topic, data, ("tick",)).tick) for topic, data in last.items()]
    return first, max(ticks, default=first - 1) + 1 - first
