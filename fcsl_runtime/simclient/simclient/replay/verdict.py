# SPDX-License-Identifier: Apache-2.0
"""The result of a replay: the first value that differs; and the comparison of one instance's outputs."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ..bag import Bag, is_made_for_a_record
from ..descriptor import Field, Machine
from ..errors import BagError, TwinError
from ..ros.cdr import Layout, bits, fixed_layout
from ..run import Run
from ..values import decode, scalar_reader

#: The encapsulation and the stamp of a message, which depends on the host's clock.
_STAMP_END = 12
#: source_hash and layout_hash of the monitor, which what requirements remember begins with (docs/guide/recording.md).
MEMORY_HASHES_BYTES = 128
_NUMBERS = ("i32", "i64", "u32", "u64", "f32", "f64")


@dataclass(frozen=True)
class Divergence:
    """The first value that differs. Bits are hex, most significant digit first."""

    tick: int
    time_ns: int
    path: str
    recorded: str
    replayed: str
    recorded_bits: str = ""
    replayed_bits: str = ""

    def __str__(self) -> str:
        lines = [f"first divergence at tick {self.tick} (t = {self.time_ns / 1e9:.9f} s)", f"  path      {self.path}"]
        for label, hexadecimal, text in (
            ("recorded", self.recorded_bits, self.recorded),
            ("replayed", self.replayed_bits, self.replayed),
        ):
            lines.append(f"  {label}  {hexadecimal + '  ' if hexadecimal else ''}{text}")
        return "\n".join(lines)


@dataclass
class Verdict:
    """The result of a replay: `divergence` is None if everything in the bag was reproduced identically.

    `missing` lists records that the bag lacks, so that not every tick could be compared; empty if it is complete.
    `notes` are remarks for the user that do not affect the verdict. `other_sources`: the machine that ran is of other sources,
    with the parameters of the record.
    """

    ticks: int = 0
    values: int = 0
    divergence: Divergence | None = None
    missing: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    #: Checkpoints of the bag with which the whole machine struct agreed.
    checkpoints: int = 0
    other_sources: bool = False

    @property
    def identical(self) -> bool:
        return self.divergence is None and not self.missing

    def __str__(self) -> str:
        if self.divergence is not None:
            return str(self.divergence)
        if self.missing:
            return "\n".join(
                [f"{self.ticks} ticks, identical as far as the bag goes", *(f"  {m}" for m in self.missing)]
            )
        return f"{self.ticks} ticks, identical{' with the recorded parameters' if self.other_sources else ''}"


def struct_difference(was: bytes, now: bytes, machine: Machine) -> tuple[str, str, str, str, str] | None:
    """As OutputComparison.differ, of two machine structs with what requirements remember behind them; that only counts if
    it is of the same requirements.
    """
    own = machine.size
    if was == now or (
        was[:own] == now[:own] and was[own : own + MEMORY_HASHES_BYTES] != now[own : own + MEMORY_HASHES_BYTES]
    ):
        return None
    if len(was) < own:
        return "(the checkpoint)", f"{len(was)} bytes", f"{own} bytes", "", ""
    at = next((i for i in range(own) if was[i] != now[i]), own)
    if at == own:
        return "(the checkpoint: what requirements remember)", f"{len(was) - own} bytes", "other bytes", "", ""
    found = next((f for f in machine.fields.values() if f.offset <= at < f.offset + f.size), None)
    if found is None:
        return f"(the checkpoint: byte {at})", "", "", _hex(was[at]), _hex(now[at])
    size = found.size // found.count
    element = (at - found.offset) // size
    begin = found.offset + element * size
    old, new = was[begin : begin + size], now[begin : begin + size]
    one = replace(found, count=1, size=size, shape=())
    path = found.path + (f"[{element}]" if found.shape else "")
    words = [_word(data, one, machine) for data in (old, new)]
    return f"{path} (in the checkpoint)", words[0], words[1], "0x" + old[::-1].hex(), "0x" + new[::-1].hex()


def _word(data: bytes, one: Field, machine: Machine) -> str:
    try:
        return repr(decode(data, one, (), machine))
    except (TwinError, ValueError, IndexError):  # a number that no state, request or health has
        return "no value"


class OutputComparison:
    """Compares one instance's recorded messages with those of the replayed run."""

    def __init__(self, bag: Bag, topic: str, run: Run, instance: int):
        described = run.machine.instances[instance]
        layout = bag.layout(topic)
        if layout is None or "tick" not in layout.leaves:
            raise BagError(f"{bag.path}: topic `{topic}` is not the output of a machine")
        now = _layout_of(described.message_text, described.message_type)
        if now is None:
            raise TwinError(f"the message of instance `{described.name}` has no fixed layout")
        self.name = described.name
        self.topic = topic
        self.recorded: Layout = layout
        self.replayed: Layout = now
        self.outputs = [name for name in layout.leaves if not name.startswith("header.") and name != "tick"]
        self.messages = 0
        self._partial = is_made_for_a_record(bag.topic(topic))
        self._run = run
        self._instance = instance
        self._tick_at = layout.leaves["tick"].offset

    def tick_of(self, data: bytes) -> int:
        if not self.recorded.fits(data):
            raise BagError(f"a message of `{self.topic}` ({len(data)} bytes) does not match its schema")
        return int.from_bytes(data[self._tick_at : self._tick_at + 8], "little")

    def differ(self, data: bytes) -> tuple[str, str, str, str, str] | None:
        """(path, recorded, replayed, recorded bits, replayed bits) of the first difference; None if equal."""
        message = self._run.message(self._instance)
        if message[_STAMP_END:] == data[_STAMP_END:]:
            return None
        was, now = self.recorded.stack([data])[0], self.replayed.stack([message])[0]
        for name in [leaf for leaf in self.recorded.leaves if not leaf.startswith("header.stamp.")]:
            path = f"{self.name}.outputs.{name}" if name in self.outputs else f"{self.name} {name}"
            if name not in self.replayed.leaves:
                if self._partial:  # an output without a field: the request of an algorithm that makes none
                    continue
                return path, str(was[name]), "not an output of this machine", "", ""
            a, b = bits(np.atleast_1d(was[name])), bits(np.atleast_1d(now[name]))
            if a.dtype != b.dtype or a.shape != b.shape:
                return path, f"of type {a.dtype}[{a.size}]", f"of type {b.dtype}[{b.size}]", "", ""
            if a.tobytes() != b.tobytes():
                at = next(i for i in range(a.size) if a[i : i + 1].tobytes() != b[i : i + 1].tobytes())
                index = f"[{at}]" if self.recorded.leaves[name].count else ""
                was_text, now_text = self._decimal(path, a[at]), self._decimal(path, b[at])
                return path + index, was_text, now_text, _hex(a[at]), _hex(b[at])
        extra = [name for name in self.replayed.leaves if name not in self.recorded.leaves and not self._partial]
        return (f"{self.name}.outputs.{extra[0]}", "not recorded", str(now[extra[0]]), "", "") if extra else None

    def _decimal(self, path: str, value: Any) -> str:
        """Shortest decimal that reads back as the same value; the name of a health, request or truth value."""
        field = self._run.machine.fields.get(path)
        if field is None or field.type in _NUMBERS:
            return str(value)
        return repr(scalar_reader(field, self._run.machine)(int(value)))


@functools.cache
def _layout_of(text: str, kind: str) -> Layout | None:
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(text, kind))
    return fixed_layout(store.fielddefs, kind)


def _hex(value: Any) -> str:
    return "0x" + np.asarray(value).tobytes()[::-1].hex()
